"""Commands and the control that they need: one commander at a time."""

from __future__ import annotations

import hashlib
import hmac
import queue
import secrets
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import zenoh

from . import v1
from ._session import direct, refuse_fork
from ._wire import check_name, encoding, read
from .errors import NoServer, Refused, WheelArmError

if TYPE_CHECKING:
    from .client import Client

#: Tag and length before the seal in an encoded command: field 20, 32 bytes.
_SEAL = bytes([0xA2, 0x01, 32])
#: Longest time until the server has seen this process's token, s.
_SEEN = 5.0

_FRAMES = {
    "base_link": "BASE_LINK",
    "end_effector": "END_EFFECTOR",
    "wheelchair": "WHEELCHAIR",
    "wheelchair_root": "WHEELCHAIR",
    "house": "HOUSE",
}


def seal(encoded: bytes, secret: str) -> bytes:
    """An encoded command with its seal, HMAC-SHA256 with the lease's secret."""
    return encoded + _SEAL + hmac.new(secret.encode(), encoded, hashlib.sha256).digest()


def _frame(name: str) -> Any:
    if name not in _FRAMES:
        raise ValueError(f"there is no frame {name!r}; choose of {', '.join(_FRAMES)}")
    return getattr(v1, "COMMAND_FRAME_" + _FRAMES[name])


def _numbers(what: str, values: Sequence[float], count: int) -> list[float]:
    out = [float(value) for value in values]
    if len(out) != count:
        raise ValueError(f"{what} has {count} numbers, these are {len(out)}")
    return out


def command(
    *,
    joints: Sequence[float] | None = None,
    pose: Sequence[float] | None = None,
    twist: Sequence[float] | None = None,
    step: Sequence[float] | None = None,
    hold: bool = False,
    frame: str = "base_link",
    linear: float | None = None,
    angular: float | None = None,
    opening: float | None = None,
    knuckle: float | None = None,
    max_force: float | None = None,
    over_ticks: int = 0,
    device: int | str = "program",
    mode: int | str = "stream",
) -> v1.Command:
    """A command from plain numbers. Groups that are not named stay as they are.

    Args:
        joints: Six joint targets from base to hand, radians.
        pose: End effector x y z, metres, and qx qy qz qw, in `frame`.
        twist: End effector vx vy vz, m/s, and wx wy wz, rad/s, in `frame`; held until it
            goes stale.
        step: Step of the end effector: x y z in `frame`, metres, and a rotation vector
            about the tool's own axes, radians.
        hold: The arm stops where it is.
        frame: `base_link`, `end_effector`, `wheelchair` or `house`.
        linear: Forward speed of the chair, m/s.
        angular: Its turn rate, rad/s, positive to the left.
        opening: Distance between the gripper's pads, metres.
        knuckle: Angle of its knuckle instead, radians; 0 is open.
        max_force: Force cap at each pad, N; the robot's usual one where absent.
        over_ticks: In lock-step: control ticks of 1/60 s that it answers for, at most 60;
            what is asked is reached in a straight line with the last of them.
        device: What it is commanded with, for example ``policy``; recorded.
        mode: How input becomes motion, for example ``stream``; recorded.

    Raises:
        ValueError: when a group is told twice or has a wrong length.
    """
    targets = [part is not None for part in (joints, pose, twist, step)]
    if sum(targets) + hold > 1:
        raise ValueError("an arm has one target: joints, pose, twist, step or hold")
    out = v1.Command(over_ticks=over_ticks)
    if joints is not None:
        out.arm.joints.positions.extend(_numbers("joints", joints, 6))
    elif pose is not None:
        x, y, z, qx, qy, qz, qw = _numbers("pose", pose, 7)
        target = out.arm.pose
        target.frame = _frame(frame)
        target.pose.position.x, target.pose.position.y, target.pose.position.z = x, y, z
        q = target.pose.orientation
        q.x, q.y, q.z, q.w = qx, qy, qz, qw
    elif twist is not None:
        vx, vy, vz, wx, wy, wz = _numbers("twist", twist, 6)
        out.arm.twist.frame = _frame(frame)
        wanted = out.arm.twist.twist
        wanted.linear.x, wanted.linear.y, wanted.linear.z = vx, vy, vz
        wanted.angular.x, wanted.angular.y, wanted.angular.z = wx, wy, wz
    elif step is not None:
        x, y, z, rx, ry, rz = _numbers("step", step, 6)
        out.arm.step.frame = _frame(frame)
        moved, turned = out.arm.step.translation, out.arm.step.rotation
        moved.x, moved.y, moved.z = x, y, z
        turned.x, turned.y, turned.z = rx, ry, rz
        # An absent vector is not one of zeros.
        moved.SetInParent()
        turned.SetInParent()
    elif hold:
        out.arm.hold = True
    if linear is not None or angular is not None:
        out.base.SetInParent()
        out.base.linear, out.base.angular = linear or 0.0, angular or 0.0
    if opening is not None and knuckle is not None:
        raise ValueError("a gripper has one target: opening or knuckle")
    if opening is not None:
        out.gripper.opening = opening
    elif knuckle is not None:
        out.gripper.knuckle = knuckle
    if max_force is not None:
        out.gripper.max_force = max_force
    out.device = _code("DEVICE_", device)
    out.mode = _code("INPUT_MODE_", mode)
    return out


