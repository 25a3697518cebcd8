"""Commands, and control of the robot: one commander at a time."""

from __future__ import annotations

import hashlib
import hmac
import queue
import secrets
import time
from collections.abc import Sequence
from typing import Any

import zenoh

from . import v1
from ._connection import Connection
from ._session import direct_callback, refuse_fork
from ._wire import check_name, encoding, read
from .errors import NoServerError, RefusedError, WheelArmError

#: Seconds until the server must have received this process's liveliness token.
_TOKEN_TIMEOUT = 5.0

_FRAMES = {
    "base_link": "BASE_LINK",
    "end_effector": "END_EFFECTOR",
    "wheelchair": "WHEELCHAIR",
    "wheelchair_root": "WHEELCHAIR",
    "house": "HOUSE",
}


def seal(encoded: bytes, secret: str) -> bytes:
    """An encoded command with its seal, HMAC-SHA256 with the lease's secret."""
    digest = hmac.new(secret.encode(), encoded, hashlib.sha256).digest()
    # Encoded messages can be concatenated: this one has the seal as its only field.
    return encoded + v1.Command(seal=digest).SerializeToString()


def _frame(name: str) -> Any:
    if name not in _FRAMES:
        raise ValueError(f"unknown frame {name!r}; available: {', '.join(_FRAMES)}")
    return getattr(v1, "COMMAND_FRAME_" + _FRAMES[name])


def _numbers(what: str, values: Sequence[float], count: int) -> list[float]:
    out = [float(value) for value in values]
    if len(out) != count:
        raise ValueError(f"{what} has {len(out)} numbers, expected {count}")
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
    """A command from plain numbers. Groups without an argument keep their target.

    Args:
        joints: Six joint targets from base to hand, radians.
        pose: End effector x y z, metres, and qx qy qz qw, in `frame`.
        twist: End effector vx vy vz, m/s, and wx wy wz, rad/s, in `frame`; in force until it
            is stale.
        step: Step of the end effector: x y z in `frame`, metres, and a rotation vector
            about the tool's own axes, radians.
        hold: The arm stops at its present position.
        frame: `base_link`, `end_effector`, `wheelchair` or `house`.
        linear: Forward speed of the chair, m/s.
        angular: Turn rate of the chair, rad/s, positive to the left.
        opening: Distance between the gripper's pads, metres.
        knuckle: Angle of the gripper's knuckle joint instead, radians; 0 is open.
        max_force: Force limit at each pad, N; the robot's usual one if absent.
        over_ticks: In lock-step: control ticks of 1/60 s that the command covers, at most 60;
            the last tick reaches the target, in a straight line.
        device: Input device, for example ``policy``; recorded.
        mode: Conversion of input to motion, for example ``stream``; recorded.

    Raises:
        ValueError: when a group has two targets or a wrong length.
    """
    targets = [part is not None for part in (joints, pose, twist, step)]
    if sum(targets) + hold > 1:
        raise ValueError("the arm has several targets: give one of joints, pose, twist, step, hold")
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
        velocity = out.arm.twist.twist
        velocity.linear.x, velocity.linear.y, velocity.linear.z = vx, vy, vz
        velocity.angular.x, velocity.angular.y, velocity.angular.z = wx, wy, wz
    elif step is not None:
        x, y, z, rx, ry, rz = _numbers("step", step, 6)
        out.arm.step.frame = _frame(frame)
        translation, rotation = out.arm.step.translation, out.arm.step.rotation
        translation.x, translation.y, translation.z = x, y, z
        rotation.x, rotation.y, rotation.z = rx, ry, rz
        # A vector of zeros must be present.
        translation.SetInParent()
        rotation.SetInParent()
    elif hold:
        out.arm.hold = True
    if linear is not None or angular is not None:
        out.base.SetInParent()
        out.base.linear, out.base.angular = linear or 0.0, angular or 0.0
    if opening is not None and knuckle is not None:
        raise ValueError("the gripper has two targets: give one of opening, knuckle")
    if opening is not None:
        out.gripper.opening = opening
    elif knuckle is not None:
        out.gripper.knuckle = knuckle
    if max_force is not None:
        out.gripper.max_force = max_force
    out.device = _enum_value("DEVICE_", device)
    out.mode = _enum_value("INPUT_MODE_", mode)
    return out


def _enum_value(prefix: str, value: int | str) -> Any:
    if isinstance(value, int):
        return value
    found = getattr(v1, prefix + value.upper().replace("-", "_"), None)
    if found is None:
        raise ValueError(f"unknown name {value!r} of {prefix}…: see wheelarm.v1")
    return found


