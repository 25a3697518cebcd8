"""Peers of the node in its tests: programs, a ROS 2 node, a WheelArm client."""

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
#: Time limit of every wait, s; no test asserts a duration.
PATIENCE = 240.0


class Program:
    """A program that ends with the test; its output is kept."""

    def __init__(self, line, **options):
        self.lines: list[str] = []
        self.process = subprocess.Popen(
            list(map(str, line)),
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
        """Waits for a line that contains `part`, and returns it."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            for line in list(self.lines):
                if part in line:
                    return line
            if self.process.poll() is not None:
                break
            time.sleep(0.02)
        raise AssertionError(f"no line contains {part!r}:\n" + "\n".join(self.lines))

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

    def subscribe(self, topic, kind, qos=10) -> list:
        """Subscribes to a topic; returns the list to which messages are appended."""
        received = []
        self.node.create_subscription(kind, topic, received.append, qos)
        return received

    def call(self, name, kind, request=None, patience=PATIENCE):
        """Calls a service and returns its response."""
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(patience), f"the service {name} does not exist"
        future = client.call_async(request or kind.Request())
        until(future.done, f"{name} sent no response", patience)
        self.node.destroy_client(client)
        return future.result()

    def publisher(self, topic, kind):
        """A publisher to which the node has subscribed."""
        publisher = self.node.create_publisher(kind, topic, 10)
        until(lambda: publisher.get_subscription_count() > 0, f"{topic} has no subscriber")
        return publisher

    def close(self):
        self.executor.shutdown()
        self._thread.join(timeout=5)
        self.node.destroy_node()


def until(condition, message="the condition never held", patience=PATIENCE):
    """Waits until `condition()` is true and returns its value."""
    deadline = time.monotonic() + patience
    while True:
        found = condition()
        if found:
            return found
        assert time.monotonic() < deadline, message
        time.sleep(0.01)


class ClientProbe:
    """A WheelArm client without ROS that stores all received samples."""

    def __init__(self, endpoint):
        self.client = wheelarm.connect(endpoint, timeout=PATIENCE)

    def _for_each(self, source, store):
        def run():
            for one in source:
                store(one)

        threading.Thread(target=run, daemon=True).start()

    def subscribe(self, *topics) -> dict:
        """Subscribes to topics; returns the dict of messages by topic and timestamp."""
        received = {topic: {} for topic in topics}

        def store(sample):
            received[sample.topic][sample.header.stamp_nanos] = sample.message

        self._for_each(self.client.streams(*topics), store)
        return received

    def subscribe_camera(self, camera) -> dict:
        """Subscribes to a camera; returns the dict of images by timestamp."""
        received = {}
        images = self.client.camera(camera, queue_size=64)
        self._for_each(images, lambda frame: received.update({frame.header.stamp_nanos: frame}))
        return received
