"""Rows of state and of action of a policy, as in the exports.

The counterpart of the crate `wheelarm-policy`: the same numbers in the same order with
the same names. Pure functions: they convert recorded values to rows, and a row to one
command that covers all control ticks until the next image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import v1
from ._contract import ARM_JOINTS, CONTROL_HZ
from .streams import pose as pose_of

#: Values of a row of state (count).
STATE = 27
#: Names of the six numbers of a rotation: the first two columns of its matrix.
SIX = ("xx", "xy", "xz", "yx", "yy", "yz")
#: Default names of a robot's arm joints.
DEFAULT_JOINTS = tuple(f"joint_{i}" for i in range(1, ARM_JOINTS + 1))
#: Kinds of action rows, with their sizes.
KINDS = {"next-pose": 12, "next-joints": 9, "applied": 9}
#: Values of a row, in SI units, are smaller than this; larger ones are errors of the policy.
VALUE_LIMIT = 100.0


def arm_joint_names(robot: v1.RobotDescription) -> list[str]:
    """Names of the arm's joints, from base to hand."""
    arm = [joint for joint in robot.joints if joint.role == v1.JOINT_ROLE_ARM]
    return [joint.name for joint in sorted(arm, key=lambda joint: joint.arm_index)]


def state_names(joints: Sequence[str] = DEFAULT_JOINTS) -> list[str]:
    """Names of the 27 values of a row of state."""
    return [
        *(f"{joint}.position" for joint in joints),
        *(f"{joint}.velocity" for joint in joints),
        "knuckle.position",
        "knuckle.velocity",
        "hand.x",
        "hand.y",
        "hand.z",
        *(f"hand.{part}" for part in SIX),
        *(f"odometry.{part}" for part in ("x", "y", "cos", "sin")),
    ]


def action_names(kind: str = "next-pose", joints: Sequence[str] = DEFAULT_JOINTS) -> list[str]:
    """Names of the values of a row of action."""
    arm = [f"{joint}.target" for joint in joints]
    chair = ["knuckle.target", "chair.linear", "chair.angular"]
    wheels = ["wheel_left.target_velocity", "wheel_right.target_velocity", "knuckle.target"]
    hand = [f"hand.{part}" for part in ("x", "y", "z", *SIX)]
    if kind not in KINDS:
        raise ValueError(f"unknown kind of action {kind!r}; available: {', '.join(KINDS)}")
    return {"next-pose": hand + chair, "next-joints": arm + chair, "applied": arm + wheels}[kind]


def to_six(quaternion: ArrayLike) -> NDArray[np.float64]:
    """The first two columns of the rotation matrix of a quaternion x y z w, (6,).

    Continuous, unlike quaternions (Zhou et al. 2019, "On the Continuity of Rotation
    Representations in Neural Networks").
    """
    q = np.asarray(quaternion, dtype=np.float64)
    x, y, z, w = q / np.sqrt((q * q).sum())
    return np.array(
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y + z * w),
            2.0 * (x * z - y * w),
            2.0 * (x * y - z * w),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z + x * w),
        ]
    )


def from_six(six: ArrayLike) -> NDArray[np.float64] | None:
    """The unit quaternion x y z w, w not negative, whose matrix is nearest in the first
    column and then in the second (Gram-Schmidt). None if the columns are parallel or zero."""
    values = np.asarray(six, dtype=np.float64)
    a = _unit(values[:3])
    if a is None:
        return None
    b = _unit(values[3:] - (a @ values[3:]) * a)
    if b is None:
        return None
    c = np.cross(a, b)
    m00, m10, m20 = a
    m01, m11, m21 = b
    m02, m12, m22 = c
    # Of the four formulas for the quaternion, the one with the largest divisor.
    q = np.array(
        [
            [1.0 + m00 - m11 - m22, m01 + m10, m02 + m20, m21 - m12],
            [m01 + m10, 1.0 - m00 + m11 - m22, m12 + m21, m02 - m20],
            [m02 + m20, m12 + m21, 1.0 - m00 - m11 + m22, m10 - m01],
            [m21 - m12, m02 - m20, m10 - m01, 1.0 + m00 + m11 + m22],
        ]
    )
    best = q[int(np.argmax(np.diag(q)))]
    best = best / np.sqrt((best * best).sum())
    return -best if best[3] < 0.0 else best


