"""The dense reward: pure laws without a server, and a short way towards an object."""

from __future__ import annotations

import numpy as np
import pytest

import wheelarm
from wheelarm import v1
from wheelarm._reward import GOAL, HOLD, REACH, DenseReward, chain, nearness, rotate

gymnasium = pytest.importorskip("gymnasium", minversion="1.1")

IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
LEFT = np.array([0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)])


def at(x, y, z):
    return np.array([x, y, z, 0.0, 0.0, 0.0, 1.0])


def scene(kind, **goal):
    out = v1.SceneReply(target="cup", goal=v1.TaskGoal(kind=kind, target="cup", **goal))
    out.robot.arm_mount.orientation.w = 1.0
    out.robot.tool_length = 0.1
    grasp = out.grasps.add(object="cup")
    grasp.pose.position.x = 0.02
    grasp.pose.orientation.w = 1.0
    return out


def test_poses_chain_and_rotate():
    assert np.allclose(rotate(LEFT, np.array([1.0, 0.0, 0.0])), [0.0, 1.0, 0.0])
    moved = chain(np.array([1.0, 2.0, 0.0, *LEFT]), at(1.0, 0.0, 0.5))
    assert np.allclose(moved, [1.0, 3.0, 0.5, *LEFT])


def test_reward_grows_on_the_way_and_needs_a_hold_for_progress():
    reward = DenseReward(scene(v1.GOAL_KIND_LIFT), at(2.0, 0.0, 0.5))

    def value(x, z=0.4, height=0.5, pads=(0.0, 0.0)):
        return reward.value(IDENTITY, at(x, 0.0, z), at(2.0, 0.0, height), pads, [])

    ways = [value(x) for x in (0.0, 0.5, 1.0, 1.5, 1.9, 2.0, 2.02)]
    assert ways == sorted(ways) and len(set(ways)) == len(ways)
    # The grasp is 0.02 m from the middle of the cup, the hand 0.1 m behind its point.
    assert np.isclose(value(2.02), REACH)
    assert np.isclose(value(2.02, pads=(5.0, 5.0)), REACH + HOLD)
    assert np.isclose(value(2.02, pads=(5.0, 0.0)), REACH)
    lifted = value(2.02, z=0.45, height=0.55, pads=(5.0, 5.0))
    assert np.isclose(lifted, REACH + HOLD + 0.5 * GOAL)
    # A cup that a knock throws up does not count.
    assert value(2.02, z=0.45, height=0.55) < REACH + 1e-9
    assert REACH + HOLD + GOAL < 1.0


def test_reward_of_a_drawer_is_its_way_in_both_directions():
    for kind, begun, wanted in ((v1.GOAL_KIND_OPEN, 0.1, 0.3), (v1.GOAL_KIND_CLOSE, 0.3, 0.0)):
        one = scene(kind, joint="drawer_joint", position=wanted)
        one.joints.add(name="other_joint")
        one.joints.add(name="drawer_joint", body="cup")
        reward = DenseReward(one, at(5.0, 0.0, 0.5))
        far = [
            reward.value(IDENTITY, IDENTITY, at(5.0, 0.0, 0.5), (0.0, 0.0), [0.7, position])
            for position in np.linspace(begun, wanted, 5)
        ]
        assert np.allclose(np.diff(far), 0.25 * GOAL)


def test_reward_of_a_place_is_the_nearness_of_the_object():
    one = scene(v1.GOAL_KIND_PUT)
    one.goal.region.pose.position.x = 1.0
    reward = DenseReward(one, at(0.0, 0.0, 0.5))
    value = reward.value(IDENTITY, at(0.02, 0.0, 0.4), at(0.0, 0.0, 0.5), (2.0, 2.0), [])
    assert np.isclose(value, REACH + HOLD + GOAL * nearness(np.hypot(1.0, 0.5)))


def test_environment_rewards_the_way_to_the_object():
    env = gymnasium.make(
        "wheelarm:wheelarm/PickMustard-v0",
        obs_mode="state",
        control_mode="ee_delta",
        reward_mode="dense",
    )
    observation, _ = env.reset(options={"scenario_seed": 7})
    inner = env.unwrapped
    rewards = []
    for _ in range(40):
        state = observation["privileged_state"]
        names = inner.privileged_names
        dx, dy = (
            state[names.index(f"target.{axis}")] - state[names.index(f"chair.{axis}")]
            for axis in "xy"
        )
        qz, qw = (state[names.index(f"chair.{part}")] for part in ("qz", "qw"))
        turn = np.arctan2(dy, dx) - 2.0 * np.arctan2(qz, qw)
        turn = (turn + np.pi) % (2.0 * np.pi) - np.pi
        action = np.zeros(9, np.float32)
        action[7], action[8] = (0.5 if abs(turn) < 0.3 else 0.0), np.clip(turn, -1.0, 1.0)
        observation, reward, terminated, _, info = env.step(action)
        rewards.append(reward)
        assert 0.0 < reward < 0.9 and not terminated and not info["is_success"]
    assert rewards[-1] > rewards[0] + 0.02, rewards
    env.close()


def test_default_actions_are_bounded_and_sampled_inside():
    for mode in ("row", "joint_pos", "applied", "ee_pose", "ee_delta"):
        space = wheelarm.WheelArmEnv("pick_mustard", control_mode=mode).action_space
        assert np.isfinite(space.low).all() and np.isfinite(space.high).all()
        assert (space.low < space.high).all() and space.contains(space.sample())
