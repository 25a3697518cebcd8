"""Entities of the home, for ``simulation_interfaces``.

Entities are the robot, the objects and the movable furniture. Fixed furniture allows no
interaction and is excluded. This module does not import ROS.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

from .. import v1
from .robot import Robot
from .tree import IDENTITY, Transform, Vector, compose, from_pose, invert, rotate

#: Categories of ``simulation_interfaces/EntityCategory``.
ROBOT, OBJECT = 1, 4


@dataclass(frozen=True)
class State:
    """Pose and velocity of an entity in the world."""

    pose: Transform
    #: Linear velocity, m/s.
    linear: Vector = (0.0, 0.0, 0.0)
    #: Angular velocity, rad/s.
    angular: Vector = (0.0, 0.0, 0.0)
    #: Simulation time, nanoseconds.
    stamp_nanos: int = 0


@dataclass
class Entities:
    """The entities of a scene and their newest states."""

    robot: Robot
    objects: tuple[str, ...]
    #: Movable furniture: body, pose at position 0, axis in the world, whether it slides.
    furniture: tuple[tuple[str, Transform, Vector, bool], ...]
    #: Boxes around each entity in its own frame: centre and half extents, metres.
    boxes: dict[str, list[tuple[Transform, Vector]]]
    states: dict[str, State] = field(default_factory=dict)

    @staticmethod
    def from_scene(scene, robot: Robot) -> Entities:
        """Creates the entities of a ``wheelarm.v1.SceneReply``."""
        furniture = tuple(
            (
                joint.body,
                from_pose(joint.rest),
                (joint.axis.x, joint.axis.y, joint.axis.z),
                joint.type == v1.JOINT_TYPE_PRISMATIC,
            )
            for joint in scene.joints
        )
        names = {*scene.objects, *(body for body, *_ in furniture)}
        boxes = {
            body.name: [
                (from_pose(box.pose), (box.half.x, box.half.y, box.half.z)) for box in body.boxes
            ]
            for body in scene.bodies
            if body.name in names
        }
        # Outlines of the robot from bottom to top, with its arm at home.
        bottom, outlines = 0.0, []
        for outline in scene.robot.outlines:
            area, top = outline.footprint, outline.top
            centre = (
                (area.x_min + area.x_max) / 2,
                (area.y_min + area.y_max) / 2,
                (bottom + top) / 2,
            )
            half = (
                (area.x_max - area.x_min) / 2,
                (area.y_max - area.y_min) / 2,
                (top - bottom) / 2,
            )
            outlines.append(((centre, IDENTITY[1]), half))
            bottom = top
        boxes[robot.name] = outlines
        return Entities(robot, tuple(scene.objects), furniture, boxes)

    @property
    def names(self) -> list[str]:
        """Names of the entities: the robot, the objects, then the furniture."""
        return [self.robot.name, *self.objects, *(body for body, *_ in self.furniture)]

    def category(self, name: str) -> int:
        """Category of an entity in ``simulation_interfaces/EntityCategory``."""
        return ROBOT if name == self.robot.name else OBJECT

    def poses(self, sample) -> None:
        """Stores the chair's pose in the world from a ``wheelarm.v1.PoseSet``."""
        for (_, parent, link), frame in zip(self.robot.frames, sample.frames, strict=False):
            if parent == self.robot.world and link == self.robot.root:
                self.states[self.robot.name] = _state(frame.pose, frame.twist, sample)

    def object_poses(self, sample) -> None:
        """Stores the poses of a ``wheelarm.v1.ObjectPoses``."""
        for name, pose, twist in zip(self.objects, sample.poses, sample.twists, strict=False):
            self.states[name] = _state(pose, twist, sample)

    def furniture_joints(self, sample) -> None:
        """Stores the joint positions of a ``wheelarm.v1.FurnitureJoints``."""
        moved = zip(self.furniture, sample.positions, sample.velocities, strict=False)
        for (body, rest, axis, slides), position, speed in moved:
            along = tuple(position * part for part in axis)
            velocity = tuple(speed * part for part in axis)
            stamp = sample.header.stamp_nanos
            if slides:
                (x, y, z), rotation = rest
                pose = ((x + along[0], y + along[1], z + along[2]), rotation)
                self.states[body] = State(pose, linear=velocity, stamp_nanos=stamp)
            else:
                half = math.sin(position / 2)
                turn = (*(half * part for part in axis), math.cos(position / 2))
                place, rotation = rest
                pose = (place, compose(((0.0, 0.0, 0.0), turn), ((0.0, 0.0, 0.0), rotation))[1])
                self.states[body] = State(pose, angular=velocity, stamp_nanos=stamp)

    def matching(
        self,
        pattern: str = "",
        categories: list[int] | None = None,
        sphere: tuple[Vector, float] | None = None,
    ) -> list[str]:
        """Entities whose name matches the regular expression ``pattern``, whose category is in
        ``categories``, and whose boxes overlap the ``sphere`` (centre, radius, m).

        Raises ``ValueError`` when the expression is invalid.
        """
        try:
            search = re.compile(pattern).search
        except re.error as error:
            raise ValueError(
                f"the filter {pattern!r} is not a regular expression: {error}"
            ) from error
        found = [name for name in self.names if search(name)]
        if categories:
            found = [name for name in found if self.category(name) in categories]
        if sphere is not None:
            found = [name for name in found if self._overlaps(name, *sphere)]
        return found

    def _overlaps(self, name: str, centre: Vector, radius: float) -> bool:
        state = self.states.get(name)
        if state is None:
            return False
        for box, half in self.boxes.get(name, []):
            place, rotation = invert(compose(state.pose, box))
            turned_centre = rotate(rotation, centre)
            inside = tuple(a + b for a, b in zip(place, turned_centre, strict=False))
            beyond = [
                max(0.0, abs(part) - reach) for part, reach in zip(inside, half, strict=False)
            ]
            if math.hypot(*beyond) <= radius:
                return True
        return False


def _state(pose, twist, sample) -> State:
    linear, angular = twist.linear, twist.angular
    return State(
        from_pose(pose),
        (linear.x, linear.y, linear.z),
        (angular.x, angular.y, angular.z),
        sample.header.stamp_nanos,
    )
