"""Several environments in one process, each with a server of its own."""

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
    """N environments side by side: N servers compute at the same time, and no worker
    processes are needed.

        envs = gymnasium.make_vec("wheelarm:wheelarm/PickMustard-v0", num_envs=4,
                                  vectorization_mode="vector_entry_point")

    The same as `gymnasium.vector.SyncVectorEnv` in all that it tells; a step sends all
    actions before it waits for the first result.

    Args:
        num_envs: How many.
        max_episode_steps: Steps until an episode is cut off; no limit but the task's own
            where absent.
        autoreset_mode: `AutoresetMode.NEXT_STEP` (the default), ``SAME_STEP`` or
            ``DISABLED``.
        observation_mode: As of `SyncVectorEnv`.
        copy: Whether observations are the caller's own.
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
        def one() -> gymnasium.Env[Any, Any]:
            env: gymnasium.Env[Any, Any] = WheelArmEnv(**more)
            return TimeLimit(env, max_episode_steps) if max_episode_steps else env

        makers: list[Callable[[], gymnasium.Env[Any, Any]]] = [one] * num_envs
        super().__init__(
            makers,
            copy=copy,
            observation_mode=observation_mode,
            autoreset_mode=autoreset_mode,
        )

    def reset(self, **asked: Any) -> Any:
        """As of `SyncVectorEnv`; the servers are started side by side."""
        with ThreadPoolExecutor(self.num_envs) as pool:
            list(pool.map(lambda env: env.unwrapped.start(), self.envs))
        return super().reset(**asked)

    def step(self, actions: Any) -> Any:
        """As of `SyncVectorEnv`; all servers compute at the same time."""
        for env, over, action in zip(
            self.envs, self._autoreset_envs, iterate(self.action_space, actions), strict=True
        ):
            # One that is reset in this step takes no action.
            if not over:
                single: Any = env.unwrapped
                single.send(action)
        return super().step(actions)
