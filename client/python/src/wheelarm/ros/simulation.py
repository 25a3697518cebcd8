"""Time, episodes and resets, for ``simulation_interfaces``.

| | real time | lock-step |
|---|---|---|
| stopped | reset and paused | no episode |
| playing | time runs | an episode runs and the node answers every tick |
| paused | time is paused | an episode runs and the node answers no tick |

One step is one control tick, 1/60 s. This module does not import ROS.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import dataclass

from .. import v1
from ..client import Client
from .controller import Controller, UnavailableError

#: States of ``simulation_interfaces/SimulationState``.
STOPPED, PLAYING, PAUSED, QUITTING = 0, 1, 2, 3


class WrongStateError(UnavailableError):
    """A request that needs another state first; the text names it."""


class UnsupportedError(UnavailableError):
    """A request that this server does not support; the text states why."""


class AlreadyInStateError(UnavailableError):
    """The simulation is already in the requested state."""


@dataclass
class EpisodeOptions:
    """Options of the next episode."""

    #: Label of the file; empty for a label from the wall clock.
    label: str = ""
    #: Instruction sentence; empty for that of the scenario.
    instruction: str = ""
    #: Recorders that must be ready before time runs (count).
    require_recorders: int = 0


class Simulation:
    """Controls time and episodes of one server."""

    def __init__(
        self, client: Client, controller: Controller, options: Callable[[], EpisodeOptions]
    ):
        """``options`` returns the options of the next episode."""
        self.client, self.controller, self.options = client, controller, options
        #: Real time: whether it was stopped and not played since.
        self._stopped = False

    def refresh(self):
        """Requests the server's ``Status`` and adopts its pacing."""
        status = self.client.status()
        lock_step = status.scenario.pacing == v1.PACING_LOCK_STEP
        self.controller.lock_step = self.controller.commands.in_simulation_time = lock_step
        return status

    def state(self) -> int:
        """State of the simulation."""
        return self._state_of(self.refresh())

    def _state_of(self, status) -> int:
        if self.controller.lock_step:
            if not status.HasField("episode"):
                return STOPPED
            ours = self.controller.control is not None
            if status.paused or (ours and not self.controller.is_playing):
                return PAUSED
            return PLAYING if status.holder else PAUSED
        if not status.paused:
            self._stopped = False
            return PLAYING
        return STOPPED if self._stopped else PAUSED

    def set_state(self, target: int) -> None:
        """Stops, plays, pauses or ends the simulation.

        Raises ``AlreadyInStateError`` in the target state, ``UnsupportedError`` for other
        targets, and ``wheelarm.RefusedError`` when the server rejects it.
        """
        status = self.refresh()
        if target not in (STOPPED, PLAYING, PAUSED, QUITTING):
            raise UnsupportedError(
                "unsupported state: the home is always loaded; use stopped, playing, paused or quitting"
            )
        if self._state_of(status) == target:
            raise AlreadyInStateError("the simulation is already in this state")
        if target == QUITTING:
            self.client.shutdown()
        elif target == STOPPED:
            self.reset()
            if not self.controller.lock_step:
                self.client.pause()
                self._stopped = True
        elif self.controller.lock_step:
            self._ensure_episode(status)
            self.controller.play(target == PLAYING)
        else:
            if target == PLAYING:
                self.client.resume()
            else:
                self.client.pause()
            self._stopped = False

    def _ensure_episode(self, status):
        """Requests control and starts an episode unless one runs. Returns the header of the
        tick to answer."""
        self.controller.take_control()
        if status.HasField("episode"):
            if status.paused:
                self.client.resume()
            return status.header
        return self.start().header

    def step(self, steps: int) -> None:
        """Advances time by exactly ``steps`` control ticks.

        Raises ``UnsupportedError`` unless the pacing is lock-step, ``WrongStateError`` while
        the simulation is playing, ``wheelarm.RefusedError`` when another client is in control.
        """
        status = self.refresh()
        if not self.controller.lock_step:
            pacing = v1.Pacing.Name(status.scenario.pacing).removeprefix("PACING_").lower()
            raise UnsupportedError(
                "steps need lock-step pacing, and this server has "
                f"{pacing.replace('_', '-')}: start it with --pacing lock-step"
            )
        if self.controller.is_playing:
            raise WrongStateError("cannot step while the simulation is playing: pause it first")
        if steps == 0:
            return
        header = self._ensure_episode(status)
        self.controller.step(steps, header.episode, header.tick)

    def reset(self) -> None:
        """Ends a running episode and resets the scenario with its sampled values; time starts
        at 0.

        Raises ``wheelarm.RefusedError`` when another client is in control.
        """
        status = self.refresh()
        if status.HasField("episode"):
            self.stop()
        self.controller.play(False)
        self.client.reset()

    def start(self):
        """Starts an episode and returns ``EpisodeStarted``. In lock-step, time then waits for
        steps or for play."""
        if self.controller.lock_step:
            self.controller.take_control()
        options = self.options()
        now = datetime.datetime.now()
        return self.client.start_episode(
            options.label or f"ros-{now:%Y%m%d-%H%M%S-%f}",
            instruction=options.instruction or None,
            recorders=options.require_recorders,
            commander=self.controller.name if self.controller.lock_step else "",
        )

    def stop(self, discard: bool = False):
        """Ends the running episode and returns ``EpisodeStopped``; with ``discard``, recorders
        delete it."""
        self.controller.play(False)
        return self.client.stop_episode(discard=discard)


__all__ = [
    "PAUSED",
    "PLAYING",
    "QUITTING",
    "STOPPED",
    "AlreadyInStateError",
    "EpisodeOptions",
    "Simulation",
    "UnsupportedError",
    "WrongStateError",
]
