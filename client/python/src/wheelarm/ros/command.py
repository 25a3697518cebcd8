"""Conversion of ROS commands to one command per control tick.

``PendingCommands`` stores the newest command of each topic and returns, once per control
tick, the command for the server. It has no node, network or clock: the caller passes the
time. An invalid message raises ``BadCommandError`` and leaves the stored commands as they
are.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .. import v1
from .robot import Robot
from .tree import Transform

#: Seconds without ``cmd_vel`` after which the chair stops: the default of
#: diff_drive_controller.
CMD_VEL_TIMEOUT = 0.5


class BadCommandError(ValueError):
    """An invalid message of a topic; the text states the error and the fix."""


@dataclass
class TickCommand:
    """The command of one control tick; a part that is ``None`` keeps its target."""

    #: Forward speed, m/s, and turn rate, rad/s.
    base: tuple[float, float] | None = None
    #: Targets of the arm's joints from base to hand, radians.
    joints: list[float] | None = None
    #: Frame of the contract (``CommandFrame``) and pose of the end effector, metres.
    pose: tuple[int, Transform] | None = None
    #: Angle of the gripper's knuckle, radians.
    knuckle: float | None = None
    #: Distance between the pads, metres.
    opening: float | None = None

    def __bool__(self) -> bool:
        parts = (self.base, self.joints, self.pose, self.knuckle, self.opening)
        return any(part is not None for part in parts)

    def fill(self, command) -> None:
        """Writes the parts into an empty ``wheelarm.v1.Command``."""
        if self.base is not None:
            command.base.linear, command.base.angular = self.base
            # A stop is a present group of zeros.
            command.base.SetInParent()
        if self.joints is not None:
            command.arm.joints.positions.extend(self.joints)
        elif self.pose is not None:
            frame, ((x, y, z), (qx, qy, qz, qw)) = self.pose
            target = command.arm.pose
            target.frame = frame
            position, rotation = target.pose.position, target.pose.orientation
            position.x, position.y, position.z = x, y, z
            rotation.x, rotation.y, rotation.z, rotation.w = qx, qy, qz, qw
        if self.knuckle is not None:
            command.gripper.knuckle = self.knuckle
        elif self.opening is not None:
            command.gripper.opening = self.opening


def _finite(what: str, numbers: Sequence[float]) -> list[float]:
    numbers = [float(number) for number in numbers]
    if not all(map(math.isfinite, numbers)):
        raise BadCommandError(f"invalid {what} {numbers}: every number must be finite")
    return numbers


def base_velocity(twist) -> tuple[float, float]:
    """Forward speed and turn rate of a ``geometry_msgs/Twist`` in the chair's frame."""
    linear, angular = twist.linear, twist.angular
    numbers = _finite(
        "cmd_vel",
        [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z],
    )
    forward, *sideways, turn = numbers
    if any(sideways):
        raise BadCommandError(
            "invalid cmd_vel: linear.y, linear.z, angular.x and angular.y are "
            f"{', '.join(map(str, sideways))}, must be 0; the chair drives by linear.x and angular.z"
        )
    return forward, turn


def hand_target(message, robot: Robot) -> tuple[int, Transform]:
    """Frame and pose of a ``geometry_msgs/PoseStamped`` for the end effector."""
    frames = {
        "": v1.COMMAND_FRAME_BASE_LINK,
        robot.arm_base: v1.COMMAND_FRAME_BASE_LINK,
        robot.root: v1.COMMAND_FRAME_WHEELCHAIR,
        robot.world: v1.COMMAND_FRAME_HOUSE,
        robot.end_effector: v1.COMMAND_FRAME_END_EFFECTOR,
    }
    name = message.header.frame_id.lstrip("/")
    if name not in frames:
        known = ", ".join(filter(None, frames))
        raise BadCommandError(f"unknown frame {name!r} of desired_pose; available: {known}")
    place, turn = message.pose.position, message.pose.orientation
    x, y, z = _finite("position of desired_pose", [place.x, place.y, place.z])
    rotation = _finite("orientation of desired_pose", [turn.x, turn.y, turn.z, turn.w])
    norm = math.hypot(*rotation)
    if not 0.99 < norm < 1.01:
        raise BadCommandError(
            f"invalid orientation of desired_pose {rotation}: its length is {norm:.3g}; "
            "it must be a unit quaternion x y z w"
        )
    qx, qy, qz, qw = (number / norm for number in rotation)
    return frames[name], ((x, y, z), (qx, qy, qz, qw))


