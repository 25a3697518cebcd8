"""Connection to one server: session, keys, queries, and what is closed with it.

`Client`, `Commander`, `LockStep` and the streams build on this module.
"""

from __future__ import annotations

import os
import time
import weakref
from typing import Any, Protocol

import zenoh

from . import v1
from ._contract import PREFIX, QUERIES
from ._session import (
    DEFAULT_ENDPOINT,
    ServerIdentity,
    open_session,
    refuse_fork,
    transport_message,
)
from ._wire import TOPIC, check_encoding, check_name, check_topic, encoding, read
from .errors import GoneError, OtherVersionError, RefusedError, SilentError, WheelArmError

_BY_REQUEST = {row[1]: row for row in QUERIES}
#: Time limits of slow queries, s: a reset loads a scene and may build pipelines.
_TIMEOUT = {"reset": 120.0, "episode_start": 120.0, "episode_stop": 120.0}


class Closable(Protocol):
    """A subscription or a commander."""

    def close(self) -> None:
        """Ends it."""


class Connection:
    """A connection to one server, the base of `Client`. Samples and replies of other
    sessions are dropped.

    Attributes:
        endpoint: Endpoint of the server.
        sim: Name of the server.
    """

    def __init__(
        self, endpoint: str = DEFAULT_ENDPOINT, sim: str = "sim", *, timeout: float = 5.0
    ) -> None:
        check_name(sim)
        deadline = time.monotonic() + timeout
        self.endpoint, self.sim = endpoint, sim
        self._session = open_session(endpoint, timeout)
        self._owner = os.getpid()
        #: Open subscriptions and commanders, in the order of their opening.
        self._open: dict[int, Closable] = {}
        self._secret = ""
        # Closes the session at the end of the program before the transport's threads end.
        self._finalizer = weakref.finalize(self, _close_session, self._session, self._owner)
        try:
            self._server = ServerIdentity(self._session, sim)
            self._server.wait(endpoint, deadline)
            self._check_version()
        except BaseException:
            self._finalizer()
            raise

    def _check_version(self) -> None:
        """Reports another version at once. A silent server is reported by the first request."""
        try:
            self.request(v1.StatusRequest(), timeout=2.0)
        except OtherVersionError:
            raise
        except RefusedError as refused:
            if refused.code == v1.FAILURE_CODE_VERSION:
                raise OtherVersionError(refused.message) from None
        except WheelArmError:
            pass

    def _register(self, opened: Closable) -> None:
        """Closes `opened` together with this connection."""
        self._open[id(opened)] = opened

    def _unregister(self, closed: Closable) -> None:
        """Forgets `closed`."""
        self._open.pop(id(closed), None)

    def _key(self, rest: str) -> str:
        return f"{PREFIX}/{self.sim}/{rest}"

    def _topic_key(self, topic: str) -> str:
        return self._key(str(TOPIC[check_topic(topic)][1]))

    def request(self, request: Any, *, timeout: float | None = None) -> Any:
        """Sends a query of `service Simulation`; the type of the request selects it:
        ``client.request(v1.StatusRequest())`` returns a `v1.Status`.

        Args:
            request: The request.
            timeout: Time limit, s; the usual one of the query if absent.

        Raises:
            RefusedError: when the server rejects the request.
            SilentError: when no reply arrives within the time limit.
            GoneError: when the server or the connection has ended.
        """
        refuse_fork(self._owner)
        name, request_type, reply_type, field = _BY_REQUEST[type(request).DESCRIPTOR.name]
        key = f"query/{name}"
        if field:
            key += "/" + check_name(getattr(request, field))
        limit = timeout if timeout is not None else _TIMEOUT.get(name, 20.0)
        self._server.refresh()
        started = time.monotonic()
        try:
            replies = self._session.get(
                self._key(key),
                payload=request.SerializeToString(),
                encoding=encoding(request_type),
                source_info=zenoh.SourceInfo(self._session.id, 0),
                # Other sessions may reply too. All replies are received, so that no other
                # session can delay or displace the reply of the server.
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                priority=zenoh.Priority.INTERACTIVE_HIGH,
                express=True,
                timeout=limit,
            )
            for reply in replies:
                if not self._server.sent(reply):
                    continue
                if reply.ok is not None:
                    check_encoding(str(reply.ok.encoding))
                    return read(getattr(v1, reply_type), reply.ok.payload.to_bytes(), name)
                payload = reply.err.payload.to_bytes() if reply.err else b""
                failure = read(v1.Failure, payload, name)
                if failure.message:
                    raise RefusedError(name, failure.code, failure.message)
        except zenoh.ZError as cause:
            raise GoneError(f"the query `{name}` failed: {transport_message(cause)}") from None
        elapsed = time.monotonic() - started
        if elapsed >= 0.9 * limit:
            # The text of `LinkError::Silent` of the Rust SDK.
            raise SilentError(f"the server {self.sim!r} did not answer `{name}` within {limit:g} s")
        # The end of the server's token may arrive shortly after the end of the query.
        ended = time.monotonic()
        while self._server.is_alive() and time.monotonic() - ended < 0.5:
            time.sleep(0.01)
        if self._server.is_alive():
            raise SilentError(
                f"the server {self.sim!r} is there, but `{name}` ended after {elapsed:.1f} s "
                "without an answer: it is overloaded, or it has just restarted; request again. "
                "With keys: the user may lack the right (`wheelarm doctor` shows it)"
            )
        raise GoneError(
            f"the server {self.sim!r} has gone: `{name}` got no reply (after {elapsed:.1f} s); "
            "its log states why"
        )

    def status(self) -> v1.Status:
        """State of the server: scenario, pacing, episode, client in control, and what time
        waits for."""
        return self.request(v1.StatusRequest())

    def start_episode(
        self,
        label: str,
        *,
        instruction: str | None = None,
        recorders: int = 0,
        commander: str = "",
    ) -> v1.EpisodeStarted:
        """Starts an episode.

        Args:
            label: Name of its file: letters, digits, ``-``, ``_``, ``.``; 1 to 100.
            instruction: Sentence that is stored; the scenario's if absent.
            recorders: Recorders that must be ready before time runs (count).
            commander: In lock-step, the commander that time waits for; the one in control
                if empty.
        """
        request = v1.EpisodeStartRequest(
            label=label, require_recorders=recorders, commander=commander
        )
        if instruction is not None:
            request.instruction = instruction
        return self.request(request)

    def stop_episode(
        self, *, discard: bool = False, episode: int | None = None, force: bool = False
    ) -> v1.EpisodeStopped:
        """Ends the running episode and returns its manifest.

        Args:
            discard: Recorders delete it.
            episode: Number of the episode; the running one if absent.
            force: Discards it even if another client is in control.
        """
        request = v1.EpisodeStopRequest(discard=discard, force=force, secret=self._secret)
        if episode is not None:
            request.episode = episode
        return self.request(request)

    @property
    def is_closed(self) -> bool:
        """Whether the connection has been closed."""
        return not self._finalizer.alive or bool(self._session.is_closed())

    def close(self) -> None:
        """Closes the connection, which releases control."""
        if self._finalizer.alive and self._owner == os.getpid():
            for opened in reversed(list(self._open.values())):
                try:
                    opened.close()
                except (zenoh.ZError, WheelArmError):
                    pass
        self._open.clear()
        self._finalizer()

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.endpoint!r}, sim={self.sim!r})"


def _close_session(session: zenoh.Session, owner: int) -> None:
    if owner == os.getpid():
        session.close()
