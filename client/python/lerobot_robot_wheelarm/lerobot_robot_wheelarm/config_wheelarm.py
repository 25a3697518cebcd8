"""Configuration of the robot; every field is an option ``--robot.NAME``."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.robots.config import RobotConfig


@RobotConfig.register_subclass("wheelarm")
@dataclass(kw_only=True)
class WheelArmRobotConfig(RobotConfig):  # type: ignore[misc]
    """Which server, which task, which pictures."""

    #: Endpoint of a running server, for example `tcp/127.0.0.1:7447`; a server of its own is
    #: started where empty.
    endpoint: str = ""
    #: Name of that server.
    sim: str = "sim"
    #: Task and seed of the scenario.
    task: str = "pick_mustard"
    seed: int = 0
    #: Where the robot starts: `near` or `anywhere`.
    starts: str = "near"
    #: Cameras, with commas between them, and the size of their pictures, pixels.
    camera_names: str = "gen3,wheelchair"
    width: int = 320
    height: int = 180
    #: What an action is: `row` (the hand's pose), `joint_pos` or `applied`, as in exports.
    control_mode: str = "row"
    #: Rows per simulated second; the same as `--dataset.fps`. Must divide 60.
    fps: int = 10
    #: Graphics adapter by a part of its name; the server's choice where empty.
    adapter: str = ""
