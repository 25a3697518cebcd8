"""A LeRobot teleoperator that replays a recording of the scripted operator.

lerobot-record --teleop.type=wheelarm --teleop.recording=data/pick_mustard-seed0.h5 …
"""

from .config_wheelarm import WheelArmTeleoperatorConfig
from .wheelarm_teleoperator import WheelArmTeleoperator

__all__ = ["WheelArmTeleoperator", "WheelArmTeleoperatorConfig"]
