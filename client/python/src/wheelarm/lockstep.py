"""An episode in which time waits for this program."""

from __future__ import annotations

import queue
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import zenoh

from . import v1
from ._session import direct
from ._wire import read
from .errors import Gone, Refused, Silent, WheelArmError
from .frame import Frame
from .streams import Sample, known_topic

if TYPE_CHECKING:
    from .client import Client

PHYSICS_HZ = 240
TICKS_PER_CONTROL = 4
CONTROL_HZ = 60
#: Silence after which the server is asked what time waits for, s.
_SILENCE = 1.0


class Ended(WheelArmError):
    """The episode has ended, though this program did not ask for it.

    Attributes:
        stopped: What the server said at its end; `cause` tells why.
    """

    def __init__(self, stopped: v1.EpisodeStopped) -> None:
        why = stopped.anomalies[-1] if stopped.anomalies else "somebody else ended it"
        super().__init__(f"the episode has ended: {why}")
        self.stopped = stopped


@dataclass(frozen=True)
class Moment:
    """What is known at one control tick.

    Attributes:
        header: Its stamp.
        samples: Newest sample of every topic that was asked for, by topic.
        frames: Newest picture of every camera that was asked for, by camera.
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
            KeyError: when none has come; is the topic asked for, and its rate not 0?
        """
        return self.samples[topic].message


