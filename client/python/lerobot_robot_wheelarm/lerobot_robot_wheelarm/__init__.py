"""WheelArm as a robot of LeRobot.

lerobot-record --robot.type=wheelarm --robot.task=pick_mustard --teleop.type=wheelarm …
"""

# LeRobot before 0.6 imports no module for its environments' sake.
import lerobot_env_wheelarm  # noqa: F401

from .config_wheelarm import WheelArmRobotConfig
from .wheelarm_robot import WheelArmRobot

__all__ = ["WheelArmRobot", "WheelArmRobotConfig"]
