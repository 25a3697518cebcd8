"""An episode in lock-step, in which time waits for this program."""

from __future__ import annotations

import queue
import time
from dataclasses import dataclass
from typing import Any

import zenoh

from . import v1
from ._connection import Connection
from ._contract import CONTROL_HZ, PHYSICS_HZ
from ._session import direct_callback
from ._wire import check_topic, read
from .commander import Commander
from .errors import EpisodeEndedError, GoneError, RefusedError, SilentError, WheelArmError
from .frame import Frame
from .streams import Sample

TICKS_PER_CONTROL = PHYSICS_HZ // CONTROL_HZ
#: Silence after which a step requests the server's status, s.
_SILENCE = 1.0
#: Topics that end the wait of a step.
_STEP_TOPICS = frozenset(("clock", "refusal", "episode_stop"))


@dataclass(frozen=True)
class Moment:
    """Samples and images at one control tick.

    Attributes:
        header: Header of the tick.
        samples: Newest sample of every selected topic, by topic.
        frames: Newest image of every selected camera, by camera.
    """

    header: v1.Header
    samples: dict[str, Sample]
    frames: dict[str, Frame]

    @property
    def tick(self) -> int:
        """Physics tick, 240 per second."""
        return int(self.header.tick)

    @property
    def stamp(self) -> float:
        """Simulation time, s."""
        return float(self.header.stamp_nanos) * 1e-9

    def message(self, topic: str) -> Any:
        """The newest message of a topic, for example a `v1.JointState`.

        Raises:
            KeyError: when the topic is not selected, or its rate is 0.
        """
        return self.samples[topic].message


