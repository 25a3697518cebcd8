"""Environments of WheelArm for LeRobot.

    lerobot-eval --policy.path=DIR --env.type=wheelarm --env.task=pick_mustard

LeRobot imports this module because of its distribution's name (from 0.6 on; before, by
way of ``lerobot_robot_wheelarm``).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig

import wheelarm
from wheelarm.env import WheelArmEnv
from wheelarm.rows import STATE

ACTION = "action"
#: Numbers of an action, by control mode.
ACTIONS = {"row": 12, "joint_pos": 9, "applied": 9, "ee_pose": 10, "ee_delta": 9}


def task_name(text: str) -> str:
    """A task by its name or by its environment's: ``PickMustard-v0`` is ``pick_mustard``.

    Raises:
        ValueError: with the tasks that ship.
    """
    for task in wheelarm.TASKS:
        if text in (task, wheelarm.env_id(task), wheelarm.env_id(task).split("/")[1]):
            return task
    if text.islower():
        return text  # one of the user's own; the server knows
    raise ValueError(f"there is no task {text!r}; choose of {', '.join(wheelarm.TASKS)}")


@EnvConfig.register_subclass("wheelarm")
@dataclass
class WheelArmEnvConfig(EnvConfig):  # type: ignore[misc]
    """Configuration of an environment; every field is an option ``--env.NAME``."""

    #: Task, or several with commas between them (LeRobot 0.6).
    task: str | None = "pick_mustard"
    #: Steps per simulated second; must divide 60.
    fps: int = 10
    #: Steps until an episode is over; the task's own time where 0.
    episode_length: int = 0
    #: `pixels` or `state`: the row of state alone, without pictures.
    obs_mode: str = "pixels"
    #: What the policy's action is; see `wheelarm.WheelArmEnv`.
    control_mode: str = "row"
    #: Cameras, with commas between them.
    cameras: str = "gen3,wheelchair"
    observation_width: int = 320
    observation_height: int = 180
    #: Camera of the videos.
    render_camera: str = "wheelchair"
    render_mode: str = "rgb_array"
    #: Where the robot starts: `near` or `anywhere`.
    starts: str = "near"
    #: Graphics adapter by a part of its name; the server's choice where empty.
    adapter: str = ""
    features: dict[str, PolicyFeature] = field(default_factory=dict)
    features_map: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.control_mode not in ACTIONS:
            raise ValueError(
                f"control_mode={self.control_mode!r} is no row of numbers; choose of {list(ACTIONS)}"
            )
        for task in self.tasks:
            task_name(task)
        told = {
            ACTION: (FeatureType.ACTION, (ACTIONS[self.control_mode],), ACTION),
            "agent_pos": (FeatureType.STATE, (STATE,), "observation.state"),
        }
        if self.obs_mode != "state":
            size = (self.observation_height, self.observation_width, 3)
            for name in self.camera_names:
                told[f"pixels/{name}"] = (FeatureType.VISUAL, size, f"observation.images.{name}")
        for key, (kind, shape, name) in told.items():
            self.features.setdefault(key, PolicyFeature(type=kind, shape=shape))
            self.features_map.setdefault(key, name)

    @property
    def tasks(self) -> list[str]:
        """The tasks."""
        return [task.strip() for task in (self.task or "").split(",") if task.strip()]

    @property
    def camera_names(self) -> list[str]:
        """The cameras."""
        return [name.strip() for name in self.cameras.split(",") if name.strip()]

    @property
    def package_name(self) -> str:
        """Module that registers the environments."""
        return "lerobot_env_wheelarm"

    @property
    def gym_id(self) -> str:
        """Id of the environment that LeRobot 0.4 and 0.5 make by themselves."""
        if len(self.tasks) != 1:
            raise ValueError("several tasks at a time need LeRobot 0.6 or newer")
        return "wheelarm/LeRobot-v0"

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of the environment."""
        return self.arguments(self.tasks[0])

    def arguments(self, task: str) -> dict[str, Any]:
        """Arguments of `WheelArmEnv` for one task."""
        scenario: dict[str, Any] = {"starts": self.starts}
        if self.episode_length:
            scenario["time_limit_seconds"] = self.episode_length / self.fps
        size = (self.observation_width, self.observation_height)
        return {
            "task": task_name(task),
            "obs_mode": self.obs_mode,
            "control_mode": self.control_mode,
            "control_rate": self.fps,
            "cameras": {name: size for name in self.camera_names},
            "render_mode": self.render_mode or None,
            "render_camera": self.render_camera,
            "render_size": size,
            "scenario": scenario,
            "server": {"adapter": self.adapter} if self.adapter else {},
            # The same episodes as `wheelarm evaluate --seeds` has.
            "scenario_seeds": True,
        }

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, Any]:
        """Environments by suite and task (LeRobot 0.6): several servers side by side in this
        process, with or without `use_async_envs`."""
        suites: dict[str, dict[int, Any]] = {}
        for task in self.tasks:
            envs = wheelarm.WheelArmVectorEnv(
                n_envs, autoreset_mode="SameStep", **self.arguments(task)
            )
            suites.setdefault("wheelarm", {})[len(suites.get("wheelarm", {}))] = envs
        return suites


def _one(**arguments: Any) -> WheelArmEnv:
    return WheelArmEnv(**arguments)


if "wheelarm/LeRobot-v0" not in gymnasium.registry:
    # Bare: LeRobot 0.4 looks for the sentence of the task on the outermost environment.
    gymnasium.register(
        id="wheelarm/LeRobot-v0",
        entry_point="lerobot_env_wheelarm:_one",
        order_enforce=False,
        disable_env_checker=True,
    )
