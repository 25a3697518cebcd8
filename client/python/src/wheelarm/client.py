"""A connection to one server: queries, streams, pictures, control."""

from __future__ import annotations

import os
import time
import weakref
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

import zenoh

from . import v1
from ._contract import QUERIES
from ._session import (
    DEFAULT_ENDPOINT,
    PREFIX,
    Speaker,
    open_session,
    refuse_fork,
    words,
)
from ._wire import TOPIC, check_encoding, check_name, encoding, read
from .commander import Commander
from .errors import Gone, OtherVersion, Refused, Silent, WheelArmError
from .lockstep import LockStep
from .streams import Camera, Streams, known_topic

_OF_REQUEST = {row[1]: row for row in QUERIES}
#: Longest wait for an answer, s: a reset loads a scene and may build pipelines.
_PATIENCE = {"reset": 120.0, "episode_start": 120.0, "episode_stop": 120.0}


def connect(endpoint: str = DEFAULT_ENDPOINT, sim: str = "sim", *, timeout: float = 5.0) -> Client:
    """Connects to a server and makes sure that both speak the same contract.

    Args:
        endpoint: Where it listens, for example ``tcp/127.0.0.1:7447``.
        sim: Its name; several servers can share one network.
        timeout: Longest wait, s.

    Raises:
        NoServer: when nobody listens.
        OtherName: when the server has another name.
        OtherVersion: when it speaks another version of the contract.
    """
    return Client(endpoint, sim, timeout=timeout)


class _Closable(Protocol):
    def close(self) -> None: ...


