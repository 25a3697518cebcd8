"""Tree of the robot's frames, from the joints of its URDF.

A transform is ``((x, y, z), (qx, qy, qz, qw))``: the pose of the child in its parent,
metres and a unit quaternion. This module does not import ROS.
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


def rotate(rotation: Rotation, vector: Vector) -> Vector:
    """Rotates ``vector`` by ``rotation``."""
    qx, qy, qz, qw = rotation
    x, y, z = vector
    tx, ty, tz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return (
        x + qw * tx + qy * tz - qz * ty,
        y + qw * ty + qz * tx - qx * tz,
        z + qw * tz + qx * ty - qy * tx,
    )


def multiply(first: Rotation, second: Rotation) -> Rotation:
    """The product ``first * second``."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def compose(a_from_b: Transform, b_from_c: Transform) -> Transform:
    """Composes two transforms to ``a_from_c``."""
    (origin, rotation), (inner, turn) = a_from_b, b_from_c
    x, y, z = rotate(rotation, inner)
    return (origin[0] + x, origin[1] + y, origin[2] + z), multiply(rotation, turn)


def invert(a_from_b: Transform) -> Transform:
    """Inverts a transform to ``b_from_a``."""
    (x, y, z), (qx, qy, qz, qw) = a_from_b
    back = (-qx, -qy, -qz, qw)
    return rotate(back, (-x, -y, -z)), back


def axis_rotation(axis: Vector, angle: float) -> Rotation:
    """The rotation by ``angle``, radians, about the unit vector ``axis``."""
    sine = math.sin(angle / 2)
    return (axis[0] * sine, axis[1] * sine, axis[2] * sine, math.cos(angle / 2))


def roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Rotation:
    """The rotation of a URDF's ``rpy``: about the fixed axes x, y and z in this order,
    radians."""
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return multiply(
        axis_rotation(z, yaw), multiply(axis_rotation(y, pitch), axis_rotation(x, roll))
    )


def from_pose(pose) -> Transform:
    """A ``wheelarm.v1.Pose`` as a transform; an absent rotation is the identity."""
    position, orientation = pose.position, pose.orientation
    rotation = (orientation.x, orientation.y, orientation.z, orientation.w)
    if not any(rotation):
        rotation = IDENTITY[1]
    return (position.x, position.y, position.z), rotation


@dataclass(frozen=True)
class Joint:
    """One joint of a URDF."""

    name: str
    #: ``fixed``, ``revolute``, ``continuous`` or ``prismatic``.
    kind: str
    parent: str
    child: str
    #: Pose of the child in the parent at position 0.
    origin: Transform
    #: Unit axis of increasing positions in the child's frame.
    axis: Vector

    def transform_at(self, position: float) -> Transform:
        """Pose of the child in the parent at ``position``, radians or metres."""
        if self.kind == "fixed":
            return self.origin
        if self.kind == "prismatic":
            x, y, z = self.axis
            slide = (x * position, y * position, z * position)
            return compose(self.origin, (slide, IDENTITY[1]))
        return compose(self.origin, (IDENTITY[0], axis_rotation(self.axis, position)))


def _numbers(text: str | None, default: Vector) -> Vector:
    if text is None:
        return default
    x, y, z = (float(word) for word in text.split())
    return x, y, z


def _joint(element: xml.Element) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    parent, child = element.find("parent"), element.find("child")
    if parent is None or child is None:
        raise ValueError(f"joint {name!r} of the URDF lacks its parent or child")
    if kind not in ("fixed", "revolute", "continuous", "prismatic"):
        raise ValueError(
            f"joint {name!r} of the URDF has the unknown type {kind!r}; available: fixed, "
            "revolute, continuous, prismatic"
        )
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

    Raises ``ValueError`` with the name of the joint when it cannot be read.
    """
    try:
        root = xml.fromstring(urdf)
    except xml.ParseError as error:
        raise ValueError(f"the URDF cannot be read: {error}") from error
    return [_joint(element) for element in root.findall("joint")]


def moving_transforms(
    tree: list[Joint],
    positions: Mapping[str, float],
    base: str = "",
    in_base: Mapping[str, Transform] | None = None,
) -> list[tuple[Joint, Transform]]:
    """Movable joints of ``positions`` (name to radians or metres), and the poses of their
    children in their parents.

    ``in_base`` has the known poses of links in the link ``base``. The transform of the joint
    above such a link is chosen so that the chain from ``base`` gives this pose. Joint
    positions alone have an error of about 1e-6 m, because the joints of the physics are
    compliant.
    """
    carried = _known_children(tree, in_base or {})
    places: dict[str, Transform] = {base: IDENTITY}
    found = []
    for joint in _ordered_from(tree, base):
        place = joint.transform_at(positions.get(joint.name, 0.0))
        parent = places.get(joint.parent)
        if parent is not None:
            child = carried.get(joint.name)
            if child is not None:
                place = compose(invert(parent), child)
            places[joint.child] = compose(parent, place)
        if joint.kind != "fixed" and joint.name in positions:
            found.append((joint, place))
    return found


def _known_children(tree: list[Joint], in_base: Mapping[str, Transform]) -> dict[str, Transform]:
    """By moving joint: the pose of its child, from a link rigidly attached to it."""
    above = {joint.child: joint for joint in tree}
    found = {}
    for link, place in in_base.items():
        joint, inner = above.get(link), IDENTITY
        while joint is not None and joint.kind == "fixed":
            inner, joint = compose(joint.origin, inner), above.get(joint.parent)
        if joint is not None:
            found[joint.name] = compose(place, invert(inner))
    return found


def _ordered_from(tree: list[Joint], base: str) -> list[Joint]:
    """The joints, with those below ``base`` last and in order of their distance from it."""
    below: dict[str, list[Joint]] = {}
    for joint in tree:
        below.setdefault(joint.parent, []).append(joint)
    ordered, links = [], [base]
    while links:
        for joint in below.get(links.pop(), []):
            ordered.append(joint)
            links.append(joint.child)
    inside = {joint.name for joint in ordered}
    return [joint for joint in tree if joint.name not in inside] + ordered


def with_mesh_folder(urdf: str, folder: str) -> str:
    """The URDF with ``folder``, a URI, before each relative path of a mesh, as required by
    RViz."""
    if not folder:
        return urdf
    root = xml.fromstring(urdf)
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        if name and "://" not in name:
            mesh.set("filename", folder.rstrip("/") + "/" + name)
    return xml.tostring(root, encoding="unicode")
