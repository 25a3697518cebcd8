"""A real server, the node as a separate program, and a ROS 2 peer.

The tests run with the Python of an environment from `setup.sh`; without rclpy none of them
is collected. They require the program `wheelarm-server` (WHEELARM_SERVER) and the assets
(WHEELARM_ASSETS).
"""

import importlib.util
import os
import sys

import pytest

if importlib.util.find_spec("rclpy") is None:
    collect_ignore_glob = ["*"]
else:
    import rclpy
    from peer import ASSETS, PROGRAM, ROOT, ClientProbe, Peer, Program


@pytest.fixture
def programs():
    """Starts programs and ends them in reverse order."""
    started = []

    def start(*line, **options):
        started.append(Program(line, **options))
        return started[-1]

    yield start
    for one in reversed(started):
        one.close()


@pytest.fixture
def server(programs):
    """`server(*flags)` starts a server and returns its endpoint."""

    def start(*flags):
        line = programs(
            PROGRAM, "--assets", ASSETS, "--listen", "tcp/127.0.0.1:0", *flags
        ).wait_for("ready ")
        return line.split()[1]

    return start


@pytest.fixture
def bridge(programs):
    """`bridge(endpoint, *arguments)` starts the node as a program."""

    def start(endpoint, *arguments):
        env = {**os.environ, "PYTHONPATH": str(ROOT / "client/python/src")}
        program = programs(
            sys.executable, "-m", "wheelarm.ros", "--endpoint", endpoint, *arguments, env=env
        )
        program.wait_for("connected to")
        return program

    return start


@pytest.fixture
def probe():
    """`probe(endpoint)` connects a WheelArm client."""
    opened = []

    def start(endpoint):
        opened.append(ClientProbe(endpoint))
        return opened[-1]

    yield start
    for one in opened:
        one.client.close()


@pytest.fixture(scope="session")
def ros():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture
def peer(ros):
    """A ROS 2 node in the same domain."""
    one = Peer()
    yield one
    one.close()