class Client:
    """A connection to one server. Close it, or use it as a context manager.

    Only what the server's own session says is taken.
    """

    def __init__(
        self, endpoint: str = DEFAULT_ENDPOINT, sim: str = "sim", *, timeout: float = 5.0
    ) -> None:
        check_name(sim)
        deadline = time.monotonic() + timeout
        self.endpoint, self.sim = endpoint, sim
        self._session = open_session(endpoint, timeout)
        self._owner = os.getpid()
        #: Subscriptions and commanders that are open, in the order in which they were opened.
        self._open: dict[int, _Closable] = {}
        self._secret = ""
        # A session that is still open at the end of the program is closed before the
        # transport's own threads go.
        self._finalizer = weakref.finalize(self, _close_session, self._session, self._owner)
        try:
            self._speaker = Speaker(self._session, sim)
            self._speaker.wait(endpoint, deadline)
            self._meet()
        except BaseException:
            self._finalizer()
            raise

    def _meet(self) -> None:
        """Tells another version now; a server that is silent is told when it is asked."""
        try:
            self.ask(v1.StatusRequest(), timeout=2.0)
        except OtherVersion:
            raise
        except Refused as refused:
            if refused.code == v1.FAILURE_CODE_VERSION:
                raise OtherVersion(refused.message) from None
        except WheelArmError:
            pass

    def _opened(self, one: _Closable) -> None:
        """Closes `one` with this connection, unless it is closed before."""
        self._open[id(one)] = one

    def _closed(self, one: _Closable) -> None:
        """Forgets `one`, which has been closed."""
        self._open.pop(id(one), None)

    # -- keys ------------------------------------------------------------------------

    def _key(self, rest: str) -> str:
        return f"{PREFIX}/{self.sim}/{rest}"

    def _topic_key(self, topic: str) -> str:
        return self._key(str(TOPIC[known_topic(topic)][1]))

    # -- queries ---------------------------------------------------------------------

    def ask(self, request: Any, *, timeout: float | None = None) -> Any:
        """Asks a query of `service Simulation`; its request names it:
        ``client.ask(v1.StatusRequest())`` is a `v1.Status`.

        Raises:
            Refused: with the server's code and words.
            Silent: when no answer comes in time.
            Gone: when nobody is there any more who could answer.
        """
        refuse_fork(self._owner)
        name, asked, reply, field = _OF_REQUEST[type(request).DESCRIPTOR.name]
        key = f"query/{name}"
        if field:
            key += "/" + check_name(getattr(request, field))
        patience = timeout if timeout is not None else _PATIENCE.get(name, 20.0)
        self._speaker.look()
        begun = time.monotonic()
        try:
            replies = self._session.get(
                self._key(key),
                payload=request.SerializeToString(),
                encoding=encoding(asked),
                source_info=zenoh.SourceInfo(self._session.id, 0),
                # Strangers can answer as well: all are asked, and the server's answer is
                # taken, neither held back nor displaced by another.
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                priority=zenoh.Priority.INTERACTIVE_HIGH,
                express=True,
                timeout=patience,
            )
            for answer in replies:
                if not self._speaker.answered(answer):
                    continue
                if answer.ok is not None:
                    check_encoding(str(answer.ok.encoding))
                    return read(getattr(v1, reply), answer.ok.payload.to_bytes(), name)
                told = answer.err.payload.to_bytes() if answer.err else b""
                failure = read(v1.Failure, told, name)
                if failure.message:
                    raise Refused(name, failure.code, failure.message)
        except zenoh.ZError as cause:
            raise Gone(f"asking `{name}` failed: {words(cause)}") from None
        took = time.monotonic() - begun
        if took >= 0.9 * patience:
            raise Silent(f"the server {self.sim!r} did not answer `{name}` within {patience:.1f} s")
        # The end of the server's token may come right behind that of the query.
        known = time.monotonic()
        while self._speaker.is_there() and time.monotonic() - known < 0.5:
            time.sleep(0.01)
        if self._speaker.is_there():
            raise Silent(
                f"the server {self.sim!r} is there, but `{name}` ended after {took:.1f} s "
                "without an answer: ask again"
            )
        raise Gone(f"the server {self.sim!r} has gone: nobody answers `{name}` any more")

    def status(self) -> v1.Status:
        """State of everything: scenario, pacing, episode, who is in control, what time
        waits for."""
        return self.ask(v1.StatusRequest())

    def scene(self) -> v1.SceneReply:
        """What stands in the home: bodies, grasps, instance ids, goal, and the robot."""
        return self.ask(v1.SceneRequest())

    def tasks(self) -> list[v1.TaskInfo]:
        """The library of tasks."""
        return list(self.ask(v1.TasksRequest()).tasks)

    def reach(self, pose: v1.Pose, near_joints: Iterable[float] = (), **more: Any) -> v1.ReachReply:
        """Whether the end effector can reach a pose in `base_link`, metres.

        Args:
            near_joints: Joint positions near which a solution is looked for, radians.
            more: Other fields of `v1.ReachRequest`.
        """
        return self.ask(v1.ReachRequest(pose=pose, near_joints=list(near_joints), **more))

    def reset(
        self,
        scenario: v1.Scenario | Mapping[str, Any] | None = None,
        *,
        snapshot: bytes = b"",
        force: bool = False,
        **fields: Any,
    ) -> v1.Scenario:
        """Sets up a scenario: ``client.reset(task="pick_bowl", seed=7)``. What is absent
        takes the value in force; see `v1.Scenario` for all fields.

        Args:
            scenario: The scenario; `fields` take the place of its own.
            snapshot: A state to continue from (bytes of `v1.SnapshotReply`).
            force: Also while somebody else is in control.

        Returns:
            The scenario in force, with the drawn values.
        """
        asked = v1.Scenario()
        if isinstance(scenario, v1.Scenario):
            asked.CopyFrom(scenario)
        elif scenario is not None:
            fields = {**scenario, **fields}
        asked.MergeFrom(scenario_of(**fields))
        request = v1.ResetRequest(
            scenario=asked, snapshot=snapshot, force=force, secret=self._secret
        )
        return self.ask(request).scenario

    def start_episode(
        self,
        label: str,
        *,
        instruction: str | None = None,
        recorders: int = 0,
        commander: str = "",
    ) -> v1.EpisodeStarted:
        """Begins an episode.

        Args:
            label: Name of its file: letters, digits, ``-``, ``_``, ``.``; 1 to 100.
            instruction: Sentence to be stored; the scenario's where absent.
            recorders: Recorders that must be ready before time goes on (count).
            commander: In lock-step whom time waits for; who is in control where empty.
        """
        request = v1.EpisodeStartRequest(
            label=label, require_recorders=recorders, commander=commander
        )
        if instruction is not None:
            request.instruction = instruction
        return self.ask(request)

    def stop_episode(
        self, *, discard: bool = False, episode: int | None = None, force: bool = False
    ) -> v1.EpisodeStopped:
        """Ends the running episode and returns its manifest.

        Args:
            discard: Recorders throw it away.
            episode: Number of the episode that is meant; whichever runs where absent.
            force: Discards although somebody else is in control.
        """
        request = v1.EpisodeStopRequest(discard=discard, force=force, secret=self._secret)
        if episode is not None:
            request.episode = episode
        return self.ask(request)

    def pause(self) -> None:
        """Pauses time."""
        self.ask(v1.PauseRequest())

    def resume(self) -> None:
        """Lets time go on."""
        self.ask(v1.ResumeRequest())

    def snapshot(self) -> v1.SnapshotReply:
        """State, assets and instance ids at the first tick of the running episode."""
        return self.ask(v1.SnapshotRequest())

    def shutdown(self, *, force: bool = False) -> None:
        """Ends the server."""
        self.ask(v1.ShutdownRequest(force=force, secret=self._secret))

    # -- streams ---------------------------------------------------------------------

    def streams(self, *topics: str) -> Streams:
        """Subscribes to topics: ``for sample in client.streams("joint_state", "clock")``.

        Raises:
            ValueError: with the topics that there are.
        """
        refuse_fork(self._owner)
        return Streams(self, [known_topic(topic) for topic in topics])

    def cameras(self) -> list[str]:
        """Names of the cameras that are in use."""
        cameras = self.status().scenario.cameras
        return [one.name for one in cameras if not one.HasField("rate_hz") or one.rate_hz > 0.0]

    def camera(self, name: str, *, kept: int = 1) -> Camera:
        """Subscribes to a camera; the newest `kept` pictures wait to be taken.

        Raises:
            ValueError: with the cameras in use when it is none of them.
        """
        found = self.cameras()
        if name not in found:
            raise ValueError(
                f"the camera {name!r} is not in use (in use: {', '.join(found) or 'none'}): "
                "choose one of them, or ask for it with reset(cameras=...) or when the server "
                "starts"
            )
        return Camera(self, self._key(f"camera/{check_name(name)}"), kept)

    def sensor(self, name: str, *, kept: int = 1) -> Camera:
        """Subscribes to what a sensor model makes, for example ``gen3_depth``."""
        refuse_fork(self._owner)
        return Camera(self, self._key(f"sensor/{check_name(name)}"), kept)

    # -- control ---------------------------------------------------------------------

    def commander(self, name: str, *, take: bool = False, sealed: bool = True) -> Commander:
        """Takes control under a name.

        Args:
            name: Letters, digits, ``-``, ``_``; 1 to 64.
            take: From whoever holds it.
            sealed: Commands carry a seal, so that nobody else can command in its name.

        Raises:
            Refused: with the holder's name.
        """
        refuse_fork(self._owner)
        return Commander(self, name, take=take, sealed=sealed)

    def lockstep(
        self,
        name: str = "python",
        label: str = "python",
        *,
        topics: Iterable[str] = ("joint_state", "pose", "odometry", "evaluation"),
        cameras: Iterable[str] = (),
        take: bool = False,
        recorders: int = 0,
        instruction: str | None = None,
    ) -> LockStep:
        """Begins an episode in lock-step, in which time waits for this program.

        Args:
            name: Commander's name.
            label: Name of the episode's file.
            topics: Topics whose newest sample every step returns.
            cameras: Cameras whose newest picture every step returns.
            take: Takes control from whoever holds it.
            recorders: Recorders that must be ready (count).
            instruction: Sentence to be stored; the scenario's where absent.

        Raises:
            Refused: when the pacing is not lock-step, or an episode runs.
        """
        refuse_fork(self._owner)
        return LockStep(
            self,
            name,
            label,
            topics=tuple(topics),
            cameras=tuple(cameras),
            take=take,
            recorders=recorders,
            instruction=instruction,
        )

    # -- end -------------------------------------------------------------------------

    @property
    def is_closed(self) -> bool:
        """Whether the connection has been closed."""
        return not self._finalizer.alive or bool(self._session.is_closed())

    def close(self) -> None:
        """Closes the connection; control ends with it."""
        if self._finalizer.alive and self._owner == os.getpid():
            for one in reversed(list(self._open.values())):
                try:
                    one.close()
                except (zenoh.ZError, WheelArmError):
                    pass
        self._open.clear()
        self._finalizer()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Client({self.endpoint!r}, sim={self.sim!r})"


