"""WheelArm for LeRobot's EnvHub: put this file at the root of a hub repository."""

from __future__ import annotations

from typing import Any

import wheelarm


def make_env(n_envs: int = 1, use_async_envs: bool = False, cfg: Any = None) -> dict[str, Any]:
    """Environments by suite and task. They compute in parallel, also without
    `use_async_envs`."""
    task = getattr(cfg, "task", None) or "pick_mustard"
    envs = wheelarm.WheelArmVectorEnv(
        n_envs, task=task, obs_mode="pixels", autoreset_mode="SameStep"
    )
    return {"wheelarm": {0: envs}}
