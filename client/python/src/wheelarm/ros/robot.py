"""Names and frames of a robot, from its description and its URDF."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from .. import v1
from . import tree

#: The world frame.
WORLD = "house"
#: Frame of the wheel odometry, between the world and the chair (REP 105).
ODOM = "odom"


def optical_frame(camera: str) -> str:
    """Name of a camera's optical frame: z forward, x right, y down."""
    return f"{camera}_optical_frame"


@dataclass(frozen=True)
class Robot:
    """Names and frames of a robot."""

    name: str
    #: Joints in the order of ``JointState``.
    joints: tuple[str, ...]
    #: The arm's joints from base to hand.
    arm: tuple[str, ...]
    knuckle: str
    knuckle_right: str
    #: Wheels, driven or not.
    wheels: frozenset[str]
    #: Frames in the order of ``PoseSet``: name, parent, link.
    frames: tuple[tuple[str, str, str], ...]
    root: str
    arm_base: str
    end_effector: str
    imu: str
    #: The laser scanner, a ``wheelarm.v1.ScannerDescription``; None without one.
    scanner: Any
    #: Joints of the URDF.
    tree: list[tree.Joint] = field(repr=False)
    urdf: str = field(repr=False)
    world: str = WORLD

    @staticmethod
    def from_description(description) -> Robot:
        """Creates a robot from a ``wheelarm.v1.RobotDescription``.

        Raises ``ValueError`` when its URDF cannot be read.
        """

        def with_role(*roles: int) -> list:
            return [joint for joint in description.joints if joint.role in roles]

        def name_of(role: int) -> str:
            found = with_role(role)
            return found[0].name if found else ""

        arm = sorted(with_role(v1.JOINT_ROLE_ARM), key=lambda joint: joint.arm_index)
        wheels = with_role(
            v1.JOINT_ROLE_WHEEL_LEFT,
            v1.JOINT_ROLE_WHEEL_RIGHT,
            v1.JOINT_ROLE_CASTER_LEFT,
            v1.JOINT_ROLE_CASTER_RIGHT,
        )
        return Robot(
            name=description.name,
            joints=tuple(joint.name for joint in description.joints),
            arm=tuple(joint.name for joint in arm),
            knuckle=name_of(v1.JOINT_ROLE_KNUCKLE),
            knuckle_right=name_of(v1.JOINT_ROLE_KNUCKLE_RIGHT),
            wheels=frozenset(joint.name for joint in wheels),
            frames=tuple((frame.name, frame.parent, frame.link) for frame in description.frames),
            root=description.root_link,
            arm_base=description.arm_base_link,
            end_effector=description.end_effector_link,
            imu=description.imu_link,
            scanner=description.scanner if description.HasField("scanner") else None,
            tree=tree.joints(description.urdf_text),
            urdf=description.urdf_text,
        )
