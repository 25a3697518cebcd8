"""A teleoperator of LeRobot that plays what the scripted operator did.

lerobot-record --teleop.type=wheelarm --teleop.recording=data/pick_mustard-seed0.h5 …
"""

from .config_wheelarm import WheelArmTeleoperatorConfig
from .wheelarm_teleoperator import WheelArmTeleoperator

__all__ = ["WheelArmTeleoperator", "WheelArmTeleoperatorConfig"]