def joint_targets(
    what: str, names: Sequence[str], positions: Sequence[float], robot: Robot
) -> tuple[dict[int, float], float | None]:
    """Targets of arm joints (index to radians) and knuckle (radians) from named positions."""
    if len(names) != len(positions):
        raise BadCommandError(
            f"{what} has {len(names)} names and {len(positions)} positions: give one for each name"
        )
    if len(set(names)) != len(names):
        raise BadCommandError(f"{what} names a joint twice: {', '.join(names)}")
    targets = dict(zip(names, _finite(f"positions of {what}", positions), strict=False))
    unknown = [name for name in targets if name not in robot.joints]
    wheels = [name for name in targets if name in robot.wheels]
    if unknown or wheels:
        movable = ", ".join([*robot.arm, *filter(None, (robot.knuckle, robot.knuckle_right))])
        raise BadCommandError(
            f"{what} names {', '.join(unknown + wheels)}; available: {movable}"
            + ("; the wheels are driven by cmd_vel" if wheels else "")
        )
    arm = {index: targets[name] for index, name in enumerate(robot.arm) if name in targets}
    knuckle = targets.get(robot.knuckle)
    right = targets.get(robot.knuckle_right)
    if right is not None:
        if knuckle is not None and abs(knuckle + right) > 1e-6:
            raise BadCommandError(
                f"{what} has {robot.knuckle} = {knuckle} and {robot.knuckle_right} = {right}: "
                "the fingers move together, so one must be minus the other"
            )
        knuckle = -right if knuckle is None else knuckle
    if not arm and knuckle is None and targets:
        raise BadCommandError(
            f"{what} names only passive joints: {', '.join(targets)}; name a joint of the arm or "
            f"{robot.knuckle}"
        )
    return arm, knuckle


@dataclass(frozen=True)
class Trajectory:
    """Targets of the arm over simulation time."""

    #: Simulation time of each point, nanoseconds, increasing.
    stamps: list[int]
    #: Targets at each point, radians: arm joints, then the knuckle if `has_knuckle`.
    positions: list[list[float]]
    #: Their velocities, rad/s; ``None`` for linear interpolation.
    velocities: list[list[float] | None]
    #: Whether the last entry of each point is the knuckle.
    has_knuckle: bool
    #: Whether the trajectory has no arm joints.
    only_knuckle: bool

    def targets_at(self, nanos: int) -> list[float]:
        """Targets at a simulation time, ns; those of the first point before it, and those of
        the last point after it."""
        behind = bisect.bisect_right(self.stamps, nanos)
        if behind == 0:
            return self.positions[0]
        if behind == len(self.stamps):
            return self.positions[-1]
        before = behind - 1
        span = (self.stamps[behind] - self.stamps[before]) * 1e-9
        part = (nanos - self.stamps[before]) * 1e-9 / span
        first, last = self.positions[before], self.positions[behind]
        start, end = self.velocities[before], self.velocities[behind]
        if start is None or end is None:
            return [a + part * (b - a) for a, b in zip(first, last, strict=False)]
        # Cubic Hermite: positions and velocities of both ends.
        h01 = part * part * (3 - 2 * part)
        h10 = part * (1 - part) ** 2 * span
        h11 = part * part * (part - 1) * span
        return [
            a + h01 * (b - a) + h10 * va + h11 * vb
            for a, b, va, vb in zip(first, last, start, end, strict=False)
        ]

    def is_over(self, nanos: int) -> bool:
        """Whether that time, ns, is at or after the last point."""
        return nanos >= self.stamps[-1]


