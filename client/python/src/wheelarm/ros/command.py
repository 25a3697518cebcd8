"""What ROS asks of the robot, and when it is asked of the server.

``Wishes`` keeps the newest wish of each topic and, once per control tick, tells
what the server is to be asked. It knows no node, no network and no clock: whoever
calls says what time it is. A message that cannot be carried out raises
``BadCommand`` in words, and what was wished before stays.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .. import v1
from .robot import Robot
from .tree import Transform

#: Seconds after which the chair stops when no ``cmd_vel`` comes any more: the
#: default of diff_drive_controller.
CMD_VEL_TIMEOUT = 0.5


class BadCommand(ValueError):
    """A message that cannot be carried out: what is wrong and what would be right."""


@dataclass
class Wanted:
    """What is asked at one control tick; what is ``None`` stays as it is."""

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
        return any(
            one is not None
            for one in (self.base, self.joints, self.pose, self.knuckle, self.opening)
        )

    def fill(self, command) -> None:
        """Writes itself into an empty ``wheelarm.v1.Command``."""
        if self.base is not None:
            command.base.linear, command.base.angular = self.base
            # A group that is all zero is there nevertheless.
            command.base.SetInParent()
        if self.joints is not None:
            command.arm.joints.positions.extend(self.joints)
        elif self.pose is not None:
            frame, ((x, y, z), (qx, qy, qz, qw)) = self.pose
            target = command.arm.pose
            target.frame = frame
            place, turn = target.pose.position, target.pose.orientation
            place.x, place.y, place.z = x, y, z
            turn.x, turn.y, turn.z, turn.w = qx, qy, qz, qw
        if self.knuckle is not None:
            command.gripper.knuckle = self.knuckle
        elif self.opening is not None:
            command.gripper.opening = self.opening


def _finite(what: str, numbers: Sequence[float]) -> list[float]:
    numbers = [float(number) for number in numbers]
    if not all(map(math.isfinite, numbers)):
        raise BadCommand(f"{what} holds {numbers}: every number must be finite")
    return numbers


def base_of(twist) -> tuple[float, float]:
    """Forward speed and turn rate of a ``geometry_msgs/Twist`` in the chair's frame."""
    linear, angular = twist.linear, twist.angular
    numbers = _finite(
        "cmd_vel",
        [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z],
    )
    forward, *sideways, turn = numbers
    if any(sideways):
        raise BadCommand(
            "cmd_vel asks for linear.y, linear.z, angular.x or angular.y "
            f"({', '.join(map(str, sideways))}): the chair drives by linear.x and angular.z alone"
        )
    return forward, turn


def pose_of(message, robot: Robot) -> tuple[int, Transform]:
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
        raise BadCommand(f"desired_pose is in the frame {name!r}; it can be in {known} (metres)")
    place, turn = message.pose.position, message.pose.orientation
    x, y, z = _finite("the position of desired_pose", [place.x, place.y, place.z])
    rotation = _finite("the orientation of desired_pose", [turn.x, turn.y, turn.z, turn.w])
    norm = math.hypot(*rotation)
    if not 0.99 < norm < 1.01:
        raise BadCommand(
            f"the orientation of desired_pose {rotation} has the length {norm:.3g}; "
            "it must be a unit quaternion x y z w"
        )
    qx, qy, qz, qw = (number / norm for number in rotation)
    return frames[name], ((x, y, z), (qx, qy, qz, qw))


def joints_of(
    what: str, names: Sequence[str], positions: Sequence[float], robot: Robot
) -> tuple[dict[int, float], float | None]:
    """Arm joints (index to radians) and knuckle (radians) among named positions."""
    if len(names) != len(positions):
        raise BadCommand(
            f"{what} has {len(names)} names and {len(positions)} positions: one for each name"
        )
    if len(set(names)) != len(names):
        raise BadCommand(f"{what} names a joint twice: {', '.join(names)}")
    told = dict(zip(names, _finite(what, positions), strict=False))
    unknown = [name for name in told if name not in robot.joints]
    wheels = [name for name in told if name in robot.wheels]
    if unknown or wheels:
        movable = ", ".join([*robot.arm, *filter(None, (robot.knuckle, robot.knuckle_right))])
        raise BadCommand(
            f"{what} names {', '.join(unknown + wheels)}: positions are taken for {movable}"
            + ("; the wheels are driven by cmd_vel" if wheels else "")
        )
    arm = {index: told[name] for index, name in enumerate(robot.arm) if name in told}
    knuckle = told.get(robot.knuckle)
    right = told.get(robot.knuckle_right)
    if right is not None:
        if knuckle is not None and abs(knuckle + right) > 1e-6:
            raise BadCommand(
                f"{what} asks for {robot.knuckle} = {knuckle} and {robot.knuckle_right} = {right}: "
                "the fingers move together, so one is minus the other"
            )
        knuckle = -right if knuckle is None else knuckle
    if not arm and knuckle is None and told:
        raise BadCommand(f"{what} names only joints that follow another one: {', '.join(told)}")
    return arm, knuckle


