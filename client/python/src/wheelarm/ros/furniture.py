"""Furniture on joints: names and frames, from the URDF of the scene.

This module does not import ROS.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from . import tree


@dataclass(frozen=True)
class Furniture:
    """The furniture of a scene; an older server describes none."""

    #: Joints in the order of ``FurnitureJoints``; the URDF has the same names.
    joints: tuple[str, ...] = ()
    #: Joints of the URDF.
    tree: list[tree.Joint] = field(default_factory=list, repr=False)
    urdf: str = field(default="", repr=False)

    @staticmethod
    def from_scene(scene) -> Furniture:
        """Reads a ``wheelarm.v1.SceneReply``.

        Raises ``ValueError`` when its URDF cannot be read.
        """
        urdf = scene.furniture_urdf
        return Furniture(
            joints=tuple(joint.name for joint in scene.joints),
            tree=tree.joints(urdf) if urdf else [],
            urdf=urdf,
        )
