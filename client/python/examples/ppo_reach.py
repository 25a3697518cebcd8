#!/usr/bin/env python3
"""Learns to drive up to an object and to bring the hand to it, with PPO of Stable-Baselines3.

    pip install stable-baselines3
    python ppo_reach.py --seconds 540 --out reach.zip      # trains, then evaluates
    python ppo_reach.py --evaluate reach.zip

A small task that two cores learn in ten minutes: chair and hand move, the fingers and the
rotation of the hand do not. An episode succeeds when the point between the fingers is within
0.10 m of a grasp of the object, and fails after 15 s.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import SubprocVecEnv, VecMonitor

import wheelarm

#: Dense reward at a distance of 0.10 m: 0.3 * (exp(-0.1 / 2) + exp(-0.1 / 0.1)) / 2.
NEAR = 0.1978
#: Steps of 0.1 s.
LIMIT = 150
#: Scale of the change of the dense reward: a whole way is worth about 1.
SCALE = 6.0


def rotate(quaternion: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """A vector turned by a unit quaternion x y z w."""
    t = 2.0 * np.cross(quaternion[:3], v)
    return v + quaternion[3] * t + np.cross(quaternion[:3], t)


class Reach(gymnasium.Wrapper[NDArray[np.float32], NDArray[np.float32], Any, Any]):
    """Observation (11,): the way from the point between the fingers to the object and the
    position of the hand, both in `base_link`, the object ahead and to the left of the chair, the
    joint that turns the arm, the speeds of the chair. Action (5,) in [-1, 1]: the hand along x, y,
    z of `base_link`, the chair forward and to the left."""

    def __init__(self, task: str = "pick_mustard") -> None:
        env = gymnasium.make(
            wheelarm.env_id(task), obs_mode="state", control_mode="ee_delta", reward_mode="dense"
        )
        super().__init__(env)
        self.observation_space = spaces.Box(-10.0, 10.0, (11,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (5,), np.float32)
        names = self.unwrapped.privileged_names
        pose = ("x", "y", "z", "qx", "qy", "qz", "qw")
        self._chair = [names.index(f"chair.{part}") for part in (*pose, "vx", "vy", "wz")]
        self._target = [names.index(f"target.{axis}") for axis in "xyz"]

    def _observe(self, observation: dict[str, Any]) -> NDArray[np.float32]:
        chair = observation["privileged_state"][self._chair]
        target = observation["privileged_state"][self._target]
        # The object in the frame of the chair, then in that of the arm.
        back = np.array([-1.0, -1.0, -1.0, 1.0])
        here = rotate(chair[3:7] * back, target - chair[:3])
        arm = rotate(self._mount[3:] * back, here - self._mount[:3])
        hand = observation["agent_pos"][14:17]
        # The z axis of the hand from the first two columns of its rotation.
        approach = np.cross(observation["agent_pos"][17:20], observation["agent_pos"][20:23])
        way = arm - (hand + self._tool * approach)
        speed = float(rotate(chair[3:7] * back, np.array([*chair[7:9], 0.0]))[0])
        row = [*way, *hand, *here[:2], observation["agent_pos"][0], speed, chair[9]]
        return np.array(row, np.float32)

    def reset(self, **more: Any) -> tuple[NDArray[np.float32], dict[str, Any]]:
        observation, info = self.env.reset(**more)
        robot = self.unwrapped.client.scene().robot
        self._mount, self._tool = wheelarm.pose(robot.arm_mount), robot.tool_length
        self._steps, self._last = 0, None
        return self._observe(observation), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        whole = np.zeros(9, np.float32)
        whole[:3], whole[7:] = action[:3], action[3:]
        observation, dense, terminated, truncated, info = self.env.step(whole)
        self._steps += 1
        change = 0.0 if self._last is None else dense - self._last
        self._last = dense
        success = dense >= NEAR
        info["is_success"] = success
        # Terminated without success: an object fell, or the person or furniture was hit.
        bonus = 1.0 if success else -1.0 if terminated else 0.0
        reward = SCALE * change + bonus - 0.003
        late = truncated or self._steps >= LIMIT
        return self._observe(observation), reward, success or terminated, late, info


class Clock(BaseCallback):
    """Stops after some seconds and prints the success of the last hundred episodes."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._end, self._start = time.monotonic() + seconds, time.monotonic()
        self._done: list[bool] = []
        self._printed = 0.0

    def _on_step(self) -> bool:
        for info, over in zip(self.locals["infos"], self.locals["dones"], strict=True):
            if over:
                self._done.append(bool(info["is_success"]))
        now = time.monotonic()
        if now - self._printed > 30.0:
            self._printed = now
            last = self._done[-100:]
            share = sum(last) / len(last) if last else 0.0
            print(
                f"{now - self._start:4.0f} s  {self.num_timesteps:7d} steps  "
                f"{len(self._done):5d} episodes  success of the last 100: {share:.2f}",
                flush=True,
            )
        return now < self._end


def train(seconds: float, servers: int, seed: int) -> PPO:
    envs = VecMonitor(SubprocVecEnv([Reach] * servers, start_method="spawn"))
    envs.seed(seed)
    model = PPO(
        "MlpPolicy",
        envs,
        n_steps=1024 // servers,
        batch_size=256,
        n_epochs=10,
        learning_rate=5e-4,
        gamma=0.98,
        gae_lambda=0.95,
        ent_coef=0.0,
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -1.0},
        seed=seed,
        device="cpu",
    )
    model.learn(10**9, callback=Clock(seconds))
    envs.close()
    return model


def evaluate(model: PPO, episodes: int) -> float:
    """Share of successes on seeds that the training did not use."""
    env, count = Reach(), 0
    for seed in range(500, 500 + episodes):
        observation, _ = env.reset(options={"scenario_seed": seed})
        over = False
        while not over:
            action, _ = model.predict(observation, deterministic=True)
            observation, _, terminated, truncated, info = env.step(action)
            over = terminated or truncated
        count += bool(info["is_success"])
    env.close()
    print(f"{count} of {episodes} on seeds 500 to {499 + episodes}")
    return count / episodes


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n", maxsplit=1)[0])
    parser.add_argument("--seconds", type=float, default=540.0, help="wall time of the training")
    parser.add_argument("--servers", type=int, default=2, help="simulations at the same time")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=50, help="episodes of the evaluation")
    parser.add_argument("--out", default="reach.zip", help="file of the policy")
    parser.add_argument("--evaluate", metavar="FILE", help="evaluates a policy without training")
    args = parser.parse_args()
    if args.evaluate:
        evaluate(PPO.load(args.evaluate, device="cpu"), args.episodes)
        return
    model = train(args.seconds, args.servers, args.seed)
    model.save(args.out)
    evaluate(model, args.episodes)


if __name__ == "__main__":
    main()