def _unit(v: NDArray[np.float64]) -> NDArray[np.float64] | None:
    norm = float(np.sqrt((v * v).sum()))
    return v / norm if np.isfinite(norm) and norm > 1e-6 else None


def multiply(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """The product of two quaternions x y z w: first `b`, then `a`."""
    ax, ay, az, aw = np.asarray(a, dtype=np.float64)
    bx, by, bz, bw = np.asarray(b, dtype=np.float64)
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def from_vector(rotation: ArrayLike) -> NDArray[np.float64]:
    """The quaternion x y z w of a rotation vector, radians."""
    v = np.asarray(rotation, dtype=np.float64)
    angle = float(np.sqrt((v * v).sum()))
    # sin(a / 2) / a, with its limit for small a.
    scale = 0.5 if angle < 1e-9 else float(np.sin(angle / 2.0)) / angle
    return np.array([*(v * scale), float(np.cos(angle / 2.0))])


def _heading(pose: NDArray[np.float64]) -> tuple[float, float]:
    """Cosine and sine of the yaw of a pose."""
    x, y, z, w = pose[3:]
    cos, sin = 1.0 - 2.0 * (y * y + z * z), 2.0 * (w * z + x * y)
    norm = float(np.sqrt(cos * cos + sin * sin))
    return float(cos / norm), float(sin / norm)


def state(
    joints: ArrayLike,
    velocities: ArrayLike,
    knuckle: ArrayLike,
    hand: ArrayLike,
    odometry: ArrayLike,
    start: ArrayLike,
) -> NDArray[np.float64]:
    """A row of state, (27,): values that the real robot measures.

    Args:
        joints: Positions of the arm's joints, (6,), radians.
        velocities: Their velocities, (6,), rad/s.
        knuckle: Position, radians, and velocity, rad/s, of the knuckle, (2,).
        hand: End effector in `base_link`, (7,): x y z, metres, and qx qy qz qw.
        odometry: Pose by odometry, (7,): x y z, metres, and qx qy qz qw.
        start: That pose at the first row of the policy, (7,).
    """
    hand_, now, begun = (np.asarray(v, dtype=np.float64) for v in (hand, odometry, start))
    cos, sin = _heading(begun)
    c, s = _heading(now)
    dx, dy = now[:2] - begun[:2]
    since = [cos * dx + sin * dy, cos * dy - sin * dx, cos * c + sin * s, cos * s - sin * c]
    parts = (joints, velocities, knuckle, hand_[:3], to_six(hand_[3:]), since)
    return np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])


@dataclass
class Observer:
    """Converts samples of a server to rows of state.

    Attributes:
        arm: Indices of the arm's joints in `JointState`, from base to hand.
        knuckle: Index of the knuckle in `JointState`.
        hand: Index of the end effector in `PoseSet`.
        chair: Index of the chair in `PoseSet`.
        start: Odometry of the first row, (7,); set by the first row.
    """

    arm: list[int]
    knuckle: int
    hand: int
    chair: int
    start: NDArray[np.float64] | None = field(default=None)

    @classmethod
    def for_robot(cls, robot: v1.RobotDescription) -> Observer:
        """Finds the indices of a robot's joints and frames in the samples.

        Raises:
            ValueError: when one is missing.
        """
        arm = {j.arm_index: i for i, j in enumerate(robot.joints) if j.role == v1.JOINT_ROLE_ARM}
        roles = {joint.role: i for i, joint in enumerate(robot.joints)}
        frames = {frame.role: i for i, frame in enumerate(robot.frames)}
        try:
            return cls(
                arm=[arm[i] for i in range(ARM_JOINTS)],
                knuckle=roles[v1.JOINT_ROLE_KNUCKLE],
                hand=frames[v1.FRAME_ROLE_END_EFFECTOR],
                chair=frames[v1.FRAME_ROLE_CHAIR],
            )
        except KeyError as missing:
            raise ValueError(f"the robot {robot.name!r} has no joint or frame {missing}") from None

    def row(
        self, joints: v1.JointState, poses: v1.PoseSet, odometry: v1.Odometry
    ) -> NDArray[np.float64]:
        """The row of state, (27,), from samples of one tick."""
        positions, velocities = joints.positions, joints.velocities
        now = pose_of(odometry.pose)
        if self.start is None:
            self.start = now
        return state(
            [positions[i] for i in self.arm],
            [velocities[i] for i in self.arm],
            [positions[self.knuckle], velocities[self.knuckle]],
            pose_of(poses.frames[self.hand].pose),
            now,
            self.start,
        )


