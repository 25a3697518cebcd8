"""The robot: rows in, rows and pictures out, in lock-step."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from lerobot.robots.robot import Robot

from wheelarm.env import WheelArmEnv
from wheelarm.rows import state_names

from .config_wheelarm import WheelArmRobotConfig


class WheelArmRobot(Robot):  # type: ignore[misc]
    """A WheelArm robot. Time waits for `send_action`, which carries a row out for 1 / `fps`
    of a simulated second: rows of a data set are exactly that far apart, however fast the
    host is. Observations and actions have the names of exported sets."""

    config_class = WheelArmRobotConfig
    name = "wheelarm"

    def __init__(self, config: WheelArmRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        names = [name.strip() for name in config.camera_names.split(",") if name.strip()]
        #: LeRobot counts them for its image writers.
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
                f"control_mode={config.control_mode!r} is no row; choose row, joint_pos or applied"
            )
        self._seen: dict[str, Any] | None = None

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        """27 numbers by name, and (height, width, 3) of every camera."""
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
        return self._seen is not None

    @property
    def is_calibrated(self) -> bool:
        """Always: there is nothing to calibrate."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Sets the scenario up and begins an episode."""
        self.reset(self.config.seed)

    def reset(self, seed: int) -> None:
        """Begins another episode of the task."""
        self._seen, _ = self._env.reset(options={"scenario_seed": seed})

    def calibrate(self) -> None:
        """Nothing."""

    def configure(self) -> None:
        """Nothing."""

    def get_observation(self) -> dict[str, Any]:
        """What is known at the present tick."""
        seen = self._present()
        numbers = zip(self._env.state_names, seen["agent_pos"].tolist(), strict=True)
        return {**dict(numbers), **seen.get("pixels", {})}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Carries a row out; returns it with what was cut to the robot's limits."""
        self._present()
        row = np.array([float(action[name]) for name in self._env.action_names])
        command = self._env.command(row)
        self._seen, _, terminated, _, info = self._env.step(row)
        if terminated and info["failure"] in ("physics", "ended"):
            raise RuntimeError(f"the episode has ended: {info['failure']}")
        sent = dict(zip(self._env.action_names, row.tolist(), strict=True))
        cut = {
            "knuckle.target": command.gripper.knuckle,
            "chair.linear": command.base.linear,
            "chair.angular": command.base.angular,
        }
        return {**sent, **{name: value for name, value in cut.items() if name in sent}}

    def disconnect(self) -> None:
        """Ends the episode, and the server where it is its own."""
        self._seen = None
        self._env.close()

    def _present(self) -> dict[str, Any]:
        if self._seen is None:
            raise ConnectionError("the robot is not connected: call connect() first")
        return self._seen
