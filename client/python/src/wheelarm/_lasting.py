"""What a server keeps from one reset to the next, and how a reset takes it back.

Nothing here speaks to a server.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from . import v1
from ._contract import TASKS

#: Fields that a reset with task and seed draws anew.
ANEW = frozenset(
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


def lasting(asked: Mapping[str, Any]) -> set[str]:
    """Fields of those that were asked for once which stay in force."""
    known = v1.Scenario.DESCRIPTOR.fields_by_name
    fields = {name for name, value in asked.items() if value is not None and name in known} - ANEW
    if "robot" in fields:
        # Another robot comes with all its cameras and without sensor models.
        fields |= {"cameras", "sensors"}
    return fields


def taken_back(field: str, own: v1.Scenario, task: str) -> Any | None:
    """What a reset says of a field to go back to a scenario.

    Args:
        field: Name of a field of `v1.Scenario`.
        own: The scenario that was in force before.
        task: Name of the task.

    Returns:
        Its value; `None` where no reset can say it.
    """
    if field == "cameras":
        return list(own.cameras) or [v1.CameraSetting(name="*", width=320, height=180, rate_hz=0.0)]
    if field == "sensors":
        return list(own.sensors) or [v1.SensorSetting(model="none")]
    kind = v1.Scenario.DESCRIPTOR.fields_by_name[field]
    if not kind.has_presence or own.HasField(field):
        value = getattr(own, field)
        if field in ("person", "language"):
            # What was drawn of it is drawn anew.
            value = type(value).FromString(value.SerializeToString())
            for drawn in ("drawn", "template", "question", "ambiguous"):
                if drawn in value.DESCRIPTOR.fields_by_name:
                    value.ClearField(drawn)
        return value
    nothing = {
        "look": v1.Look(),
        "disturbances": v1.Disturbances(),
        "person": v1.Person(body="none"),
        "time_limit_seconds": TASKS.get(task),
    }
    return nothing.get(field)