def _code(prefix: str, value: int | str) -> Any:
    if isinstance(value, int):
        return value
    found = getattr(v1, prefix + value.upper().replace("-", "_"), None)
    if found is None:
        raise ValueError(f"{value!r} is none of {prefix}…; see wheelarm.v1")
    return found


class Commander:
    """A commander in control. Control is given back when it is closed, and ends by itself
    with this process.

    Attributes:
        name: Under which it commands.
        run_id: Names this life of it, as in the header of its commands.
        sent: Number of commands sent (count).
    """

    def __init__(self, client: Client, name: str, *, take: bool, sealed: bool) -> None:
        self.name, self.run_id = check_name(name), secrets.token_hex(8)
        self.sent = 0
        self._client, self._sealed, self._secret = client, sealed, ""
        self._clock: zenoh.Sample | None = None
        self._refused: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
        self._closed = False
        session = client._session
        self._subscribers = [
            session.declare_subscriber(client._topic_key("clock"), direct(self._ticked)),
            session.declare_subscriber(client._topic_key("refusal"), direct(self._refused.put)),
        ]
        self._publisher = session.declare_publisher(
            client._key(f"command/{name}"),
            encoding=encoding("Command"),
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        self._token = session.liveliness().declare_token(
            client._key(f"commander/{name}/{self.run_id}/alive")
        )
        client._opened(self)
        try:
            self.ask(take=take)
        except BaseException:
            self.close()
            raise

    def _ticked(self, sample: zenoh.Sample) -> None:
        self._clock = sample

    def _request(self, **more: Any) -> v1.LeaseRequest:
        return v1.LeaseRequest(
            header=v1.Header(run_id=self.run_id),
            commander=self.name,
            secret=self._secret,
            sealed=self._sealed,
            **more,
        )

    def ask(self, *, take: bool = False) -> v1.LeaseReply:
        """Asks for control again, after it was lost. Does nothing while it is held.

        Raises:
            Refused: with the holder's name.
        """
        deadline = time.monotonic() + _SEEN
        while True:
            reply = self._client.ask(self._request(take=take))
            if reply.holder == self.name:
                if reply.secret:
                    self._secret = self._client._secret = reply.secret
                return reply
            if time.monotonic() > deadline:
                raise NoServer(f"the server does not see the token of commander {self.name!r}")
            time.sleep(0.02)

    def send(
        self, asked: v1.Command | None = None, *, header: v1.Header | None = None, **plain: Any
    ) -> None:
        """Sends a command as the answer to a control tick: `v1.Command`, or the
        arguments of `wheelarm.command`: ``commander.send(linear=0.2, angular=0.0)``.

        Args:
            header: Of the tick that it answers; the newest clock's where absent.

        Real time: it goes at the next control tick. What drives the chair or gives the
        arm a twist is to be repeated, or it stops after 0.25 s.
        """
        refuse_fork(self._client._owner)
        told = asked if asked is not None else command(**plain)
        if header is None:
            header = self.newest_header()
        told.commander = self.name
        told.header.CopyFrom(header)
        told.header.run_id = self.run_id
        told.header.sequence = self.sent
        told.answers_tick = header.tick
        told.ClearField("seal")
        self.sent += 1
        encoded = told.SerializeToString()
        if self._secret and self._sealed:
            encoded = seal(encoded, self._secret)
        self._publisher.put(encoded)

    def newest_header(self) -> v1.Header:
        """Header of the newest control tick; of `status` while none was heard."""
        clock = self._clock
        if clock is not None and self._client._speaker.sent(clock):
            return read(v1.Clock, clock.payload.to_bytes(), "clock").header
        return self._client.status().header

    def refusals(self) -> list[v1.Refusal]:
        """Refusals of its commands that came since the last call, oldest first."""
        found = []
        while not self._refused.empty():
            sample = self._refused.get()
            if self._client._speaker.sent(sample):
                refusal = read(v1.Refusal, sample.payload.to_bytes(), "refusal")
                if refusal.commander == self.name:
                    found.append(refusal)
        return found

    def check(self) -> None:
        """Raises the newest refusal of its commands.

        Raises:
            Refused: with its code and words.
        """
        refused = self.refusals()
        if refused:
            raise Refused("command", refused[-1].code, refused[-1].reason)

    def close(self) -> None:
        """Gives control back."""
        if self._closed:
            return
        self._closed = True
        self._client._closed(self)
        if self._client._secret == self._secret:
            self._client._secret = ""
        try:
            if self._secret:
                self._client.ask(self._request(release=True), timeout=1.0)
        except WheelArmError:
            pass  # Without an answer control ends with the token, a little later.
        declared: list[Any] = [*self._subscribers, self._publisher, self._token]
        for one in declared:
            one.undeclare()

    def __enter__(self) -> Commander:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
