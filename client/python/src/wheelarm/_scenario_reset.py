"""Scenario fields that a server keeps from one reset to the next, and how to undo them.

Pure: this module does not access a server.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from . import v1
from ._contract import TASKS

#: Fields that a reset with task and seed samples again.
RESAMPLED = frozenset(
    (
        "task",
        "seed",
        "objects",
        "slides",
        "start",
        "instruction",
        "target",
        "variant",
        "arm_positions",
        "knuckle",
    )
)


def persistent_fields(requested: Mapping[str, Any]) -> set[str]:
    """The requested fields that stay in force after the episode."""
    known = v1.Scenario.DESCRIPTOR.fields_by_name
    fields = {name for name, value in requested.items() if value is not None and name in known}
    fields -= RESAMPLED
    if "robot" in fields:
        # A change of the robot enables all its cameras and no sensor models.
        fields |= {"cameras", "sensors"}
    return fields


def undo_value(field: str, original: v1.Scenario, task: str) -> Any | None:
    """The value that sets a field back in a reset.

    Args:
        field: Name of a field of `v1.Scenario`.
        original: The scenario before the change.
        task: Name of the task.

    Returns:
        The value; `None` when no value of a reset has this effect.
    """
    if field == "cameras":
        off = v1.CameraSetting(name="*", width=320, height=180, rate_hz=0.0)
        return list(original.cameras) or [off]
    if field == "sensors":
        return list(original.sensors) or [v1.SensorSetting(model="none")]
    kind = v1.Scenario.DESCRIPTOR.fields_by_name[field]
    if not kind.has_presence or original.HasField(field):
        value = getattr(original, field)
        if field in ("person", "language"):
            # The reset samples these parts again.
            value = type(value).FromString(value.SerializeToString())
            for sampled in ("sampled", "template", "question", "ambiguous"):
                if sampled in value.DESCRIPTOR.fields_by_name:
                    value.ClearField(sampled)
        return value
    absent = {
        "appearance": v1.Appearance(),
        "disturbances": v1.Disturbances(),
        "person": v1.Person(body="none"),
        "time_limit_seconds": TASKS.get(task),
    }
    return absent.get(field)
