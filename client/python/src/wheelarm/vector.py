"""Several environments in one process, each with its own server."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import iterate
from gymnasium.wrappers import TimeLimit

from .env import WheelArmEnv


class WheelArmVectorEnv(SyncVectorEnv):
    """N environments with N servers that compute in parallel, without worker processes.

        envs = gymnasium.make_vec("wheelarm:wheelarm/PickMustard-v0", num_envs=4,
                                  vectorization_mode="vector_entry_point")

    All results equal those of `gymnasium.vector.SyncVectorEnv`; a step sends all actions
    before it waits for the first result.

    Args:
        num_envs: Number of environments.
        max_episode_steps: Steps until an episode is truncated; only the task's limit if absent.
        autoreset_mode: `AutoresetMode.NEXT_STEP` (the default), ``SAME_STEP`` or
            ``DISABLED``.
        observation_mode: As in `SyncVectorEnv`.
        copy: Whether observations are copies.
        more: Arguments of `WheelArmEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        observation_mode: Any = "same",
        copy: bool = True,
        **more: Any,
    ) -> None:
        def make_env() -> gymnasium.Env[Any, Any]:
            env: gymnasium.Env[Any, Any] = WheelArmEnv(**more)
            return TimeLimit(env, max_episode_steps) if max_episode_steps else env

        makers: list[Callable[[], gymnasium.Env[Any, Any]]] = [make_env] * num_envs
        super().__init__(
            makers,
            copy=copy,
            observation_mode=observation_mode,
            autoreset_mode=autoreset_mode,
        )

    def reset(self, **arguments: Any) -> Any:
        """As in `SyncVectorEnv`; the servers start in parallel."""
        with ThreadPoolExecutor(self.num_envs) as pool:
            list(pool.map(lambda env: env.unwrapped.start(), self.envs))
        return super().reset(**arguments)

    def step(self, actions: Any) -> Any:
        """As in `SyncVectorEnv`; the servers compute in parallel."""
        for env, over, action in zip(
            self.envs, self._autoreset_envs, iterate(self.action_space, actions), strict=True
        ):
            # An environment that is reset in this step needs no action.
            if not over:
                single: Any = env.unwrapped
                single.send(action)
        return super().step(actions)