class Commander:
    """A commander in control. `close` releases control, and so does the end of this process.

    Attributes:
        name: Name of the commander.
        run_id: Id of this run of the commander, as in the header of its commands.
        sent: Number of commands sent (count).
    """

    def __init__(self, connection: Connection, name: str, *, take: bool, sealed: bool) -> None:
        self.name, self.run_id = check_name(name), secrets.token_hex(8)
        self.sent = 0
        self._connection, self._sealed, self._secret = connection, sealed, ""
        self._clock: zenoh.Sample | None = None
        self._refused: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
        self._closed = False
        session = connection._session
        self._subscribers = [
            session.declare_subscriber(
                connection._topic_key("clock"), direct_callback(self._store_clock)
            ),
            session.declare_subscriber(
                connection._topic_key("refusal"), direct_callback(self._refused.put)
            ),
        ]
        self._publisher = session.declare_publisher(
            connection._key(f"command/{name}"),
            encoding=encoding("Command"),
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        self._token = session.liveliness().declare_token(
            connection._key(f"commander/{name}/{self.run_id}/alive")
        )
        connection._register(self)
        try:
            self.request_control(take=take)
        except BaseException:
            self.close()
            raise

    def _store_clock(self, sample: zenoh.Sample) -> None:
        self._clock = sample

    def _lease_request(self, **more: Any) -> v1.LeaseRequest:
        return v1.LeaseRequest(
            header=v1.Header(run_id=self.run_id),
            commander=self.name,
            secret=self._secret,
            sealed=self._sealed,
            **more,
        )

    def request_control(self, *, take: bool = False) -> v1.LeaseReply:
        """Requests control again after its loss. Without effect while in control.

        Raises:
            RefusedError: when another client holds control; the message names it.
        """
        deadline = time.monotonic() + _TOKEN_TIMEOUT
        while True:
            reply = self._connection.request(self._lease_request(take=take))
            if reply.holder == self.name:
                if reply.secret:
                    self._secret = self._connection._secret = reply.secret
                return reply
            if time.monotonic() > deadline:
                raise NoServerError(
                    f"commander {self.name!r} got no control: its liveliness token did not reach "
                    f"the server within {_TOKEN_TIMEOUT:g} s; connect again"
                )
            time.sleep(0.02)

    def send(
        self, message: v1.Command | None = None, *, header: v1.Header | None = None, **plain: Any
    ) -> None:
        """Sends a command for a control tick: `v1.Command`, or the arguments of
        `wheelarm.command`: ``commander.send(linear=0.2, angular=0.0)``.

        Args:
            message: The command; its header, commander and seal are overwritten.
            header: Header of the tick that it answers; the newest clock's if absent.
            plain: Arguments of `wheelarm.command`.

        In real time the command is in force at the next control tick. Repeat a speed of the
        chair or a twist of the arm: the server stops either after 0.25 s.
        """
        refuse_fork(self._connection._owner)
        out = message if message is not None else command(**plain)
        if header is None:
            header = self.newest_header()
        out.commander = self.name
        out.header.CopyFrom(header)
        out.header.run_id = self.run_id
        out.header.sequence = self.sent
        out.answers_tick = header.tick
        out.ClearField("seal")
        self.sent += 1
        encoded = out.SerializeToString()
        if self._secret and self._sealed:
            encoded = seal(encoded, self._secret)
        self._publisher.put(encoded)

    def newest_header(self) -> v1.Header:
        """Header of the newest control tick; that of `status` before the first clock."""
        clock = self._clock
        if clock is not None and self._connection._server.published(clock):
            return read(v1.Clock, clock.payload.to_bytes(), "clock").header
        return self._connection.status().header

    def refusals(self) -> list[v1.Refusal]:
        """Rejections of its commands since the last call, oldest first."""
        found = []
        while not self._refused.empty():
            sample = self._refused.get()
            if self._connection._server.published(sample):
                refusal = read(v1.Refusal, sample.payload.to_bytes(), "refusal")
                if refusal.commander == self.name:
                    found.append(refusal)
        return found

    def check(self) -> None:
        """Raises the newest rejection of its commands since the last call.

        Raises:
            RefusedError: with code and text of the rejection.
        """
        refused = self.refusals()
        if refused:
            raise RefusedError("command", refused[-1].code, refused[-1].reason)

    def close(self) -> None:
        """Releases control."""
        if self._closed:
            return
        self._closed = True
        self._connection._unregister(self)
        if self._connection._secret == self._secret:
            self._connection._secret = ""
        try:
            if self._secret:
                self._connection.request(self._lease_request(release=True), timeout=1.0)
        except WheelArmError:
            pass  # Without a reply, control ends together with the token, shortly after.
        declared: list[Any] = [*self._subscribers, self._publisher, self._token]
        for declaration in declared:
            declaration.undeclare()

    def __enter__(self) -> Commander:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
