"""Subscriptions: samples of topics, images of cameras."""

from __future__ import annotations

import collections
import queue
import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import zenoh
from numpy.typing import NDArray

from . import v1
from ._connection import Connection
from ._session import direct_callback
from ._wire import MESSAGE, read
from .errors import GoneError
from .frame import Frame

#: Column names that differ from the field's; the same as in recorded files.
_SINGULAR = {
    "positions": "position",
    "velocities": "velocity",
    "efforts": "effort",
    "poses": "pose",
    "twists": "twist",
    "joint_positions": "joint_position",
    "joint_velocities": "joint_velocity",
    "wheel_velocities": "wheel_velocity",
    "pad_forces": "pad_force",
    "vertices": "vertex",
    "elapsed_seconds": "elapsed",
}


def vector(v: Any) -> NDArray[np.float64]:
    """A `Vector3` as (3,): x y z."""
    return np.array([v.x, v.y, v.z])


def quaternion(q: Any) -> NDArray[np.float64]:
    """A `Quaternion` as (4,): x y z w."""
    return np.array([q.x, q.y, q.z, q.w])


def pose(p: Any) -> NDArray[np.float64]:
    """A `Pose` as (7,): x y z, metres, and qx qy qz qw."""
    a, q = p.position, p.orientation
    return np.array([a.x, a.y, a.z, q.x, q.y, q.z, q.w])


def twist(t: Any) -> NDArray[np.float64]:
    """A `Twist` as (6,): vx vy vz, m/s, and wx wy wz, rad/s."""
    a, b = t.linear, t.angular
    return np.array([a.x, a.y, a.z, b.x, b.y, b.z])


_PARTS = {"Vector3": vector, "Quaternion": quaternion, "Pose": pose, "Twist": twist}


def arrays(message: Any) -> dict[str, NDArray[Any]]:
    """The numbers of a message as arrays, under the names of the columns in recorded
    files: ``arrays(joint_state)["position"]`` is (joints,), of `pose` ``["pose"]`` is
    (frames, 7), of `object_pose` (objects, 7). Texts, codes and commands are left out.
    `wheelarm.v1` documents the units. A value that the message lacks is NaN.
    """
    out: dict[str, NDArray[Any]] = {}
    for field in message.DESCRIPTOR.fields:
        name = _SINGULAR.get(field.name, field.name)
        # 1 double, 2 float, 8 bool, 11 message, 4, 6 and 13 unsigned integers.
        kind, many = field.type, _is_repeated(field)
        value = getattr(message, field.name)
        if kind == 11 and field.name != "header":
            part = _PARTS.get(field.message_type.name)
            if part and many:
                rows = [part(one) for one in value]
                out[name] = np.array(rows).reshape(len(rows), part_size(part))
            elif part:
                missing = np.full(part_size(part), np.nan)
                out[name] = part(value) if message.HasField(field.name) else missing
            elif field.message_type.name == "FramePose":
                out["pose"] = np.array([pose(one.pose) for one in value]).reshape(-1, 7)
                out["twist"] = np.array([twist(one.twist) for one in value]).reshape(-1, 6)
        elif kind in (1, 2):
            if field.name == "vertices":
                out[name] = np.array(value, dtype=np.float32).reshape(-1, 3)
            elif many:
                out[name] = np.array(value, dtype=np.float64)
            else:
                absent = field.containing_oneof is not None and not message.HasField(field.name)
                out[name] = np.array(np.nan if absent else value)
        elif kind in (4, 6, 8, 13) and not many:
            out[name] = np.array(value)
    return out


def _is_repeated(field: Any) -> bool:
    repeated = getattr(field, "is_repeated", None)  # protobuf 6.31 and later
    return bool(repeated) if repeated is not None else field.label == field.LABEL_REPEATED


def part_size(part: Any) -> int:
    """Length of a vector, quaternion, pose or twist (count)."""
    return {vector: 3, quaternion: 4, pose: 7, twist: 6}[part]


