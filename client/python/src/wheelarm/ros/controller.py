"""The node as a commander: it requests, keeps and releases control, and sends commands.

In real time the first command of a topic requests control; control is released when no
command has arrived for a while and the robot is at rest. In lock-step a step or play
requests it, because time waits for the client in control. This module does not import ROS.
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
from .command import BadCommandError, PendingCommands

#: Seconds between two requests for control that another client holds.
RETRY_INTERVAL = 1.0
#: Seconds of silence after which the status is requested: a clock may have been lost.
SILENCE = 1.0
#: Joint and wheel speeds below which the robot is at rest, rad/s.
AT_REST = 1e-6

#: Rejections that mean the loss of control.
_LOSS_CODES = (
    v1.REFUSAL_CODE_NO_CONTROL,
    v1.REFUSAL_CODE_CONTROL_HELD,
    v1.REFUSAL_CODE_SEAL,
)


class UnavailableError(WheelArmError):
    """A request that cannot be fulfilled; the text states the cause and the fix."""


class Controller:
    """Sends the commands of ``PendingCommands`` in its own thread."""

    def __init__(
        self,
        client: Client,
        commands: PendingCommands,
        name: str,
        *,
        take: bool = False,
        lease_timeout: float = 5.0,
        rate: float = 1.0,
        report: Callable[[str], None] = lambda text: None,
    ):
        """``name`` is the name of the commander; ``take`` takes control over from the client
        that holds it. Control is released after ``lease_timeout`` seconds without a command; 0
        keeps it. ``rate`` is simulated seconds per second while lock-step time is played; 0
        has no limit. ``report`` receives the texts of problems."""
        self.client, self.commands, self.name, self.take = client, commands, name, take
        self.lease_timeout, self.rate, self.report = lease_timeout, rate, report
        #: Whether the pacing is lock-step.
        self.lock_step = False
        self.control: Commander | None = None
        #: Rejected commands (count).
        self.refused = 0
        #: Text of the newest problem; empty without one.
        self.problem = ""
        self.changed = threading.Condition()
        self._clock = None
        self._answered: tuple[str, int, int] | None = None
        self._playing = False
        self._until: int | None = None
        self._last_clock = self._last_command = time.monotonic()
        self._next = self._not_before = 0.0
        self._at_rest = True
        self._ended = False
        self._lease = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="controller", daemon=True)
        self._thread.start()

    # Input from the server.

    def clock(self, header) -> None:
        """Processes the clock of a control tick, after all samples of the tick."""
        with self.changed:
            before = self._clock
            self._clock, self._last_clock = header, time.monotonic()
            restarted = before is not None and before.run_id != header.run_id
            if before is not None and (restarted or header.tick < before.tick):
                self.commands.clear()
                self._answered = None
            if restarted:
                self._lose_control()
            self.changed.notify_all()

    def applied(self, sample) -> None:
        """Processes ``wheelarm.v1.Applied``: the targets in force at a control tick."""
        with self.changed:
            if len(sample.joint_positions):
                self.commands.targets = (list(sample.joint_positions), sample.knuckle)
            speeds = [*sample.joint_velocities, *sample.wheel_velocities]
            self._at_rest = all(abs(speed) < AT_REST for speed in speeds)

    def refusal(self, sample) -> None:
        """Processes ``wheelarm.v1.Refusal``: the rejection of a command."""
        if sample.commander != self.name:
            return
        with self.changed:
            self.refused += max(1, sample.count)
            self.problem = sample.reason
            if sample.code == v1.REFUSAL_CODE_INVALID:
                # A repetition would be rejected again.
                self.commands.drop()
            if sample.code in _LOSS_CODES:
                self._lose_control()
            if sample.code not in (v1.REFUSAL_CODE_ANSWERED, v1.REFUSAL_CODE_TOO_OLD):
                # In lock-step the tick is still unanswered.
                self._answered = None
            self.changed.notify_all()
        self.report(f"a command was refused: {sample.reason}")

    def episode_ended(self) -> None:
        """Processes the end of the running episode."""
        with self.changed:
            self._until = None
            self.changed.notify_all()

    # Requests of ROS.

    def update(self, change: Callable[[PendingCommands, float, int], None]) -> str:
        """Calls ``change`` with the pending commands, the wall time, s, and the simulation time,
        ns. Returns the text of an error, empty without one."""
        with self.changed:
            now = time.monotonic()
            stamp = self._clock.stamp_nanos if self._clock is not None else 0
            try:
                change(self.commands, now, stamp)
            except BadCommandError as error:
                self.problem = str(error)
                return str(error)
            self._last_command = now
            self.changed.notify_all()
            return ""

    def take_control(self) -> None:
        """Requests control unless it is held already.

        Raises ``wheelarm.RefusedError`` with the name of the client in control.
        """
        with self._lease:
            if self.control is not None:
                return
            control = self.client.commander(self.name, take=self.take)
            with self.changed:
                self.control, self.problem = control, ""
                self._last_command = time.monotonic()
                self.changed.notify_all()

    def release(self) -> None:
        """Releases control; the chair brakes, the arm holds."""
        with self._lease:
            with self.changed:
                control, self.control = self.control, None
                self._playing, self._until = False, None
            if control is not None:
                control.close()

    @property
    def is_playing(self) -> bool:
        """Whether every control tick of lock-step is answered."""
        return self._playing

    def play(self, playing: bool) -> None:
        """Answers every control tick of lock-step from now on if ``playing``, else none."""
        with self.changed:
            self._playing = playing
            self._next = time.monotonic()
            self.changed.notify_all()

    def step(self, steps: int, episode: int, tick: int) -> None:
        """Answers ``steps`` control ticks of a lock-step episode from ``tick`` on, and returns
        after the arrival of the state after the last one.

        Raises ``UnavailableError`` when the episode or control ends before.
        """
        with self.changed:
            self._until = until = tick + steps * TICKS_PER_CONTROL
            self.changed.notify_all()

            def is_over() -> bool:
                clock = self._clock
                arrived = clock is not None and clock.episode == episode and clock.tick >= until
                return arrived or self._until is None or self.control is None or self._ended

            self.changed.wait_for(is_over)
            clock, self._until = self._clock, None
            if clock is None or clock.episode != episode or clock.tick < until:
                reached = clock.tick if clock is not None else tick
                raise UnavailableError(
                    f"only {(reached - tick) // TICKS_PER_CONTROL} of {steps} steps are done: "
                    + (self.problem or "the episode or control ended; step again")
                )

    def close(self) -> None:
        """Releases control and ends the thread."""
        with self.changed:
            self._ended = True
            self.changed.notify_all()
        self._thread.join(timeout=5)
        self.release()

    # The thread.

    def _lose_control(self) -> None:
        control, self.control = self.control, None
        self._playing, self._until = False, None
        if control is not None:
            threading.Thread(target=control.close, daemon=True).start()

    def _tick_id(self, header) -> tuple[str, int, int]:
        return header.run_id, header.episode, header.tick

    def _is_due(self) -> bool:
        """Whether the newest control tick needs an answer now."""
        clock = self._clock
        if self._ended:
            return True
        if clock is None or self._answered == self._tick_id(clock):
            return False
        if not self.lock_step:
            return self.commands.is_waiting
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
                    self._check_between_ticks()
                    continue
                if wait > 0:
                    time.sleep(wait)
                self._next = max(self._next, time.monotonic() - 0.1)
                if self.rate:
                    self._next += 1 / (CONTROL_HZ * self.rate)
                if self.control is None and not self._request_control():
                    continue
                self._answer(header)
            except WheelArmError as error:
                self._report(str(error))

    def _request_control(self) -> bool:
        if time.monotonic() < self._not_before:
            with self.changed:
                self.commands.drop()
            return False
        try:
            self.take_control()
        except WheelArmError as error:
            with self.changed:
                self.commands.drop()
            self._not_before = time.monotonic() + RETRY_INTERVAL
            self._report(f"commands are ignored without control: {error}")
            return False
        return True

    def _answer(self, header) -> None:
        with self.changed:
            control = self.control
            if control is None:
                return
            parts = self.commands.command_at(time.monotonic(), header.stamp_nanos)
            command = v1.Command()
            parts.fill(command)
            command.device = v1.DEVICE_PROGRAM
            goal = parts.pose is not None
            command.mode = v1.INPUT_MODE_GOAL if goal else v1.INPUT_MODE_STREAM
            self._answered = self._tick_id(header)
            if parts:
                self._last_command = time.monotonic()
        control.send(command, header=header)
        # Empties the queue of rejections: the node receives them with all other topics.
        control.refusals()

    def _check_between_ticks(self) -> None:
        """Requests the status after a lost clock, and releases unused control."""
        now = time.monotonic()
        with self.changed:
            waiting = self.lock_step and self.control is not None
            waiting = waiting and (self._playing or self._until is not None)
            silent = waiting and now - self._last_clock > SILENCE
            idle = (
                not self.lock_step
                and self.control is not None
                and self.lease_timeout > 0
                and now - self._last_command > self.lease_timeout
                and self._at_rest
                and not self.commands.is_waiting
            )
        if silent:
            status = self.client.status()
            with self.changed:
                self._last_clock = now
                if status.HasField("episode") and not status.paused:
                    self._clock = status.header
                    self.changed.notify_all()
        if idle:
            self.release()

    def _report(self, text: str) -> None:
        self.problem = text
        self.report(text)