def _close_session(session: zenoh.Session, owner: int) -> None:
    if owner == os.getpid():
        session.close()


def camera_setting(name: str, width: int, height: int, rate_hz: float = 10.0) -> v1.CameraSetting:
    """A camera of a scenario: ``*`` stands for each of the robot's that is not named,
    ``room`` for the one that stands in the home. Pixels, 16 to 4096 each way, and Hz; rate
    0 is off."""
    return v1.CameraSetting(name=name, width=width, height=height, rate_hz=rate_hz)


_WORDS = {"pacing": "PACING_", "quality": "RENDER_QUALITY_", "starts": "STARTS_"}


def scenario_of(**fields: Any) -> v1.Scenario:
    """A scenario from its fields; pacing, quality and starts also by name:
    ``scenario_of(task="pick_bowl", pacing="lock-step", starts="anywhere")``.

    Raises:
        ValueError: when a field or a name is not known.
    """
    for field, prefix in _WORDS.items():
        value = fields.get(field)
        if isinstance(value, str):
            fields[field] = getattr(v1, prefix + value.upper().replace("-", "_"), None)
            if fields[field] is None:
                raise ValueError(f"{field}={value!r} is not known; see wheelarm.v1.Scenario")
    if fields.get("cameras") is not None:
        cameras = fields["cameras"]
        if isinstance(cameras, Mapping):
            cameras = [camera_setting(name, *size) for name, size in cameras.items()]
        fields["cameras"] = cameras
    try:
        return v1.Scenario(**{key: value for key, value in fields.items() if value is not None})
    except (ValueError, TypeError) as cause:
        known = ", ".join(field.name for field in v1.Scenario.DESCRIPTOR.fields)
        raise ValueError(f"no scenario has these fields ({cause}); there are {known}") from None