def make_trajectory(
    message,
    robot: Robot,
    *,
    now: int,
    present: Sequence[float],
    knuckle: float,
    stamp_of: Callable[[object], int],
) -> Trajectory | None:
    """Converts a ``trajectory_msgs/JointTrajectory``; ``None`` for an empty one, which stops.

    ``now`` is the simulation time, nanoseconds; ``present`` and ``knuckle`` are the targets in
    force, radians, at which the trajectory starts. A stamp of 0 means now.
    """
    if not message.points:
        return None
    begin = stamp_of(message.header.stamp) or now
    width = len(message.joint_names)
    arm, last_knuckle = joint_targets("joint_trajectory", message.joint_names, [0.0] * width, robot)
    has_knuckle = last_knuckle is not None
    # Index of each joint in a point; the right knuckle has the opposite sign.
    places: dict[int, int] = {
        index: list(message.joint_names).index(robot.arm[index]) for index in arm
    }
    knuckle_place, sign = None, 1.0
    if has_knuckle:
        left = robot.knuckle in message.joint_names
        name = robot.knuckle if left else robot.knuckle_right
        knuckle_place, sign = list(message.joint_names).index(name), 1.0 if left else -1.0

    def row(numbers: Sequence[float], still: Sequence[float]) -> list[float]:
        targets = [numbers[places[i]] if i in places else still[i] for i in range(len(robot.arm))]
        if knuckle_place is not None:
            targets.append(sign * numbers[knuckle_place])
        return targets

    still = list(present) + ([knuckle] if has_knuckle else [])
    stamps, positions = [now], [still]
    velocities: list[list[float] | None] = [[0.0] * len(still)]
    previous = None
    for number, one in enumerate(message.points):
        what = f"point {number} of joint_trajectory"
        if len(one.positions) != width:
            raise BadCommandError(f"{what} has {len(one.positions)} positions for {width} joints")
        if len(one.velocities) not in (0, width):
            raise BadCommandError(
                f"{what} has {len(one.velocities)} velocities for {width} joints: none, or all"
            )
        after = stamp_of(one.time_from_start)
        if (previous is not None and after <= previous) or after < 0:
            raise BadCommandError(
                f"{what} is {after * 1e-9:.3f} s after the start: "
                "times must increase from point to point"
            )
        previous = after
        joint_targets(what, message.joint_names, one.positions, robot)
        place = row(_finite(f"positions of {what}", one.positions), present)
        speed = None
        if len(one.velocities):
            speed = row(_finite(f"velocities of {what}", one.velocities), [0.0] * len(robot.arm))
        if begin + after <= now:
            # A point in the past: the trajectory continues from the targets in force, or
            # from this point if its time is now.
            if begin + after == now:
                positions[0], velocities[0] = place, speed
            continue
        stamps.append(begin + after)
        positions.append(place)
        velocities.append(speed)
    if len(stamps) == 1 and begin + (previous or 0) < now:
        raise BadCommandError(
            f"joint_trajectory ends at {(begin + previous) * 1e-9:.3f} s, before the present "
            f"simulation time {now * 1e-9:.3f} s: stamp it with simulation time (use_sim_time), "
            "or with 0 for now"
        )
    return Trajectory(stamps, positions, velocities, has_knuckle, not arm)


@dataclass
class _Drive:
    base: tuple[float, float]
    wall: float
    nanos: int


