"""WheelArm environments for LeRobot.

    lerobot-eval --policy.path=DIR --env.type=wheelarm --env.task=pick_mustard

LeRobot 0.6 and newer import this module by the name of its distribution; older versions
import it through ``lerobot_robot_wheelarm``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig

import wheelarm
from wheelarm.env import CAMERAS, WheelArmEnv
from wheelarm.rows import STATE

ACTION = "action"
#: Size of an action, by control mode.
ACTIONS = {"row": 12, "joint_pos": 9, "applied": 9, "ee_pose": 10, "ee_delta": 9}


def task_name(text: str) -> str:
    """The name of a task, from its name or its environment's: ``PickMustard-v0`` is
    ``pick_mustard``.

    Raises:
        ValueError: for an unknown task; the message lists the tasks.
    """
    for task in wheelarm.TASKS:
        if text in (task, wheelarm.env_id(task), wheelarm.env_id(task).split("/")[1]):
            return task
    if text.islower():
        return text  # possibly a task of the user; the server checks it
    raise ValueError(f"unknown task {text!r}; available: {', '.join(wheelarm.TASKS)}")


@EnvConfig.register_subclass("wheelarm")
@dataclass
class WheelArmEnvConfig(EnvConfig):  # type: ignore[misc]
    """Configuration of an environment; every field is an option ``--env.NAME``."""

    #: Task, or several separated by commas (LeRobot 0.6).
    task: str | None = "pick_mustard"
    #: Steps per simulated second; must divide 60.
    fps: int = 10
    #: Steps of an episode; 0 for the time limit of the task.
    episode_length: int = 0
    #: `pixels`, or `state` for the row of state without images.
    obs_mode: str = "pixels"
    #: Kind of the policy's action; see `wheelarm.WheelArmEnv`.
    control_mode: str = "row"
    #: Cameras, separated by commas.
    cameras: str = ",".join(CAMERAS)
    observation_width: int = 320
    observation_height: int = 180
    #: Camera of the videos.
    render_camera: str = "wheelchair"
    render_mode: str = "rgb_array"
    #: Start of the robot: `near` or `anywhere`.
    starts: str = "near"
    #: Graphics adapter by a part of its name; empty for the server's choice.
    adapter: str = ""
    features: dict[str, PolicyFeature] = field(default_factory=dict)
    features_map: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.control_mode not in ACTIONS:
            raise ValueError(
                f"invalid control_mode={self.control_mode!r}: choose one of {list(ACTIONS)}"
            )
        for task in self.tasks:
            task_name(task)
        inputs = {
            ACTION: (FeatureType.ACTION, (ACTIONS[self.control_mode],), ACTION),
            "agent_pos": (FeatureType.STATE, (STATE,), "observation.state"),
        }
        if self.obs_mode != "state":
            size = (self.observation_height, self.observation_width, 3)
            for name in self.camera_names:
                inputs[f"pixels/{name}"] = (FeatureType.VISUAL, size, f"observation.images.{name}")
        for key, (kind, shape, name) in inputs.items():
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
        """Module that registers the environments with Gymnasium."""
        return "lerobot_env_wheelarm"

    @property
    def gym_id(self) -> str:
        """Id of the environment that LeRobot 0.4 and 0.5 create."""
        if len(self.tasks) != 1:
            raise ValueError(
                "cannot create environments of several tasks: this needs LeRobot 0.6 or newer; "
                "give one task"
            )
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
            # The same episodes as `wheelarm evaluate --seeds`.
            "scenario_seeds": True,
        }

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, Any]:
        """Environments by suite and task (LeRobot 0.6). The servers compute in parallel, with
        and without `use_async_envs`."""
        suites: dict[str, dict[int, Any]] = {}
        for task in self.tasks:
            envs = wheelarm.WheelArmVectorEnv(
                n_envs, autoreset_mode="SameStep", **self.arguments(task)
            )
            suites.setdefault("wheelarm", {})[len(suites.get("wheelarm", {}))] = envs
        return suites


def _make_env(**arguments: Any) -> WheelArmEnv:
    return WheelArmEnv(**arguments)


if "wheelarm/LeRobot-v0" not in gymnasium.registry:
    # Without wrappers: LeRobot 0.4 reads the instruction from the outermost environment.
    gymnasium.register(
        id="wheelarm/LeRobot-v0",
        entry_point="lerobot_env_wheelarm:_make_env",
        order_enforce=False,
        disable_env_checker=True,
    )