class Sample:
    """One message of one topic.

    Attributes:
        topic: Name of the topic, for example ``joint_state``.
    """

    __slots__ = ("_message", "_payload", "topic")

    def __init__(self, topic: str, payload: bytes) -> None:
        self.topic = topic
        self._payload = payload
        self._message: Any = None

    @property
    def message(self) -> Any:
        """The message, decoded at the first access: a `v1.JointState` for ``joint_state``."""
        if self._message is None:
            self._message = read(MESSAGE[self.topic], self._payload, self.topic)
        return self._message

    @property
    def encoded(self) -> bytes:
        """The received bytes."""
        return self._payload

    @property
    def header(self) -> v1.Header:
        """Header: run, episode, sequence number, nanoseconds, tick."""
        header: v1.Header = self.message.header
        return header

    @property
    def tick(self) -> int:
        """Physics tick of the timestamp, 240 per second of simulation time."""
        return int(self.header.tick)

    @property
    def stamp(self) -> float:
        """Simulation time, s."""
        return float(self.header.stamp_nanos) * 1e-9

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Its numbers as arrays; see `wheelarm.arrays`."""
        return arrays(self.message)

    def __repr__(self) -> str:
        return f"Sample({self.topic!r}, {self.stamp:.4f} s, {len(self._payload)} bytes)"


class Streams:
    """Subscribed topics in one queue, in the order of arrival.

    The ``clock`` of a tick arrives after its other samples. The queue has no limit.
    Iteration ends when the client is closed.
    """

    def __init__(self, connection: Connection, topics: Sequence[str]) -> None:
        self._connection = connection
        self._queue: queue.SimpleQueue[tuple[str, zenoh.Sample] | None] = queue.SimpleQueue()
        self._subscribers = [self._subscribe(topic) for topic in topics]
        connection._register(self)

    def _subscribe(self, topic: str) -> Any:
        put = self._queue.put
        key = self._connection._topic_key(topic)
        return self._connection._session.declare_subscriber(
            key, direct_callback(lambda sample: put((topic, sample)))
        )

    def next(self, timeout: float | None = None) -> Sample | None:
        """The next sample; None when none arrived within `timeout` seconds.

        Raises:
            GoneError: when the client is closed.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            # Short waits, so that the loop notices Ctrl-C and a closed client.
            left = 0.5 if deadline is None else min(deadline - time.monotonic(), 0.5)
            try:
                found = self._queue.get(timeout=max(left, 0.0))
            except queue.Empty:
                if self._connection.is_closed:
                    raise GoneError("the client is closed") from None
                if deadline is not None and time.monotonic() >= deadline:
                    return None
                continue
            if found is None:
                self._queue.put(None)
                raise GoneError("the client is closed")
            topic, sample = found
            if self._connection._server.published(sample):
                return Sample(topic, sample.payload.to_bytes())

    def __iter__(self) -> Iterator[Sample]:
        while True:
            try:
                sample = self.next()
            except GoneError:
                return
            if sample is not None:
                yield sample

    def close(self) -> None:
        """Ends the subscriptions."""
        self._connection._unregister(self)
        for subscriber in self._subscribers:
            subscriber.undeclare()
        self._subscribers = []
        self._queue.put(None)

    def __enter__(self) -> Streams:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Camera:
    """Images of one camera or sensor. The queue has a limited size and drops the oldest
    images; the sequence numbers of the headers show the gaps."""

    def __init__(self, connection: Connection, key: str, queue_size: int) -> None:
        self._connection = connection
        self._queue: collections.deque[zenoh.Sample] = collections.deque(maxlen=max(queue_size, 1))
        self._arrived = threading.Condition()
        self._subscriber = connection._session.declare_subscriber(
            key, direct_callback(self._append)
        )
        self._closed = False
        connection._register(self)

    def _append(self, sample: zenoh.Sample) -> None:
        with self._arrived:
            self._queue.append(sample)
            self._arrived.notify()

    def next(self, timeout: float | None = None) -> Frame | None:
        """The next image; None when none arrived within `timeout` seconds.

        Raises:
            GarbledError: when a plane does not match its size and format.
            GoneError: when the client is closed.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            with self._arrived:
                while not self._queue:
                    if self._closed:
                        raise GoneError("the subscription of the camera is closed")
                    left = 0.5 if deadline is None else deadline - time.monotonic()
                    if left <= 0.0:
                        return None
                    self._arrived.wait(min(left, 0.5))
                sample = self._queue.popleft()
            if self._connection._server.published(sample):
                return Frame.from_bytes(sample.payload.to_bytes())

    def __iter__(self) -> Iterator[Frame]:
        while True:
            try:
                frame = self.next()
            except GoneError:
                return
            if frame is not None:
                yield frame

    def close(self) -> None:
        """Ends the subscription."""
        with self._arrived:
            if self._closed:
                return
            self._closed = True
            self._arrived.notify_all()
        self._connection._unregister(self)
        self._subscriber.undeclare()

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
