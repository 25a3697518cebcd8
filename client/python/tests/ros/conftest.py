"""A real server, the node as a program of its own, and a ROS 2 peer beside it.

The tests run with the Python of an environment that `setup.sh` made; elsewhere,
without rclpy, there is nothing to collect here. They need the program
`wheelarm-server`: WHEELARM_SERVER names it, and WHEELARM_ASSETS the assets.
"""

import importlib.util
import os
import sys

import pytest

if importlib.util.find_spec("rclpy") is None:
    collect_ignore_glob = ["*"]
else:
    import rclpy
    from peer import ASSETS, PROGRAM, ROOT, Ear, Peer, Program


@pytest.fixture
def programs():
    """Starts programs and ends them, the newest first."""
    started = []

    def start(*words, **options):
        started.append(Program(words, **options))
        return started[-1]

    yield start
    for one in reversed(started):
        one.close()


@pytest.fixture
def server(programs):
    """`server(*flags)` is the endpoint of a new server."""

    def start(*flags):
        line = programs(
            PROGRAM, "--assets", ASSETS, "--listen", "tcp/127.0.0.1:0", *flags
        ).wait_for("ready ")
        return line.split()[1]

    return start


@pytest.fixture
def bridge(programs):
    """`bridge(endpoint, *words)` is the node as a program."""

    def start(endpoint, *words):
        env = {**os.environ, "PYTHONPATH": str(ROOT / "client/python/src")}
        program = programs(
            sys.executable, "-m", "wheelarm.ros", "--endpoint", endpoint, *words, env=env
        )
        program.wait_for("speaks for")
        return program

    return start


@pytest.fixture
def ear():
    """`ear(endpoint)` is a client of our own."""
    opened = []

    def start(endpoint):
        opened.append(Ear(endpoint))
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
    """A peer on the same domain as the node."""
    one = Peer()
    yield one
    one.close()
