"""What the node asks of a connection to a server, in one place.

The rest of the node speaks to a `Link` alone.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import zenoh
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory


def _types():
    pool = descriptor_pool.DescriptorPool()
    files = descriptor_pb2.FileDescriptorSet()
    with open(os.environ["WHEELARM_FDS"], "rb") as f:
        files.ParseFromString(f.read())
    for one in files.file:
        pool.Add(one)
    found = {}
    for one in files.file:
        for m in one.message_type:
            found[m.name] = message_factory.GetMessageClass(
                pool.FindMessageTypeByName(f"{one.package}.{m.name}")
            )
    return SimpleNamespace(**found)


v1 = _types()

_TOPICS = {
    "clock": "Clock",
    "applied": "Applied",
    "joint_state": "JointState",
    "pose": "PoseSet",
    "imu": "Imu",
    "odometry": "Odometry",
    "object_pose": "ObjectPoses",
    "furniture_joint": "FurnitureJoints",
    "state_hash": "StateHash",
    "event": "Event",
    "evaluation": "Evaluation",
}
_OTHERS = {"refusal": "Refusal", "episode/start": "EpisodeStarted", "episode/stop": "EpisodeStopped"}


class Refused(Exception):
    """The server does not do what was asked, in its words."""


class Silent(Exception):
    """No server answers."""


class Control:
    """The lease of a commander."""

    def __init__(self, link: Link, name: str):
        self.link, self.name = link, name
        self.run_id = os.urandom(8).hex()
        self.sequence = 0
        self.secret = ""
        key = f"wheelarm/{link.sim}/commander/{name}/{self.run_id}/alive"
        self._token = link.session.liveliness().declare_token(key)
        self._publisher = link.session.declare_publisher(
            f"wheelarm/{link.sim}/command/{name}",
            encoding="application/protobuf;wheelarm.v1.Command@2",
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )

    def _request(self, **fields):
        request = v1.LeaseRequest(commander=self.name, secret=self.secret, sealed=True, **fields)
        request.header.run_id = self.run_id
        return request

    def ask(self, take: bool) -> None:
        deadline = time.monotonic() + 5
        while True:
            reply = self.link.ask("lease", self._request(take=take), key=self.name)
            if reply.holder == self.name:
                self.secret = reply.secret or self.secret
                return
            if time.monotonic() > deadline:
                raise Refused("the server does not see this commander's token")
            time.sleep(0.02)

    def answer(self, header, command) -> int:
        command.header.CopyFrom(header)
        command.header.run_id = self.run_id
        command.header.sequence = self.sequence
        command.commander = self.name
        command.answers_tick = header.tick
        data = command.SerializeToString()
        if self.secret:
            data += b"\xa2\x01\x20" + hmac.new(self.secret.encode(), data, hashlib.sha256).digest()
        self._publisher.put(data)
        self.sequence += 1
        return self.sequence - 1

    def close(self) -> None:
        try:
            self.link.ask("lease", self._request(release=True), key=self.name, patience=1.0)
        except (Refused, Silent):
            pass
        self._publisher.undeclare()
        self._token.undeclare()


class Link:
    def __init__(self, endpoint: str, sim: str):
        self.sim = sim
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", f'["{endpoint}"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)

    def ask(self, query: str, request=None, key: str = "", patience: float = 10.0):
        names = {
            "status": ("StatusRequest", "Status"),
            "scene": ("SceneRequest", "SceneReply"),
            "lease": ("LeaseRequest", "LeaseReply"),
            "reset": ("ResetRequest", "ResetReply"),
            "pause": ("PauseRequest", "Ack"),
            "resume": ("ResumeRequest", "Ack"),
            "episode_start": ("EpisodeStartRequest", "EpisodeStarted"),
            "episode_stop": ("EpisodeStopRequest", "EpisodeStopped"),
            "shutdown": ("ShutdownRequest", "Ack"),
        }[query]
        request = request if request is not None else getattr(v1, names[0])()
        replies = self.session.get(
            f"wheelarm/{self.sim}/query/{query}" + (f"/{key}" if key else ""),
            payload=request.SerializeToString(),
            encoding=f"application/protobuf;wheelarm.v1.{names[0]}@2",
            timeout=patience,
        )
        for reply in replies:
            if reply.ok is not None:
                return getattr(v1, names[1]).FromString(reply.ok.payload.to_bytes())
            try:
                failure = v1.Failure.FromString(reply.err.payload.to_bytes())
            except Exception:
                failure = None
            if failure and failure.message:
                raise Refused(failure.message)
        raise Silent(f"the server {self.sim!r} does not answer `{query}`")

    def listen(self, topics: list[str], taken: Callable[[str, object], None]):
        subscribers = []
        for topic in topics:
            name = _TOPICS.get(topic) or _OTHERS[topic]
            key = f"wheelarm/{self.sim}/" + (f"stream/{topic}" if topic in _TOPICS else topic)
            kind = getattr(v1, name)

            def handle(sample, topic=topic, kind=kind):
                taken(topic, kind.FromString(sample.payload.to_bytes()))

            subscribers.append(self.session.declare_subscriber(key, handle))
        return SimpleNamespace(close=lambda: [one.undeclare() for one in subscribers])

    def camera(self, name: str, taken: Callable[[object], None]):
        def handle(sample):
            frame = v1.CameraFrame.FromString(sample.payload.to_bytes())
            h, w = frame.intrinsics.height, frame.intrinsics.width
            taken(
                SimpleNamespace(
                    header=frame.header,
                    intrinsics=frame.intrinsics,
                    pose=frame.pose,
                    rgb=np.frombuffer(frame.rgb, np.uint8).reshape(h, w, 3),
                    depth=np.frombuffer(frame.depth, "<f4").reshape(h, w),
                )
            )

        subscriber = self.session.declare_subscriber(f"wheelarm/{self.sim}/camera/{name}", handle)
        return SimpleNamespace(close=subscriber.undeclare)

    def close(self):
        self.session.close()
