"""Configuration of the teleoperator; every field is an option ``--teleop.NAME``."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig


@TeleoperatorConfig.register_subclass("wheelarm")
@dataclass(kw_only=True)
class WheelArmTeleoperatorConfig(TeleoperatorConfig):  # type: ignore[misc]
    """Recording and rows."""

    #: A recording (`.h5`), or the folder of a set of `wheelarm dataset export --format lerobot`.
    recording: str = ""
    #: Number of the episode in the set.
    episode: int = 0
    #: Kind of the rows of a recording: `next-pose`, `next-joints` or `applied`.
    action: str = "next-pose"
