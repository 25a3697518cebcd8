"""Dense reward: distance to the grasp, hold, and progress of the goal, from ground truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from . import v1
from .rows import multiply
from .streams import pose as pose_of
from .streams import vector

#: Parts of the reward; their sum is less than 1, the reward of a success.
REACH, HOLD, GOAL = 0.3, 0.2, 0.4
#: Height of a lift with full progress, m.
LIFT = 0.10
#: Distances at which progress falls to 1/e, m: on the way, and at the end.
FAR, CLOSE = 2.0, 0.1
#: Force of both pads that counts as a hold, N.
HOLD_FORCE = 1.0


def rotate(quaternion: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """A vector turned by a unit quaternion x y z w."""
    xyz, w = quaternion[:3], quaternion[3]
    t = 2.0 * np.cross(xyz, v)
    return v + w * t + np.cross(xyz, t)


def chain(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pose `b`, given in the frame of the pose `a`, in the frame of `a` itself, (7,)."""
    return np.concatenate([a[:3] + rotate(a[3:7], b[:3]), multiply(a[3:7], b[3:7])])


def nearness(distance: float) -> float:
    """1 at distance 0, with a slope far away and a steeper one close by."""
    return 0.5 * float(np.exp(-distance / FAR)) + 0.5 * float(np.exp(-distance / CLOSE))


class DenseReward:
    """The reward of one episode, 0 to `REACH` + `HOLD` + `GOAL` until the task succeeds.

    Args:
        scene: The scene of the episode.
        target: Pose of the target in `house` at the start, (7,).
    """

    def __init__(self, scene: v1.SceneReply, target: NDArray[np.float64]) -> None:
        self._goal, self._start = scene.goal, target[:3].copy()
        self._mount, self._tool = pose_of(scene.robot.arm_mount), float(scene.robot.tool_length)
        name = scene.goal.target or scene.target
        grasps = [pose_of(one.pose)[:3] for one in scene.grasps if one.object == name]
        #: Grasp points in the target's frame.
        self._grasps = grasps or [np.zeros(3)]
        self._joint = next(
            (i for i, one in enumerate(scene.joints) if one.name == scene.goal.joint), None
        )
        self._opened: float | None = None
        self._mouth = pose_of(scene.persons[0].mouth)[:3] if scene.persons else np.zeros(3)

    def grasp_point(
        self, chair: NDArray[np.float64], hand: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The point between the fingers in `house`, (3,), from the chair in `house` and the hand
        in `base_link`."""
        tip = hand[:3] + rotate(hand[3:7], np.array([0.0, 0.0, self._tool]))
        mount = chain(chair, self._mount)
        return mount[:3] + rotate(mount[3:7], tip)

    def value(
        self,
        chair: NDArray[np.float64],
        hand: NDArray[np.float64],
        target: NDArray[np.float64],
        pads: Sequence[float],
        joints: Sequence[float],
    ) -> float:
        """The reward of a state without success.

        Args:
            chair: Pose of the chair in `house`, (7,).
            hand: Pose of the end effector in `base_link`, (7,).
            target: Pose of the target in `house`, (7,).
            pads: Force at each pad, N.
            joints: Positions of the furniture's joints, in the order of the scene.
        """
        point = self.grasp_point(chair, hand)
        distance = min(
            float(np.linalg.norm(target[:3] + rotate(target[3:7], grasp) - point))
            for grasp in self._grasps
        )
        force = min(pads) if len(pads) == 2 else 0.0
        hold = min(force / HOLD_FORCE, 1.0) if distance < CLOSE else 0.0
        progress = self._progress(chair, target, joints)
        if self._joint is None:
            progress *= hold
        return REACH * nearness(distance) + HOLD * hold + GOAL * progress

    def _progress(
        self, chair: NDArray[np.float64], target: NDArray[np.float64], joints: Sequence[float]
    ) -> float:
        """Progress of the goal, 0 to 1."""
        kind = self._goal.kind
        if self._joint is not None:
            position = float(joints[self._joint])
            if self._opened is None:
                self._opened = position
            way = self._goal.position - self._opened
            done = (position - self._opened) / way if abs(way) > 1e-6 else 1.0
            return float(np.clip(done, 0.0, 1.0))
        if kind == v1.GOAL_KIND_PUT:
            return nearness(float(np.linalg.norm(target[:3] - self._region())))
        if kind == v1.GOAL_KIND_GIVE:
            lap = chair[:3] + rotate(chair[3:7], self._region())
            return nearness(float(np.linalg.norm(target[:3] - lap)))
        if kind == v1.GOAL_KIND_BRING:
            mouth = chair[:3] + rotate(chair[3:7], self._mouth)
            tip = target[:3] + rotate(target[3:7], vector(self._goal.tip))
            return nearness(float(np.linalg.norm(tip - mouth)))
        return float(np.clip((target[2] - self._start[2]) / LIFT, 0.0, 1.0))

    def _region(self) -> NDArray[np.float64]:
        """Middle of the goal region."""
        return vector(self._goal.region.pose.position)
