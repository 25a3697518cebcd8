"""Time, episodes and resets, as ``simulation_interfaces`` asks for them.

| | real time | lock-step |
|---|---|---|
| stopped | reset and paused | no episode runs |
| playing | time goes on | an episode runs and the node answers every tick |
| paused | time is paused | an episode runs and the node answers none |

One step is one control tick, 1/60 s. Nothing here knows ROS.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import dataclass

from .. import v1
from ..client import Client
from .pilot import Pilot, Unable

#: States of ``simulation_interfaces/SimulationState``.
STOPPED, PLAYING, PAUSED, QUITTING = 0, 1, 2, 3


class WrongState(Unable):
    """It cannot be done now; the words say what has to be done before."""


class Unsupported(Unable):
    """It cannot be done here at all; the words say why."""


class Already(Unable):
    """It is so already."""


@dataclass
class EpisodeOptions:
    """How an episode is begun."""

    #: File label; empty for one made of the wall clock.
    label: str = ""
    #: Instruction sentence; empty for the scenario's.
    instruction: str = ""
    #: Recorders that must be ready before time goes on.
    require_recorders: int = 0


class Simulation:
    """Steers time and episodes of one server."""

    def __init__(self, client: Client, pilot: Pilot, options: Callable[[], EpisodeOptions]):
        """``options`` tells how the next episode is begun."""
        self.client, self.pilot, self.options = client, pilot, options
        #: Real time: it was stopped and not played since.
        self._stopped = False

    def look(self):
        """The server's ``Status``; takes over its pacing."""
        status = self.client.status()
        lock_step = status.scenario.pacing == v1.PACING_LOCK_STEP
        self.pilot.lock_step = self.pilot.wishes.in_simulation_time = lock_step
        return status

    def state(self) -> int:
        """State of the simulation."""
        return self._state_of(self.look())

    def _state_of(self, status) -> int:
        if self.pilot.lock_step:
            if not status.HasField("episode"):
                return STOPPED
            ours = self.pilot.control is not None
            if status.paused or (ours and not self.pilot.is_playing):
                return PAUSED
            nobody = not status.holder
            return PAUSED if nobody else PLAYING
        if not status.paused:
            self._stopped = False
            return PLAYING
        return STOPPED if self._stopped else PAUSED

    def set_state(self, target: int) -> None:
        """Stops, plays, pauses or ends the simulation.

        Raises ``Already`` when it is so, ``Unsupported`` for another state, and
        ``wheelarm.Refused`` in the server's words.
        """
        status = self.look()
        if target not in (STOPPED, PLAYING, PAUSED, QUITTING):
            raise Unsupported("the home is always loaded: stop, play, pause or quit")
        if self._state_of(status) == target:
            raise Already("the simulation is in this state already")
        if target == QUITTING:
            self.client.shutdown()
        elif target == STOPPED:
            self.reset()
            if not self.pilot.lock_step:
                self.client.pause()
                self._stopped = True
        elif self.pilot.lock_step:
            self._in_episode(status)
            self.pilot.play(target == PLAYING)
        else:
            if target == PLAYING:
                self.client.resume()
            else:
                self.client.pause()
            self._stopped = False

    def _in_episode(self, status):
        """Header of the tick to be answered, in an episode that the node steers."""
        self.pilot.take_control()
        if status.HasField("episode"):
            if status.paused:
                self.client.resume()
            return status.header
        return self.start().header

    def step(self, steps: int) -> None:
        """Goes on by ``steps`` control ticks, exactly, and stands still again.

        Raises ``Unsupported`` where time does not wait, ``WrongState`` while it is
        played, ``wheelarm.Refused`` when somebody else is in control.
        """
        status = self.look()
        if not self.pilot.lock_step:
            pacing = v1.Pacing.Name(status.scenario.pacing).removeprefix("PACING_").lower()
            raise Unsupported(
                "steps need lock-step pacing, and this server runs in "
                f"{pacing.replace('_', '-')}: start it with --pacing lock-step"
            )
        if self.pilot.is_playing:
            raise WrongState("the simulation is played: pause it before it is stepped")
        if steps == 0:
            return
        header = self._in_episode(status)
        self.pilot.step(steps, header.episode, header.tick)

    def reset(self) -> None:
        """Everything as at the start, with what was drawn then; time begins at 0.
        An episode that runs ends before.

        Raises ``wheelarm.Refused`` when somebody else is in control.
        """
        status = self.look()
        if status.HasField("episode"):
            self.stop()
        self.pilot.play(False)
        self.client.reset()

    def start(self):
        """Begins an episode; ``EpisodeStarted``. In lock-step time then waits for
        steps or for play."""
        if self.pilot.lock_step:
            self.pilot.take_control()
        wanted = self.options()
        now = datetime.datetime.now()
        return self.client.start_episode(
            wanted.label or f"ros-{now:%Y%m%d-%H%M%S-%f}",
            instruction=wanted.instruction or None,
            recorders=wanted.require_recorders,
            commander=self.pilot.name if self.pilot.lock_step else "",
        )

    def stop(self, discard: bool = False):
        """Ends the running episode; ``EpisodeStopped``. With ``discard`` recorders
        throw it away."""
        self.pilot.play(False)
        return self.client.stop_episode(discard=discard)


__all__ = [
    "PAUSED",
    "PLAYING",
    "QUITTING",
    "STOPPED",
    "Already",
    "EpisodeOptions",
    "Simulation",
    "Unsupported",
    "WrongState",
]