@dataclass
class PendingCommands:
    """The newest command of every topic, merged to one command per control tick."""

    robot: Robot
    #: Seconds without ``cmd_vel`` after which the chair stops.
    timeout: float = CMD_VEL_TIMEOUT
    #: Whether ages count in simulation time, as in lock-step, where time waits.
    in_simulation_time: bool = False
    drive: _Drive | None = None
    _stop: bool = False
    _arm: dict[int, float] = field(default_factory=dict)
    _hold: bool = False
    _pose: tuple[int, Transform] | None = None
    _knuckle: float | None = None
    _opening: float | None = None
    _trajectory: Trajectory | None = None
    #: The newest joint goal, which the targets in force may not have reached yet.
    _goal: list[float] | None = None
    #: Targets in force (`applied`): arm joints, knuckle; `None` before the first.
    targets: tuple[list[float], float] | None = None

    def drop(self) -> None:
        """Deletes every command."""
        self.drive, self._stop, self._hold = None, False, False
        self._arm, self._pose, self._trajectory = {}, None, None
        self._knuckle = self._opening = self._goal = None

    def clear(self) -> None:
        """Deletes every command and the targets in force, as after a reset."""
        self.drop()
        self.targets = None

    @property
    def is_waiting(self) -> bool:
        """Whether a command waits for the next tick."""
        return bool(
            self.drive
            or self._stop
            or self._hold
            or self._arm
            or self._pose
            or self._trajectory
            or self._knuckle is not None
            or self._opening is not None
        )

    def twist(self, twist, wall: float, nanos: int) -> None:
        """Stores ``cmd_vel``, received at a wall time, s, and a simulation time, ns."""
        self.drive = _Drive(base_velocity(twist), wall, nanos)

    def joint_command(self, message) -> None:
        """Stores ``sensor_msgs/JointState``: positions of arm joints and knuckle, radians.
        Joints without a name in the message keep their target."""
        if not len(message.position):
            raise BadCommandError(
                "joint_command has no positions: give positions; velocities and efforts are ignored"
            )
        arm, knuckle = joint_targets("joint_command", message.name, message.position, self.robot)
        if arm:
            known = self._arm.keys() | arm.keys()
            if len(known) < len(self.robot.arm) and self.targets is None:
                raise BadCommandError(
                    "joint_command names some joints of the arm, and the targets of the others are "
                    "unknown before the first tick: name all, or send it again"
                )
            self._arm.update(arm)
            self._pose = self._trajectory = None
            self._hold = False
        if knuckle is not None:
            self._knuckle, self._opening = knuckle, None

    def desired_pose(self, message) -> None:
        """Stores ``geometry_msgs/PoseStamped``: the target of the end effector."""
        self._pose = hand_target(message, self.robot)
        self._arm, self._trajectory, self._hold = {}, None, False

    def opening(self, metres: float) -> None:
        """Stores the distance between the pads, metres."""
        (self._opening,) = _finite("gripper", [metres])
        self._knuckle = None

    def trajectory(self, message, nanos: int, stamp_of: Callable[[object], int]) -> None:
        """Stores ``trajectory_msgs/JointTrajectory``; an empty one holds the arm."""
        if self.targets is None:
            raise BadCommandError(
                "joint_trajectory starts at the targets in force, which are unknown before the "
                "first tick: send it again"
            )
        joints, knuckle = self._goal or self.targets[0], self.targets[1]
        found = make_trajectory(
            message, self.robot, now=nanos, present=joints, knuckle=knuckle, stamp_of=stamp_of
        )
        if found is None:
            self._hold = self._trajectory is not None
        self._trajectory = found
        self._arm, self._pose = {}, None

    def command_at(self, wall: float, nanos: int) -> TickCommand:
        """The command of a control tick at a wall time, s, and a simulation time, ns. Goals are
        part of one tick; ``cmd_vel`` and a trajectory are part of every tick while they
        last."""
        command = TickCommand()
        if self.drive is not None:
            age = wall - self.drive.wall
            if self.in_simulation_time:
                age = (nanos - self.drive.nanos) * 1e-9
            if 0.0 <= age <= self.timeout:
                command.base = self.drive.base
            else:
                self.drive, self._stop = None, True
        if self._stop:
            command.base, self._stop = (0.0, 0.0), False
        if self._trajectory is not None:
            targets = self._trajectory.targets_at(nanos)
            if self._trajectory.has_knuckle:
                *targets, command.knuckle = targets
            if not self._trajectory.only_knuckle:
                command.joints = list(targets)
            if self._trajectory.is_over(nanos):
                self._trajectory = None
        elif self._hold and self.targets is not None:
            command.joints, self._hold = list(self.targets[0]), False
        elif self._arm:
            still = self._goal or (self.targets[0] if self.targets else [])
            merged = {**dict(enumerate(still)), **self._arm}
            command.joints = [merged[index] for index in range(len(self.robot.arm))]
            self._arm = {}
        elif self._pose is not None:
            command.pose, self._pose = self._pose, None
        if command.joints is not None:
            self._goal = list(command.joints)
        elif command.pose is not None:
            self._goal = None
        if self._knuckle is not None:
            command.knuckle, self._knuckle = self._knuckle, None
        elif self._opening is not None and command.knuckle is None:
            command.opening, self._opening = self._opening, None
        return command
