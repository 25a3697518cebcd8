"""The node as a commander: when it takes control, keeps it and gives it back.

In real time control is taken with the first wish of a topic and given back when
no wish has come for a while and the robot is at rest. In lock-step it is taken
when the simulation is stepped or played, because time waits for whoever holds
it. Nothing here knows ROS.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from .. import v1
from ..client import Client
from ..commander import Commander
from ..errors import WheelArmError
from ..lockstep import CONTROL_HZ, TICKS_PER_CONTROL
from .command import BadCommand, Wishes

#: Seconds between two tries to take control that somebody else holds.
AGAIN = 1.0
#: Seconds of silence after which the server is asked whether time waits for us: a
#: clock may be lost.
SILENCE = 1.0
#: Joint and wheel speeds below which the robot is at rest, rad/s.
AT_REST = 1e-6

#: Refusals that end control.
_LOST = (
    v1.REFUSAL_CODE_NO_CONTROL,
    v1.REFUSAL_CODE_CONTROL_HELD,
    v1.REFUSAL_CODE_SEAL,
)


class Unable(WheelArmError):
    """What was asked cannot be done; the words say why and what would help."""


class Pilot:
    """Sends what ``Wishes`` tells, from a thread of its own."""

    def __init__(
        self,
        client: Client,
        wishes: Wishes,
        name: str,
        *,
        take: bool = False,
        lease_timeout: float = 5.0,
        rate: float = 1.0,
        tell: Callable[[str], None] = lambda words: None,
    ):
        """``name`` is the commander's; with ``take`` control is taken over from
        whoever holds it. It is given back after ``lease_timeout`` seconds without a
        wish, 0 keeps it. ``rate`` is simulated seconds per second while lock-step
        time is played, 0 for as fast as it goes. ``tell`` hears problems in words."""
        self.client, self.wishes, self.name, self.take = client, wishes, name, take
        self.lease_timeout, self.rate, self.tell = lease_timeout, rate, tell
        #: Time waits for its commander.
        self.lock_step = False
        self.control: Commander | None = None
        #: Commands that were refused.
        self.refused = 0
        #: The newest problem in words; empty while all is well.
        self.problem = ""
        self.changed = threading.Condition()
        self._clock = None
        self._answered: tuple[str, int, int] | None = None
        self._playing = False
        self._until: int | None = None
        self._heard = self._wished = time.monotonic()
        self._next = self._not_before = 0.0
        self._at_rest = True
        self._ended = False
        self._lease = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="pilot", daemon=True)
        self._thread.start()

    # What comes from the server.

    def clock(self, header) -> None:
        """A control tick, after everything that was published up to it."""
        with self.changed:
            before = self._clock
            self._clock, self._heard = header, time.monotonic()
            restarted = before is not None and before.run_id != header.run_id
            if before is not None and (restarted or header.tick < before.tick):
                self.wishes.clear()
                self._answered = None
            if restarted:
                self._lost()
            self.changed.notify_all()

    def applied(self, sample) -> None:
        """What the robot was told at a control tick."""
        with self.changed:
            if len(sample.joint_positions):
                self.wishes.targets = (list(sample.joint_positions), sample.knuckle)
            speeds = [*sample.joint_velocities, *sample.wheel_velocities]
            self._at_rest = all(abs(speed) < AT_REST for speed in speeds)

    def refusal(self, sample) -> None:
        """A command was not taken."""
        if sample.commander != self.name:
            return
        with self.changed:
            self.refused += max(1, sample.count)
            self.problem = sample.reason
            if sample.code == v1.REFUSAL_CODE_INVALID:
                # The same again would be refused again.
                self.wishes.drop()
            if sample.code in _LOST:
                self._lost()
            if sample.code not in (v1.REFUSAL_CODE_ANSWERED, v1.REFUSAL_CODE_TOO_OLD):
                # In lock-step the tick is still to be answered.
                self._answered = None
            self.changed.notify_all()
        self.tell(f"a command was refused: {sample.reason}")

    def episode_ended(self) -> None:
        """The running episode is over."""
        with self.changed:
            self._until = None
            self.changed.notify_all()

    # What ROS asks for.

    def wish(self, put: Callable[[Wishes, float, int], None]) -> str:
        """Lets ``put`` change the wishes, at a wall time, s, and the simulation
        time, ns. Returns what is wrong in words, empty when nothing is."""
        with self.changed:
            now = time.monotonic()
            stamp = self._clock.stamp_nanos if self._clock is not None else 0
            try:
                put(self.wishes, now, stamp)
            except BadCommand as problem:
                self.problem = str(problem)
                return str(problem)
            self._wished = now
            self.changed.notify_all()
            return ""

    def take_control(self) -> None:
        """Takes control, if it is not there already.

        Raises ``wheelarm.Refused`` in words that name who holds it.
        """
        with self._lease:
            if self.control is not None:
                return
            control = self.client.commander(self.name, take=self.take)
            with self.changed:
                self.control, self.problem = control, ""
                self._wished = time.monotonic()
                self.changed.notify_all()

    def release(self) -> None:
        """Gives control back; the chair brakes, the arm holds."""
        with self._lease:
            with self.changed:
                control, self.control = self.control, None
                self._playing, self._until = False, None
            if control is not None:
                control.close()

    @property
    def is_playing(self) -> bool:
        """Whether lock-step time is answered tick by tick."""
        return self._playing

    def play(self, playing: bool) -> None:
        """Answers every control tick of lock-step from now on, or none."""
        with self.changed:
            self._playing = playing
            self._next = time.monotonic()
            self.changed.notify_all()

    def step(self, steps: int, episode: int, tick: int) -> None:
        """Answers ``steps`` control ticks of a lock-step episode from ``tick`` on
        and returns when the state after the last one has come.

        Raises ``Unable`` when the episode or control ends meanwhile.
        """
        with self.changed:
            self._until = until = tick + steps * TICKS_PER_CONTROL
            self.changed.notify_all()

            def is_over() -> bool:
                clock = self._clock
                there = clock is not None and clock.episode == episode and clock.tick >= until
                return there or self._until is None or self.control is None or self._ended

            self.changed.wait_for(is_over)
            clock, self._until = self._clock, None
            if clock is None or clock.episode != episode or clock.tick < until:
                reached = clock.tick if clock is not None else tick
                raise Unable(
                    f"{(reached - tick) // TICKS_PER_CONTROL} of {steps} steps are done: "
                    + (self.problem or "the episode or control ended")
                )

    def close(self) -> None:
        """Gives control back and ends the thread."""
        with self.changed:
            self._ended = True
            self.changed.notify_all()
        self._thread.join(timeout=5)
        self.release()

    # The thread.

    def _lost(self) -> None:
        control, self.control = self.control, None
        self._playing, self._until = False, None
        if control is not None:
            threading.Thread(target=control.close, daemon=True).start()

    def _name_of(self, header) -> tuple[str, int, int]:
        return header.run_id, header.episode, header.tick

    def _is_due(self) -> bool:
        """Whether the newest control tick is to be answered now."""
        clock = self._clock
        if self._ended:
            return True
        if clock is None or self._answered == self._name_of(clock):
            return False
        if not self.lock_step:
            return self.wishes.is_waiting
        if self.control is None or not clock.episode:
            return False
        if self._until is not None and clock.tick < self._until:
            return True
        return self._playing

    def _run(self) -> None:
        while True:
            with self.changed:
                self.changed.wait_for(self._is_due, timeout=0.2)
                if self._ended:
                    return
                due = self._is_due()
                header, wait = self._clock, 0.0
                stepping = self._until is not None
                if due and self.lock_step and self.rate and not stepping:
                    wait = self._next - time.monotonic()
            try:
                if not due:
                    self._look_around()
                    continue
                if wait > 0:
                    time.sleep(wait)
                self._next = max(self._next, time.monotonic() - 0.1)
                if self.rate:
                    self._next += 1 / (CONTROL_HZ * self.rate)
                if self.control is None and not self._try_control():
                    continue
                self._answer(header)
            except WheelArmError as problem:
                self._report(str(problem))

    def _try_control(self) -> bool:
        if time.monotonic() < self._not_before:
            with self.changed:
                self.wishes.drop()
            return False
        try:
            self.take_control()
        except WheelArmError as problem:
            with self.changed:
                self.wishes.drop()
            self._not_before = time.monotonic() + AGAIN
            self._report(f"no command is taken: {problem}")
            return False
        return True

    def _answer(self, header) -> None:
        with self.changed:
            control = self.control
            if control is None:
                return
            wanted = self.wishes.at(time.monotonic(), header.stamp_nanos)
            command = v1.Command()
            wanted.fill(command)
            command.device = v1.DEVICE_PROGRAM
            goal = wanted.pose is not None
            command.mode = v1.INPUT_MODE_GOAL if goal else v1.INPUT_MODE_STREAM
            self._answered = self._name_of(header)
            if wanted:
                self._wished = time.monotonic()
        control.send(command, header=header)
        # The node hears refusals with all other topics.
        control.refusals()

    def _look_around(self) -> None:
        """Between ticks: a clock that was lost, control that nobody needs."""
        now = time.monotonic()
        with self.changed:
            waiting = self.lock_step and self.control is not None
            waiting = waiting and (self._playing or self._until is not None)
            silent = waiting and now - self._heard > SILENCE
            idle = (
                not self.lock_step
                and self.control is not None
                and self.lease_timeout > 0
                and now - self._wished > self.lease_timeout
                and self._at_rest
                and not self.wishes.is_waiting
            )
        if silent:
            status = self.client.status()
            with self.changed:
                self._heard = now
                if status.HasField("episode") and not status.paused:
                    self._clock = status.header
                    self.changed.notify_all()
        if idle:
            self.release()

    def _report(self, words: str) -> None:
        self.problem = words
        self.tell(words)