class Player:
    """Converts a row of action to one command. A network may exceed the robot's limits
    slightly: speeds and the knuckle are clipped to them.

    Args:
        kind: ``next-pose``, ``next-joints`` or ``applied``.
        robot: The robot, as `scene` describes it.
        rate_hz: Rows per second; must divide 60.

    Attributes:
        over_ticks: Control ticks of a row (count).
        max_force: Force limit at each pad, N; the robot's usual one if None.
        device: Input device stated in the commands.
    """

    def __init__(self, kind: str, robot: v1.RobotDescription, rate_hz: float) -> None:
        self.kind, self.size = kind, len(action_names(kind))
        ticks = CONTROL_HZ / rate_hz
        if not 1.0 <= ticks <= CONTROL_HZ or ticks != int(ticks):
            raise ValueError(
                f"invalid rate of {rate_hz} rows per second: it must divide {CONTROL_HZ}"
            )
        self.over_ticks = int(ticks)
        self.max_force: float | None = None
        self.device: int = v1.DEVICE_POLICY
        drive = robot.drive
        self._radius, self._track = drive.wheel_radius, drive.track

        def limit(value: float) -> float:
            return value if value > 0.0 else np.inf

        self._forward = limit(drive.forward_speed)
        self._backward = limit(drive.backward_speed)
        self._turn = limit(drive.turn_rate)
        self._closed = limit(robot.gripper.max_knuckle)

    def command(self, row: ArrayLike) -> v1.Command:
        """The command of a row.

        Raises:
            ValueError: when the row has a wrong length, a number that is not finite or too
                large, or an invalid rotation.
        """
        values = np.asarray(row, dtype=np.float64)
        if values.shape != (self.size,):
            raise ValueError(
                f"a row of {self.kind} has {self.size} numbers, this one has shape {values.shape}"
            )
        for i, value in enumerate(values):
            if not np.isfinite(value):
                raise ValueError(f"number {i} of the row is {value}, which is not finite")
            if abs(value) >= VALUE_LIMIT:
                raise ValueError(
                    f"number {i} of the row is {value}; allowed is less than {VALUE_LIMIT:g} "
                    "(m, rad, m/s, rad/s)"
                )
        numbers = values.tolist()
        out = v1.Command(over_ticks=self.over_ticks, device=self.device, mode=v1.INPUT_MODE_STREAM)
        if self.kind == "next-pose":
            quaternion = from_six(values[3:9])
            if quaternion is None:
                raise ValueError(
                    f"the rotation of the hand {numbers[3:9]} spans no plane: its two columns "
                    "are parallel or zero"
                )
            target = out.arm.pose
            target.frame = v1.COMMAND_FRAME_BASE_LINK
            p, q = target.pose.position, target.pose.orientation
            p.x, p.y, p.z = numbers[:3]
            q.x, q.y, q.z, q.w = quaternion.tolist()
            knuckle, linear, angular = numbers[9:]
        else:
            out.arm.joints.positions.extend(numbers[:ARM_JOINTS])
            if self.kind == "next-joints":
                knuckle, linear, angular = numbers[ARM_JOINTS:]
            else:
                left, right, knuckle = numbers[ARM_JOINTS:]
                linear = (right + left) / 2.0 * self._radius
                angular = (right - left) / self._track * self._radius
        self.chair_and_gripper(out, knuckle, linear, angular)
        return out

    def chair_and_gripper(
        self, out: v1.Command, knuckle: float, linear: float, angular: float
    ) -> None:
        """Adds chair, m/s and rad/s, and gripper, radians at the knuckle, to a command."""
        out.base.SetInParent()
        out.base.linear = min(max(linear, -self._backward), self._forward)
        out.base.angular = min(max(angular, -self._turn), self._turn)
        out.gripper.knuckle = min(max(knuckle, 0.0), self._closed)
        if self.max_force is not None:
            out.gripper.max_force = self.max_force


def force_cap(scene: v1.SceneReply) -> float | None:
    """Force limit of the pads for grasps of the task's object, N; None without a limit. It is
    not part of a row."""
    caps = [
        grasp.force
        for grasp in scene.grasps
        if grasp.object == scene.target and grasp.HasField("force")
    ]
    return min(caps) if caps else None
