"""What a server publishes: samples of topics, pictures of cameras."""

from __future__ import annotations

import collections
import queue
import threading
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import v1
from ._session import direct
from ._wire import MESSAGE, TOPIC, read
from .errors import Gone
from .frame import Frame

if TYPE_CHECKING:
    import zenoh

    from .client import Client

#: Names of columns where they are not the field's own; as in recorded files.
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
    (frames, 7), of `object_pose` (objects, 7). Texts, codes and commands stay in the
    message. Units stand in `wheelarm.v1`. What a message does not carry is NaN.
    """
    out: dict[str, NDArray[Any]] = {}
    for field in message.DESCRIPTOR.fields:
        name = _SINGULAR.get(field.name, field.name)
        # 1 double, 2 float, 8 bool, 11 message, 13 and 4 and 6 unsigned.
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
    told = getattr(field, "is_repeated", None)  # protobuf 6.31 and later
    return bool(told) if told is not None else field.label == field.LABEL_REPEATED


def part_size(part: Any) -> int:
    """Numbers of a vector, quaternion, pose or twist."""
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
        """The message, decoded when it is asked for: of ``joint_state`` a
        `v1.JointState`."""
        if self._message is None:
            self._message = read(MESSAGE[self.topic], self._payload, self.topic)
        return self._message

    @property
    def encoded(self) -> bytes:
        """The message as it came, to the bit."""
        return self._payload

    @property
    def header(self) -> v1.Header:
        """Its stamp: run, episode, sequence, nanoseconds, tick."""
        header: v1.Header = self.message.header
        return header

    @property
    def tick(self) -> int:
        """Physics tick of the stamp, 240 per second of simulation time."""
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
    """Subscribed topics in one queue, in the order in which they came.

    A tick's ``clock`` comes after its other samples. What is not taken waits in memory.
    Iterating ends when the client is closed.
    """

    def __init__(self, client: Client, topics: Sequence[str]) -> None:
        self._client = client
        self._queue: queue.SimpleQueue[tuple[str, zenoh.Sample] | None] = queue.SimpleQueue()
        self._subscribers = [self._subscribe(topic) for topic in topics]
        client._opened(self)

    def _subscribe(self, topic: str) -> Any:
        put = self._queue.put
        key = self._client._topic_key(topic)
        return self._client._session.declare_subscriber(
            key, direct(lambda sample: put((topic, sample)))
        )

    def next(self, timeout: float | None = None) -> Sample | None:
        """The next sample; None when nothing came for `timeout` seconds.

        Raises:
            Gone: when the client is closed.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            # Short waits, so that Ctrl-C and a closed client are seen.
            left = 0.5 if deadline is None else min(deadline - time.monotonic(), 0.5)
            try:
                found = self._queue.get(timeout=max(left, 0.0))
            except queue.Empty:
                if self._client.is_closed:
                    raise Gone("the client is closed") from None
                if deadline is not None and time.monotonic() >= deadline:
                    return None
                continue
            if found is None:
                self._queue.put(None)
                raise Gone("the client is closed")
            topic, sample = found
            if self._client._speaker.sent(sample):
                return Sample(topic, sample.payload.to_bytes())

    def __iter__(self) -> Iterator[Sample]:
        while True:
            try:
                sample = self.next()
            except Gone:
                return
            if sample is not None:
                yield sample

    def close(self) -> None:
        """Ends the subscriptions."""
        self._client._closed(self)
        for subscriber in self._subscribers:
            subscriber.undeclare()
        self._subscribers = []
        self._queue.put(None)

    def __enter__(self) -> Streams:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Camera:
    """Pictures of one camera or sensor; the newest few are kept, older ones are let go,
    which the sequence numbers of the headers tell."""

    def __init__(self, client: Client, key: str, kept: int) -> None:
        self._client = client
        self._kept: collections.deque[zenoh.Sample] = collections.deque(maxlen=max(kept, 1))
        self._came = threading.Condition()
        self._subscriber = client._session.declare_subscriber(key, direct(self._take))
        self._closed = False
        client._opened(self)

    def _take(self, sample: zenoh.Sample) -> None:
        with self._came:
            self._kept.append(sample)
            self._came.notify()

    def next(self, timeout: float | None = None) -> Frame | None:
        """The next picture; None when none came for `timeout` seconds.

        Raises:
            Garbled: when it is not as it says.
            Gone: when the client is closed.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            with self._came:
                while not self._kept:
                    if self._closed:
                        raise Gone("the camera's subscription is closed")
                    left = 0.5 if deadline is None else deadline - time.monotonic()
                    if left <= 0.0:
                        return None
                    self._came.wait(min(left, 0.5))
                sample = self._kept.popleft()
            if self._client._speaker.sent(sample):
                return Frame.of(sample.payload.to_bytes())

    def __iter__(self) -> Iterator[Frame]:
        while True:
            try:
                frame = self.next()
            except Gone:
                return
            if frame is not None:
                yield frame

    def close(self) -> None:
        """Ends the subscription."""
        with self._came:
            if self._closed:
                return
            self._closed = True
            self._came.notify_all()
        self._client._closed(self)
        self._subscriber.undeclare()

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def known_topic(name: str) -> str:
    """A topic that a server publishes under one key.

    Raises:
        ValueError: with those that there are.
    """
    fit = [topic for topic, row in TOPIC.items() if row[6] == "server" and "{" not in row[1]]
    if name not in fit:
        raise ValueError(f"there is no topic {name!r}; choose of {', '.join(sorted(fit))}")
    return name
