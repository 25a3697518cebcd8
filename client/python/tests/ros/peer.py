"""What stands beside the node in its tests: programs, a ROS 2 node, a client."""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[4]
sys.path.insert(0, str(ROOT / "client/python/src"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(random.randrange(1, 101))

import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402

import wheelarm  # noqa: E402

PROGRAM = os.environ.get("WHEELARM_SERVER", str(ROOT / "target/release/wheelarm-server"))
ASSETS = os.environ.get("WHEELARM_ASSETS", str(ROOT / "assets"))
#: Patience with a busy machine, s; no test is about time.
PATIENCE = 240.0


class Program:
    """A program that is ended with the test; its words are kept."""

    def __init__(self, words, **options):
        self.lines: list[str] = []
        self.process = subprocess.Popen(
            list(map(str, words)),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            **options,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))

    def wait_for(self, part: str) -> str:
        """The first line that holds `part`."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            for line in list(self.lines):
                if part in line:
                    return line
            if self.process.poll() is not None:
                break
            time.sleep(0.02)
        raise AssertionError(f"no line with {part!r} among:\n" + "\n".join(self.lines))

    def close(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(timeout=15)
            except subprocess.TimeoutExpired:
                self.process.kill()
        self.process.wait()
        self._reader.join(timeout=5)


class Peer:
    """A ROS 2 node of the test, spun in a thread."""

    def __init__(self):
        self.node = rclpy.create_node("peer")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self._thread = threading.Thread(target=self.executor.spin, daemon=True)
        self._thread.start()

    def hear(self, topic, kind, qos=10) -> list:
        """The growing list of what comes."""
        heard = []
        self.node.create_subscription(kind, topic, heard.append, qos)
        return heard

    def call(self, name, kind, request=None, patience=PATIENCE):
        """The answer of a service."""
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(patience), f"there is no service {name}"
        future = client.call_async(request or kind.Request())
        until(future.done, f"no answer of {name}", patience)
        self.node.destroy_client(client)
        return future.result()

    def publisher(self, topic, kind):
        """A publisher that the node hears."""
        publisher = self.node.create_publisher(kind, topic, 10)
        until(lambda: publisher.get_subscription_count() > 0, f"nobody hears {topic}")
        return publisher

    def close(self):
        self.executor.shutdown()
        self._thread.join(timeout=5)
        self.node.destroy_node()


def until(is_so, otherwise="it never happened", patience=PATIENCE):
    """Waits until `is_so()` is true and returns what it gives."""
    deadline = time.monotonic() + patience
    while True:
        found = is_so()
        if found:
            return found
        assert time.monotonic() < deadline, otherwise
        time.sleep(0.01)


class Ear:
    """A client of our own beside ROS, with all that it hears."""

    def __init__(self, endpoint):
        self.client = wheelarm.connect(endpoint, timeout=PATIENCE)

    def _each(self, source, taken):
        def run():
            for one in source:
                taken(one)

        threading.Thread(target=run, daemon=True).start()

    def hear(self, *topics) -> dict:
        """Messages by topic and stamp, growing."""
        heard = {topic: {} for topic in topics}

        def taken(sample):
            heard[sample.topic][sample.header.stamp_nanos] = sample.message

        self._each(self.client.streams(*topics), taken)
        return heard

    def see(self, camera) -> dict:
        """Pictures by stamp, growing."""
        seen = {}
        pictures = self.client.camera(camera, kept=64)
        self._each(pictures, lambda frame: seen.update({frame.header.stamp_nanos: frame}))
        return seen