@dataclass(frozen=True)
class Trajectory:
    """Targets over simulation time: from ``begin`` the way through ``points``."""

    #: Simulation time of each point, nanoseconds, growing.
    stamps: list[int]
    #: Targets at each point: arm joints, then the knuckle where it is among them.
    positions: list[list[float]]
    #: Their velocities, rad/s; ``None`` where the message has none: straight lines.
    velocities: list[list[float] | None]
    #: The last entry of each point is the knuckle.
    has_knuckle: bool
    #: Nothing but the knuckle.
    only_knuckle: bool

    def at(self, nanos: int) -> list[float]:
        """Targets at a simulation time; before the first and after the last point
        those."""
        behind = bisect.bisect_right(self.stamps, nanos)
        if behind == 0:
            return self.positions[0]
        if behind == len(self.stamps):
            return self.positions[-1]
        before = behind - 1
        span = (self.stamps[behind] - self.stamps[before]) * 1e-9
        part = (nanos - self.stamps[before]) * 1e-9 / span
        first, last = self.positions[before], self.positions[behind]
        leaving, coming = self.velocities[before], self.velocities[behind]
        if leaving is None or coming is None:
            return [a + part * (b - a) for a, b in zip(first, last, strict=False)]
        # Cubic Hermite: positions and velocities of both ends.
        h01 = part * part * (3 - 2 * part)
        h10 = part * (1 - part) ** 2 * span
        h11 = part * part * (part - 1) * span
        return [
            a + h01 * (b - a) + h10 * va + h11 * vb
            for a, b, va, vb in zip(first, last, leaving, coming, strict=False)
        ]

    def is_over(self, nanos: int) -> bool:
        """Whether its last point is asked at that time."""
        return nanos >= self.stamps[-1]


def trajectory_of(
    message,
    robot: Robot,
    *,
    now: int,
    present: Sequence[float],
    knuckle: float,
    stamp_of: Callable[[object], int],
) -> Trajectory | None:
    """A ``trajectory_msgs/JointTrajectory``; ``None`` for an empty one, which stops.

    ``now`` is the simulation time, nanoseconds, ``present`` and ``knuckle`` are the
    targets in force, from which it sets off. A stamp of 0 begins now.
    """
    if not message.points:
        return None
    begin = stamp_of(message.header.stamp) or now
    width = len(message.joint_names)
    arm, last_knuckle = joints_of("joint_trajectory", message.joint_names, [0.0] * width, robot)
    has_knuckle = last_knuckle is not None
    # Where each joint stands in a point: its place and its sign.
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
            raise BadCommand(f"{what} has {len(one.positions)} positions for {width} joints")
        if len(one.velocities) not in (0, width):
            raise BadCommand(
                f"{what} has {len(one.velocities)} velocities for {width} joints: none, or all"
            )
        after = stamp_of(one.time_from_start)
        if (previous is not None and after <= previous) or after < 0:
            raise BadCommand(
                f"{what} is {after * 1e-9:.3f} s from the start: "
                "times must grow from point to point"
            )
        previous = after
        joints_of(what, message.joint_names, one.positions, robot)
        place = row(_finite(what, one.positions), present)
        speed = None
        if len(one.velocities):
            speed = row(_finite(what, one.velocities), [0.0] * len(robot.arm))
        if begin + after <= now:
            # What is over already: the way goes on from the targets in force, or,
            # where it says that the robot is there now, from this point.
            if begin + after == now:
                positions[0], velocities[0] = place, speed
            continue
        stamps.append(begin + after)
        positions.append(place)
        velocities.append(speed)
    if len(stamps) == 1 and begin + (previous or 0) < now:
        raise BadCommand(
            f"joint_trajectory ended at {(begin + previous) * 1e-9:.3f} s of simulation time "
            f"and it is {now * 1e-9:.3f} s: stamp it with simulation time (use_sim_time), "
            "or with 0 for now"
        )
    return Trajectory(stamps, positions, velocities, has_knuckle, not arm)


@dataclass
class _Drive:
    base: tuple[float, float]
    wall: float
    nanos: int


