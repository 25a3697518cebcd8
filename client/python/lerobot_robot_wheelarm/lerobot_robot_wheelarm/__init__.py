"""WheelArm as a LeRobot robot.

lerobot-record --robot.type=wheelarm --robot.task=pick_mustard --teleop.type=wheelarm …
"""

# LeRobot before 0.6 does not import modules of environments.
import lerobot_env_wheelarm  # noqa: F401

from .config_wheelarm import WheelArmRobotConfig
from .wheelarm_robot import WheelArmRobot

__all__ = ["WheelArmRobot", "WheelArmRobotConfig"]
