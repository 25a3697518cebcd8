"""The robot: rows of action in, rows of state and images out, in lock-step."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from lerobot.robots.robot import Robot

from wheelarm.env import WheelArmEnv
from wheelarm.rows import state_names

from .config_wheelarm import WheelArmRobotConfig


class WheelArmRobot(Robot):  # type: ignore[misc]
    """A WheelArm robot. Time waits for `send_action`, which executes a row for 1 / `fps` of a
    simulated second. So the rows of a data set have exactly this distance on every host.
    Observations and actions have the names of exported sets."""

    config_class = WheelArmRobotConfig
    name = "wheelarm"

    def __init__(self, config: WheelArmRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        names = [name.strip() for name in config.camera_names.split(",") if name.strip()]
        #: Width and height by camera; LeRobot counts the entries for its image writers.
        self.cameras = {name: (config.width, config.height) for name in names}
        self._env = WheelArmEnv(
            config.task,
            obs_mode="pixels" if names else "state",
            control_mode=config.control_mode,
            control_rate=config.fps,
            cameras=self.cameras,
            scenario={"starts": config.starts},
            server={"adapter": config.adapter} if config.adapter else {},
            endpoint=config.endpoint or None,
            sim=config.sim,
        )
        if config.control_mode not in ("row", "joint_pos", "applied"):
            raise ValueError(
                f"invalid control_mode={config.control_mode!r}: choose row, joint_pos or applied"
            )
        self._observation: dict[str, Any] | None = None

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        """27 numbers by name, and the shape (height, width, 3) of every camera's images."""
        numbers: dict[str, Any] = dict.fromkeys(state_names(), float)
        size = (self.config.height, self.config.width, 3)
        return {**numbers, **dict.fromkeys(self.cameras, size)}

    @cached_property
    def action_features(self) -> dict[str, Any]:
        """The numbers of a row by name."""
        return dict.fromkeys(self._env.action_names, float)

    @property
    def is_connected(self) -> bool:
        """Whether an episode runs."""
        return self._observation is not None

    @property
    def is_calibrated(self) -> bool:
        """Always true: the robot needs no calibration."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Sets up the scenario and starts an episode."""
        self.reset(self.config.seed)

    def reset(self, seed: int) -> None:
        """Starts another episode of the task."""
        self._observation, _ = self._env.reset(options={"scenario_seed": seed})

    def calibrate(self) -> None:
        """Does nothing."""

    def configure(self) -> None:
        """Does nothing."""

    def get_observation(self) -> dict[str, Any]:
        """State and images at the present tick."""
        observation = self._require_observation()
        numbers = zip(self._env.state_names, observation["agent_pos"].tolist(), strict=True)
        return {**dict(numbers), **observation.get("pixels", {})}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Executes a row; returns it with the values that were clipped to the robot's limits."""
        self._require_observation()
        row = np.array([float(action[name]) for name in self._env.action_names])
        command = self._env.command(row)
        self._observation, _, terminated, _, info = self._env.step(row)
        if terminated and info["failure"] in ("physics", "ended"):
            raise RuntimeError(f"the episode has ended: {info['failure']}")
        sent = dict(zip(self._env.action_names, row.tolist(), strict=True))
        clipped = {
            "knuckle.target": command.gripper.knuckle,
            "chair.linear": command.base.linear,
            "chair.angular": command.base.angular,
        }
        return {**sent, **{name: value for name, value in clipped.items() if name in sent}}

    def disconnect(self) -> None:
        """Ends the episode, and the server if it belongs to this robot."""
        self._observation = None
        self._env.close()

    def _require_observation(self) -> dict[str, Any]:
        if self._observation is None:
            raise ConnectionError("the robot is not connected: call connect() first")
        return self._observation