@dataclass
class Wishes:
    """The newest wishes, and what of them is asked at a control tick."""

    robot: Robot
    #: Seconds of silence after which the chair stops.
    timeout: float = CMD_VEL_TIMEOUT
    #: Ages are counted in simulation time: true in lock-step, where time waits.
    in_simulation_time: bool = False
    drive: _Drive | None = None
    _stop: bool = False
    _arm: dict[int, float] = field(default_factory=dict)
    _hold: bool = False
    _pose: tuple[int, Transform] | None = None
    _knuckle: float | None = None
    _opening: float | None = None
    _trajectory: Trajectory | None = None
    #: The newest joint goal, which the targets in force may still be on the way to.
    _goal: list[float] | None = None
    #: Targets in force (`applied`): arm joints, knuckle; `None` before the first.
    targets: tuple[list[float], float] | None = None

    def drop(self) -> None:
        """Forgets every wish."""
        self.drive, self._stop, self._hold = None, False, False
        self._arm, self._pose, self._trajectory = {}, None, None
        self._knuckle = self._opening = self._goal = None

    def clear(self) -> None:
        """Forgets every wish and the targets in force, as after a reset."""
        self.drop()
        self.targets = None

    @property
    def is_waiting(self) -> bool:
        """Whether anything is to be asked."""
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
        """``cmd_vel``, at a wall time, s, and a simulation time, ns."""
        self.drive = _Drive(base_of(twist), wall, nanos)

    def joint_command(self, message) -> None:
        """``sensor_msgs/JointState``: positions of arm joints and knuckle. What is
        not named keeps its target."""
        if not len(message.position):
            raise BadCommand("joint_command has no positions; velocities and efforts are not taken")
        arm, knuckle = joints_of("joint_command", message.name, message.position, self.robot)
        if arm:
            known = self._arm.keys() | arm.keys()
            if len(known) < len(self.robot.arm) and self.targets is None:
                raise BadCommand(
                    "joint_command names some of the arm's joints, and the targets of the others "
                    "are not known before time goes on: name all, or send it again"
                )
            self._arm.update(arm)
            self._pose = self._trajectory = None
            self._hold = False
        if knuckle is not None:
            self._knuckle, self._opening = knuckle, None

    def desired_pose(self, message) -> None:
        """``geometry_msgs/PoseStamped``: where the end effector is to go."""
        self._pose = pose_of(message, self.robot)
        self._arm, self._trajectory, self._hold = {}, None, False

    def opening(self, metres: float) -> None:
        """Distance between the pads, metres."""
        (self._opening,) = _finite("gripper", [metres])
        self._knuckle = None

    def trajectory(self, message, nanos: int, stamp_of: Callable[[object], int]) -> None:
        """``trajectory_msgs/JointTrajectory``; an empty one holds the arm."""
        if self.targets is None:
            raise BadCommand(
                "joint_trajectory sets off from the targets in force, and none are known "
                "before time goes on: send it again"
            )
        joints, knuckle = self._goal or self.targets[0], self.targets[1]
        found = trajectory_of(
            message, self.robot, now=nanos, present=joints, knuckle=knuckle, stamp_of=stamp_of
        )
        if found is None:
            self._hold = self._trajectory is not None
        self._trajectory = found
        self._arm, self._pose = {}, None

    def at(self, wall: float, nanos: int) -> Wanted:
        """What is asked at a control tick, at a wall time, s, and its simulation
        time, ns. Goals are asked once; ``cmd_vel`` and a trajectory at every tick
        while they last."""
        wanted = Wanted()
        if self.drive is not None:
            age = wall - self.drive.wall
            if self.in_simulation_time:
                age = (nanos - self.drive.nanos) * 1e-9
            if 0.0 <= age <= self.timeout:
                wanted.base = self.drive.base
            else:
                self.drive, self._stop = None, True
        if self._stop:
            wanted.base, self._stop = (0.0, 0.0), False
        if self._trajectory is not None:
            targets = self._trajectory.at(nanos)
            if self._trajectory.has_knuckle:
                *targets, wanted.knuckle = targets
            if not self._trajectory.only_knuckle:
                wanted.joints = list(targets)
            if self._trajectory.is_over(nanos):
                self._trajectory = None
        elif self._hold and self.targets is not None:
            wanted.joints, self._hold = list(self.targets[0]), False
        elif self._arm:
            still = self._goal or (self.targets[0] if self.targets else [])
            merged = {**dict(enumerate(still)), **self._arm}
            wanted.joints = [merged[index] for index in range(len(self.robot.arm))]
            self._arm = {}
        elif self._pose is not None:
            wanted.pose, self._pose = self._pose, None
        if wanted.joints is not None:
            self._goal = list(wanted.joints)
        elif wanted.pose is not None:
            self._goal = None
        if self._knuckle is not None:
            wanted.knuckle, self._knuckle = self._knuckle, None
        elif self._opening is not None and wanted.knuckle is None:
            wanted.opening, self._opening = self._opening, None
        return wanted
