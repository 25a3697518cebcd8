"""Frames of the robot as a tree: the URDF's joints and where they stand.

A transform is ``((x, y, z), (qx, qy, qz, qw))``: where the child is in its
parent, metres and a unit quaternion. Nothing here knows ROS.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as xml
from collections.abc import Mapping
from dataclasses import dataclass

Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]
Transform = tuple[Vector, Rotation]

IDENTITY: Transform = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def turned(rotation: Rotation, vector: Vector) -> Vector:
    """``vector`` turned by ``rotation``."""
    qx, qy, qz, qw = rotation
    x, y, z = vector
    tx, ty, tz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return (
        x + qw * tx + qy * tz - qz * ty,
        y + qw * ty + qz * tx - qx * tz,
        z + qw * tz + qx * ty - qy * tx,
    )


def rotated(first: Rotation, second: Rotation) -> Rotation:
    """The product ``first * second``."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def chained(a_from_b: Transform, b_from_c: Transform) -> Transform:
    """``a_from_c``."""
    (origin, rotation), (inner, turn) = a_from_b, b_from_c
    x, y, z = turned(rotation, inner)
    return (origin[0] + x, origin[1] + y, origin[2] + z), rotated(rotation, turn)


def inverse(a_from_b: Transform) -> Transform:
    """``b_from_a``."""
    (x, y, z), (qx, qy, qz, qw) = a_from_b
    back = (-qx, -qy, -qz, qw)
    return turned(back, (-x, -y, -z)), back


def about(axis: Vector, angle: float) -> Rotation:
    """The rotation by ``angle``, radians, about the unit vector ``axis``."""
    sine = math.sin(angle / 2)
    return (axis[0] * sine, axis[1] * sine, axis[2] * sine, math.cos(angle / 2))


def roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Rotation:
    """The URDF's ``rpy``: about the fixed axes x, y and z, in this order, radians."""
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return rotated(about(z, yaw), rotated(about(y, pitch), about(x, roll)))


def of_pose(pose) -> Transform:
    """A ``wheelarm.v1.Pose`` as a transform; what is left out is no rotation."""
    place, turn = pose.position, pose.orientation
    rotation = (turn.x, turn.y, turn.z, turn.w)
    if not any(rotation):
        rotation = IDENTITY[1]
    return (place.x, place.y, place.z), rotation


@dataclass(frozen=True)
class Joint:
    """One joint of a URDF."""

    name: str
    #: ``fixed``, ``revolute``, ``continuous`` or ``prismatic``.
    kind: str
    parent: str
    child: str
    #: Where the child is in the parent at position 0.
    origin: Transform
    #: Unit axis of growing positions in the child's frame.
    axis: Vector

    def at(self, position: float) -> Transform:
        """Where the child is in the parent at ``position``, radians or metres."""
        if self.kind == "fixed":
            return self.origin
        if self.kind == "prismatic":
            x, y, z = self.axis
            slide = (x * position, y * position, z * position)
            return chained(self.origin, (slide, IDENTITY[1]))
        return chained(self.origin, (IDENTITY[0], about(self.axis, position)))


def _numbers(text: str | None, default: Vector) -> Vector:
    if text is None:
        return default
    x, y, z = (float(word) for word in text.split())
    return x, y, z


def _joint(element: xml.Element) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    parent, child = element.find("parent"), element.find("child")
    if parent is None or child is None:
        raise ValueError(f"joint {name!r} of the URDF has no parent or no child")
    if kind not in ("fixed", "revolute", "continuous", "prismatic"):
        raise ValueError(f"joint {name!r} of the URDF is of the type {kind!r}, which is not known")
    origin, axis = element.find("origin"), element.find("axis")
    place = turn = None
    if origin is not None:
        place, turn = origin.get("xyz"), origin.get("rpy")
    x, y, z = _numbers(axis.get("xyz") if axis is not None else None, (1.0, 0.0, 0.0))
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        raise ValueError(f"joint {name!r} of the URDF has an axis of length 0")
    return Joint(
        name=name,
        kind=kind,
        parent=parent.get("link", ""),
        child=child.get("link", ""),
        origin=(
            _numbers(place, (0.0, 0.0, 0.0)),
            roll_pitch_yaw(*_numbers(turn, (0.0, 0.0, 0.0))),
        ),
        axis=(x / length, y / length, z / length),
    )


def joints(urdf: str) -> list[Joint]:
    """The joints of a URDF text, in its order.

    Raises ``ValueError`` when it cannot be read, naming the joint.
    """
    try:
        root = xml.fromstring(urdf)
    except xml.ParseError as problem:
        raise ValueError(f"the URDF cannot be read: {problem}") from problem
    return [_joint(element) for element in root.findall("joint")]


def moving(tree: list[Joint], positions: Mapping[str, float]) -> list[tuple[Joint, Transform]]:
    """Joints of ``positions`` (name to radians or metres) and where they are; fixed
    joints are not among them."""
    return [
        (joint, joint.at(positions[joint.name]))
        for joint in tree
        if joint.kind != "fixed" and joint.name in positions
    ]


def with_mesh_folder(urdf: str, folder: str) -> str:
    """The URDF with ``folder`` (a URI that ends in ``/``) before each relative path
    of a mesh, as RViz needs it."""
    if not folder:
        return urdf
    root = xml.fromstring(urdf)
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        if name and "://" not in name:
            mesh.set("filename", folder.rstrip("/") + "/" + name)
    return xml.tostring(root, encoding="unicode")