class LockStep:
    """A running episode in lock-step. Every `step` answers the present control tick and
    returns the next tick to answer. Leaving the context ends the episode.

    Attributes:
        now: Samples and images at the present tick.
        started: Reply of the server at the start of the episode.
        commander: The commander of this program.
        patience: Silence of the server after which a step fails, wall time, s.
    """

    def __init__(
        self,
        connection: Connection,
        name: str,
        label: str,
        *,
        topics: tuple[str, ...],
        cameras: tuple[str, ...],
        take: bool,
        recorders: int,
        instruction: str | None,
    ) -> None:
        self._connection = connection
        self.patience = 120.0
        self._queue: queue.SimpleQueue[tuple[str, zenoh.Sample]] = queue.SimpleQueue()
        self._subscribers: list[Any] = []
        self._newest: dict[str, zenoh.Sample] = {}
        # Topics of which only the newest sample counts. The transport stores it, so that
        # samples between two answers need no time of this interpreter.
        self._rings: dict[str, Any] = {}
        self._frames: dict[str, Frame] = {}
        self._running = False
        self._target: int | None = None
        self._last_arrival = time.monotonic()
        self.commander = Commander(connection, name, take=take, sealed=True)
        try:
            self._periods = self._camera_periods(cameras)
            for topic in set(map(check_topic, topics)) - _STEP_TOPICS:
                self._rings[topic] = connection._session.declare_subscriber(
                    connection._topic_key(topic), zenoh.handlers.RingChannel(1)
                )
            for topic in _STEP_TOPICS:
                self._subscribe(topic, connection._topic_key(topic))
            for camera in cameras:
                self._subscribe("camera/" + camera, connection._key(f"camera/{camera}"))
            self.started = connection.start_episode(
                label, instruction=instruction, recorders=recorders, commander=name
            )
            self._running = True
            self.now = self._wait_for_tick(int(self.started.header.tick))
        except BaseException:
            self.close()
            raise

    def _camera_periods(self, cameras: tuple[str, ...]) -> dict[str, int]:
        """Ticks between two images of each camera."""
        if not cameras:
            return {}
        settings = {one.name: one for one in self._connection.status().scenario.cameras}
        periods = {}
        for camera in cameras:
            setting = settings.get(camera)
            rate = 0.0 if setting is None else setting.rate_hz
            if rate <= 0.0:
                raise ValueError(
                    f"the camera {camera!r} is not in use (in use: "
                    f"{', '.join(settings) or 'none'}): enable it with reset(cameras=...)"
                )
            periods[camera] = round(PHYSICS_HZ / rate)
        return periods

    def _subscribe(self, name: str, key: str) -> None:
        put = self._queue.put

        def enqueue(sample: zenoh.Sample) -> None:
            if name != "clock" or self._is_awaited(sample):
                put((name, sample))

        self._subscribers.append(
            self._connection._session.declare_subscriber(key, direct_callback(enqueue))
        )

    def _is_awaited(self, clock: zenoh.Sample) -> bool:
        """Whether a clock ends the wait of a step. Clocks that the last command covers do not
        wake the waiting thread; they only show that the server is alive."""
        if self._target is None or not self._connection._server.published(clock):
            return True
        try:
            tick = int(v1.Clock.FromString(clock.payload.to_bytes()).header.tick)
        except Exception:
            return True  # The waiting thread reports the error.
        if tick < self._target:
            self._last_arrival = time.monotonic()
            return False
        return True

    @property
    def episode(self) -> int:
        """Number of the episode (no unit)."""
        return int(self.started.header.episode)

    def step(self, command: v1.Command) -> Moment:
        """Answers the present tick and waits for the next tick to answer.

        Args:
            command: The command; ``over_ticks`` is the number of control ticks it covers.

        Raises:
            RefusedError: when the server rejects the command; the tick is still unanswered.
            EpisodeEndedError: when another client, or diverged physics, ended the episode.
            SilentError: when no data arrives for `patience`; the message states what time
                waits for.
        """
        self.send(command)
        return self.receive()

    def send(self, command: v1.Command) -> None:
        """First half of `step`: sends the command without waiting."""
        self._target = self.now.tick + TICKS_PER_CONTROL * max(int(command.over_ticks), 1)
        self.commander.send(command, header=self.now.header)

    def receive(self) -> Moment:
        """Second half of `step`: waits for the next tick to answer."""
        assert self._target is not None, "call send before receive"
        self.now = self._wait_for_tick(self._target)
        return self.now

    def _wait_for_tick(self, target: int) -> Moment:
        """Receives until the clock of a tick and the images due by then have arrived."""
        self._last_arrival = time.monotonic()
        header: v1.Header | None = None
        requested: set[str] = set()
        while True:
            if header is not None and self._read_rings(requested) and not self._due(header.tick):
                break
            try:
                name, sample = self._queue.get(timeout=_SILENCE)
            except queue.Empty:
                header = self._after_silence(target, header)
                continue
            if not self._connection._server.published(sample):
                continue
            self._last_arrival = time.monotonic()
            if name == "clock":
                clock = read(v1.Clock, sample.payload.to_bytes(), name).header
                if clock.episode == self.episode and clock.tick >= target:
                    header = clock
            elif name == "refusal":
                refusal = read(v1.Refusal, sample.payload.to_bytes(), name)
                if refusal.commander == self.commander.name:
                    raise RefusedError("command", refusal.code, refusal.reason)
            elif name == "episode_stop":
                stopped = read(v1.EpisodeStopped, sample.payload.to_bytes(), name)
                if stopped.header.episode == self.episode:
                    self._running = False
                    raise EpisodeEndedError(stopped)
            elif name.startswith("camera/"):
                frame = Frame.from_bytes(sample.payload.to_bytes())
                if frame.header.episode == self.episode:
                    self._frames[name[7:]] = frame
            self._newest[name] = sample
        samples = {
            name: Sample(name, sample.payload.to_bytes())
            for name, sample in self._newest.items()
            if not name.startswith("camera/")
        }
        return Moment(header, samples, dict(self._frames))

    def _read_rings(self, requested: set[str]) -> bool:
        """Reads the newest sample of every topic; time waits, so no later one exists. If a
        sample of another session replaced it, the server's own is requested once:
        ``requested`` holds these topics. Returns whether no request is pending."""
        complete = True
        for topic, subscriber in self._rings.items():
            sample = subscriber.try_recv()
            if sample is None:
                continue
            if self._connection._server.published(sample):
                self._newest[topic] = sample
            elif topic not in requested:
                requested.add(topic)
                self.request_newest(topic)
                complete = False
        return complete

    def _due(self, tick: int) -> list[str]:
        """Cameras whose image that is due by a tick has not arrived."""
        missing = []
        for camera, period in self._periods.items():
            due = tick - tick % period
            frame = self._frames.get(camera)
            if due >= self.started.header.tick and (frame is None or frame.tick < due):
                missing.append(camera)
        return missing

    def request_newest(self, name: str) -> None:
        """Requests the newest sample of a topic, or of ``camera/NAME``, from the server's
        cache, after a loss. It is then processed like one that arrives late."""
        key = self._connection._key(name) if "/" in name else self._connection._topic_key(name)
        replies = self._connection._session.get(
            f"{key}/@adv/**?_max=1",
            accept_replies=zenoh.ReplyKeyExpr.ANY,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=5.0,
        )
        for reply in replies:
            if reply.ok is not None and str(reply.ok.key_expr) == key:
                self._queue.put((name, reply.ok))

    def _after_silence(self, target: int, header: v1.Header | None) -> v1.Header | None:
        """Finds the cause of silence; a clock may have been lost. Returns the header of the
        awaited tick if it is known."""
        if self._connection.is_closed:
            raise GoneError("the client is closed")
        status = self._connection.status()
        if status.episode.header.episode != self.episode:
            stopped = v1.EpisodeStopped()
            for one in self._connection.request(v1.EpisodeRequest()).ended:
                if one.header.episode == self.episode:
                    stopped = one
            self._running = False
            raise EpisodeEndedError(stopped)
        if header is not None:
            # A lost image is still in the server's cache.
            for camera in self._due(header.tick):
                self.request_newest("camera/" + camera)
        if header is None and status.header.tick >= target and not status.paused:
            return status.header
        if time.monotonic() - self._last_arrival > self.patience:
            missing = "image of a camera" if header is not None else f"clock of tick {target}"
            raise SilentError(
                f"no {missing} within {self.patience:.0f} s; the server reports: "
                f"{status.waiting_for or 'time runs'}"
            )
        return header

    def stop(self, *, discard: bool = False) -> v1.EpisodeStopped:
        """Ends the episode and releases control; with `discard`, recorders delete it."""
        try:
            stopped = self._connection.stop_episode(discard=discard, episode=self.episode)
            self._running = False
            return stopped
        finally:
            self.close()

    def close(self) -> None:
        """Ends the episode if it runs, and releases control."""
        if self._running:
            self._running = False
            try:
                self._connection.stop_episode(episode=self.episode)
            except WheelArmError:
                pass
        for subscriber in [*self._subscribers, *self._rings.values()]:
            subscriber.undeclare()
        self._subscribers, self._rings = [], {}
        self.commander.close()

    def __enter__(self) -> LockStep:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