class LockStep:
    """A running episode in lock-step. Every `step` answers the present control tick and
    returns the next one that is to be answered. Leaving the context ends the episode.

    Attributes:
        now: What is known at the present tick.
        started: What the server said at the beginning.
        patience: How long nothing may come before a step gives up, wall time, s.
    """

    def __init__(
        self,
        client: Client,
        name: str,
        label: str,
        *,
        topics: tuple[str, ...],
        cameras: tuple[str, ...],
        take: bool,
        recorders: int,
        instruction: str | None,
    ) -> None:
        self._client = client
        self.patience = 120.0
        self._queue: queue.SimpleQueue[tuple[str, zenoh.Sample]] = queue.SimpleQueue()
        self._subscribers: list[Any] = []
        self._newest: dict[str, zenoh.Sample] = {}
        # Topics of which only the newest sample counts: kept by the transport, so that
        # what passes between two answers costs this interpreter nothing.
        self._kept: dict[str, Any] = {}
        self._frames: dict[str, Frame] = {}
        self._running = False
        self._target: int | None = None
        self._heard = time.monotonic()
        self.commander = client.commander(name, take=take)
        try:
            self._periods = self._camera_periods(cameras)
            steering = {"clock", "refusal", "episode_stop"}
            for topic in set(map(known_topic, topics)) - steering:
                self._kept[topic] = client._session.declare_subscriber(
                    client._topic_key(topic), zenoh.handlers.RingChannel(1)
                )
            for topic in steering:
                self._subscribe(topic, client._topic_key(topic))
            for camera in cameras:
                self._subscribe("camera/" + camera, client._key(f"camera/{camera}"))
            self.started = client.start_episode(
                label, instruction=instruction, recorders=recorders, commander=name
            )
            self._running = True
            self.now = self._until(int(self.started.header.tick))
        except BaseException:
            self.close()
            raise

    def _camera_periods(self, cameras: tuple[str, ...]) -> dict[str, int]:
        """Ticks between two pictures of each camera."""
        if not cameras:
            return {}
        settings = {one.name: one for one in self._client.status().scenario.cameras}
        periods = {}
        for camera in cameras:
            setting = settings.get(camera)
            rate = 10.0 if setting is None or not setting.HasField("rate_hz") else setting.rate_hz
            if setting is None or rate <= 0.0:
                raise ValueError(
                    f"the camera {camera!r} is not in use (in use: "
                    f"{', '.join(settings) or 'none'}): ask for it with reset(cameras=...)"
                )
            periods[camera] = round(PHYSICS_HZ / rate)
        return periods

    def _subscribe(self, name: str, key: str) -> None:
        put = self._queue.put

        def taken(sample: zenoh.Sample) -> None:
            if name != "clock" or self._is_awaited(sample):
                put((name, sample))

        self._subscribers.append(self._client._session.declare_subscriber(key, direct(taken)))

    def _is_awaited(self, clock: zenoh.Sample) -> bool:
        """Whether a clock is more than a sign of life: the ticks for which an answer
        stands pass without waking who waits for its end."""
        if self._target is None or not self._client._speaker.sent(clock):
            return True
        try:
            tick = int(v1.Clock.FromString(clock.payload.to_bytes()).header.tick)
        except Exception:
            return True  # Who waits says what is wrong with it.
        if tick < self._target:
            self._heard = time.monotonic()
            return False
        return True

    @property
    def episode(self) -> int:
        """Number of the episode (no unit)."""
        return int(self.started.header.episode)

    def step(self, asked: v1.Command) -> Moment:
        """Answers the present tick and waits for the next one that is to be answered.

        Args:
            asked: The command; with ``over_ticks`` it stands for so many control ticks.

        Raises:
            Refused: when the command is not taken; the tick is not answered then.
            Ended: when somebody else, or broken physics, has ended the episode.
            Silent: when nothing comes; with what time waits for.
        """
        self.send(asked)
        return self.receive()

    def send(self, asked: v1.Command) -> None:
        """The first half of `step`: sends the answer and does not wait."""
        self._target = self.now.tick + TICKS_PER_CONTROL * max(int(asked.over_ticks), 1)
        self.commander.send(asked, header=self.now.header)

    def receive(self) -> Moment:
        """The second half of `step`: waits for the next tick that is to be answered."""
        assert self._target is not None, "send comes first"
        self.now = self._until(self._target)
        return self.now

    def _until(self, target: int) -> Moment:
        """Takes what comes until the clock of a tick, and the pictures due by then."""
        self._heard = time.monotonic()
        header: v1.Header | None = None
        asked: set[str] = set()
        while True:
            if header is not None and self._taken(asked) and not self._owing(header.tick):
                break
            try:
                name, sample = self._queue.get(timeout=_SILENCE)
            except queue.Empty:
                header = self._asked_status(target, header)
                continue
            if not self._client._speaker.sent(sample):
                continue
            self._heard = time.monotonic()
            if name == "clock":
                clock = read(v1.Clock, sample.payload.to_bytes(), name).header
                if clock.episode == self.episode and clock.tick >= target:
                    header = clock
            elif name == "refusal":
                refusal = read(v1.Refusal, sample.payload.to_bytes(), name)
                if refusal.commander == self.commander.name:
                    raise Refused("command", refusal.code, refusal.reason)
            elif name == "episode_stop":
                stopped = read(v1.EpisodeStopped, sample.payload.to_bytes(), name)
                if stopped.header.episode == self.episode:
                    self._running = False
                    raise Ended(stopped)
            elif name.startswith("camera/"):
                frame = Frame.of(sample.payload.to_bytes())
                if frame.header.episode == self.episode:
                    self._frames[name[7:]] = frame
            self._newest[name] = sample
        samples = {
            name: Sample(name, sample.payload.to_bytes())
            for name, sample in self._newest.items()
            if not name.startswith("camera/")
        }
        return Moment(header, samples, dict(self._frames))

    def _taken(self, asked: set[str]) -> bool:
        """Takes the newest sample of every topic; time waits, so that none comes after.
        Where somebody else's has taken its place, the server is asked for its own, once:
        who was asked about stands in ``asked``."""
        whole = True
        for topic, subscriber in self._kept.items():
            sample = subscriber.try_recv()
            if sample is None:
                continue
            if self._client._speaker.sent(sample):
                self._newest[topic] = sample
            elif topic not in asked:
                asked.add(topic)
                self.ask_again(topic)
                whole = False
        return whole

    def _owing(self, tick: int) -> list[str]:
        """Cameras whose picture that is due by a tick has not come."""
        owing = []
        for camera, period in self._periods.items():
            due = tick - tick % period
            frame = self._frames.get(camera)
            if due >= self.started.header.tick and (frame is None or frame.tick < due):
                owing.append(camera)
        return owing

    def ask_again(self, name: str) -> None:
        """Asks the server's cache for the newest sample of a topic, or of ``camera/NAME``:
        one that was lost on the way. It is taken like one that comes late."""
        key = self._client._key(name) if "/" in name else self._client._topic_key(name)
        replies = self._client._session.get(
            f"{key}/@adv/**?_max=1",
            accept_replies=zenoh.ReplyKeyExpr.ANY,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=5.0,
        )
        for reply in replies:
            if reply.ok is not None and str(reply.ok.key_expr) == key:
                self._queue.put((name, reply.ok))

    def _asked_status(self, target: int, header: v1.Header | None) -> v1.Header | None:
        """What silence means: a clock may have been lost on the way."""
        if self._client.is_closed:
            raise Gone("the client is closed")
        status = self._client.status()
        if status.episode.header.episode != self.episode:
            stopped = v1.EpisodeStopped()
            for one in self._client.ask(v1.EpisodeRequest()).ended:
                if one.header.episode == self.episode:
                    stopped = one
            self._running = False
            raise Ended(stopped)
        if header is not None:
            # A picture may have been lost on the way; the server still has it.
            for camera in self._owing(header.tick):
                self.ask_again("camera/" + camera)
        if header is None and status.header.tick >= target and not status.paused:
            return status.header
        if time.monotonic() - self._heard > self.patience:
            missing = "pictures of the cameras" if header is not None else f"tick {target}"
            raise Silent(
                f"waited {self.patience:.0f} s for {missing}; the server says: "
                f"{status.waiting_for or 'time goes on'}"
            )
        return header

    def stop(self, *, discard: bool = False) -> v1.EpisodeStopped:
        """Ends the episode and gives control back."""
        try:
            stopped = self._client.stop_episode(discard=discard, episode=self.episode)
            self._running = False
            return stopped
        finally:
            self.close()

    def close(self) -> None:
        """Ends the episode where it runs, and gives control back."""
        if self._running:
            self._running = False
            try:
                self._client.stop_episode(episode=self.episode)
            except WheelArmError:
                pass
        for subscriber in [*self._subscribers, *self._kept.values()]:
            subscriber.undeclare()
        self._subscribers, self._kept = [], {}
        self.commander.close()

    def __enter__(self) -> LockStep:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
