"""Configuration of the robot; every field is an option ``--robot.NAME``."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.robots.config import RobotConfig
from wheelarm.env import CAMERAS


@RobotConfig.register_subclass("wheelarm")
@dataclass(kw_only=True)
class WheelArmRobotConfig(RobotConfig):  # type: ignore[misc]
    """Server, task and images."""

    #: Endpoint of a running server, for example `tcp/127.0.0.1:7447`; empty to start a server
    #: for this robot.
    endpoint: str = ""
    #: Name of that server.
    sim: str = "sim"
    #: Task and seed of the scenario.
    task: str = "pick_mustard"
    seed: int = 0
    #: Start of the robot: `near` or `anywhere`.
    starts: str = "near"
    #: Cameras, separated by commas, and the size of their images, pixels.
    camera_names: str = ",".join(CAMERAS)
    width: int = 320
    height: int = 180
    #: Kind of an action: `row` (pose of the hand), `joint_pos` or `applied`, as in exports.
    control_mode: str = "row"
    #: Rows per simulated second, equal to `--dataset.fps`; must divide 60.
    fps: int = 10
    #: Graphics adapter by a part of its name; empty for the server's choice.
    adapter: str = ""
