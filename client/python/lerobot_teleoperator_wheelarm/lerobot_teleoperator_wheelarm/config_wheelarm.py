"""Configuration of the teleoperator; every field is an option ``--teleop.NAME``."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("wheelarm")
@dataclass(kw_only=True)
class WheelArmTeleoperatorConfig(TeleoperatorConfig):  # type: ignore[misc]
    """What is played."""

    #: A recording (`.h5`), or the folder of a set that `wheelarm dataset export --format
    #: lerobot` wrote.
    recording: str = ""
    #: Number of the episode in the set.
    episode: int = 0
    #: What the rows are, where a recording is read: `next-pose`, `next-joints` or `applied`.
    action: str = "next-pose"
