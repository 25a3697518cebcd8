"""The zenoh session: one client of one server, never across a fork.

Nothing here knows what is simulated.
"""

from __future__ import annotations

import json
import math
import os
import pathlib
import threading
import time
from collections.abc import Callable
from typing import Any

import zenoh

from ._wire import check_name
from .errors import Forked, NoServer, OtherName

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
PREFIX = "wheelarm"

#: By what the transport learns how many threads it has, and one for both directions.
THREADS_VARIABLE = "ZENOH_RUNTIME"
ONE_THREAD = "(rx: (worker_threads: 1), tx: (handover: rx))"

#: This process has opened a session; a child of it that was forked can open none.
_opened = False
_forked = False


def _after_fork() -> None:
    global _forked
    _forked = _forked or _opened


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def refuse_fork(owner: int | None = None) -> None:
    """Refuses to go on in a forked child, where the transport would hang for ever.

    Raises:
        Forked: with the cure.
    """
    if _forked or (owner is not None and owner != os.getpid()):
        raise Forked(
            "this process was forked after a connection to a server had been opened, and the "
            "transport's threads do not survive a fork: start workers with another method, "
            'for example AsyncVectorEnv(..., context="forkserver") or '
            'multiprocessing.get_context("spawn"), or open no connection before the fork; '
            "wheelarm.WheelArmVectorEnv needs no workers at all"
        )


def words(cause: BaseException) -> str:
    """The transport's words without the place in its source."""
    return str(cause).split(" at /", maxsplit=1)[0]


def keys_of_environment(endpoint: str) -> dict[str, Any]:
    """The settings for an endpoint that takes keys, which ``WHEELARM_KEYS`` names, and
    ``WHEELARM_USER`` where that is a folder of several users' keys.

    Raises:
        NoServer: when the endpoint takes keys, and there are none.
    """
    if not endpoint.startswith("tls/"):
        return {}
    folder, user = os.environ.get("WHEELARM_KEYS"), os.environ.get("WHEELARM_USER")
    if folder is None:
        raise NoServer(
            f"{endpoint} takes keys: name the folder that you were given with WHEELARM_KEYS"
        )
    path = pathlib.Path(folder)
    if user is not None and (path / "users").is_dir():
        path = path / "users" / user
    files = {
        "root_ca_certificate": path / "ca.pem",
        "connect_certificate": path / "user.pem",
        "connect_private_key": path / "user.key",
    }
    for file in files.values():
        if not file.is_file():
            raise NoServer(f"{path} holds no {file.name}: name the folder that you were given")
    names = {name: str(file) for name, file in files.items()}
    return {"transport/link/tls": {**names, "enable_mtls": True, "verify_name_on_connect": True}}


def open_session(endpoint: str, timeout: float) -> zenoh.Session:
    """Connects to an endpoint.

    Raises:
        NoServer: when nobody listens until the time is over.
        Forked: in a forked child.
    """
    global _opened
    refuse_fork()
    wait = min(max(timeout, 0.1), 86_400.0) if math.isfinite(timeout) else 86_400.0
    config = zenoh.Config()
    settings = {
        "mode": "client",
        # Signs of life come every two and a half seconds either way.
        "transport/link/tx/lease": 10_000,
        "transport/link/tx/keep_alive": 4,
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": round(wait * 1e3),
        "connect/exit_on_failure": True,
        "connect/retry": {
            "period_init_ms": 100,
            "period_max_ms": 500,
            "period_increase_factor": 2,
        },
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        **keys_of_environment(endpoint),
    }
    try:
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
    except zenoh.ZError as cause:
        raise ValueError(
            f"{endpoint!r} is no endpoint: write it as tcp/127.0.0.1:7447 ({words(cause)})"
        ) from None
    # One thread sends and receives where TLS is spoken: from two the transport breaks its
    # memory when a connection ends (eclipse-zenoh/zenoh#2557). It looks once, before a
    # process's first session.
    speaks_tls = endpoint.startswith("tls/") or "WHEELARM_KEYS" in os.environ
    tells = speaks_tls and not _opened and THREADS_VARIABLE not in os.environ
    if tells:
        os.environ[THREADS_VARIABLE] = ONE_THREAD
    _opened = True
    try:
        return zenoh.open(config)
    except zenoh.ZError as cause:
        raise NoServer(
            f"no server answers at {endpoint} (waited {wait:.1f} s): start one with "
            "`wheelarm-server` or `wheelarm.Server()`, or name its address "
            f"({words(cause)})"
        ) from None
    finally:
        if tells:
            os.environ.pop(THREADS_VARIABLE, None)


def direct(taken: Callable[[Any], Any]) -> Any:
    """A callback on the thread that receives: what comes keeps its order over all
    subscribers. It must not work."""
    return zenoh.handlers.Callback(taken, indirect=False)


class Speaker:
    """Who speaks for a server: the session whose id stands in its liveliness token.
    What others publish or answer under its keys is not taken."""

    def __init__(self, session: zenoh.Session, sim: str) -> None:
        self._session, self._sim = session, check_name(sim)
        self._lock = threading.Lock()
        self._tokens: list[str] = []
        self._chosen: str | None = None
        self._direct = False
        self._subscriber = session.liveliness().declare_subscriber(
            f"{PREFIX}/{sim}/alive/*", direct(self._heard), history=True
        )

    def _heard(self, sample: zenoh.Sample) -> None:
        zid = str(sample.key_expr).rsplit("/", 1)[1]
        with self._lock:
            if zid in self._tokens:
                self._tokens.remove(zid)
            if sample.kind == zenoh.SampleKind.PUT:
                self._tokens.append(zid)

    def look(self) -> None:
        """Looks again who the server is, after it came, went or was restarted."""
        if self.is_there():
            return
        info = self._session.info
        connected = {str(zid) for zid in [*info.routers_zid(), *info.peers_zid()]}
        with self._lock:
            dialled = next((zid for zid in self._tokens if zid in connected), None)
            if dialled is not None:
                self._chosen, self._direct = dialled, True
            elif len(self._tokens) == 1 and not self._direct:
                # Behind a router, the only one there is.
                self._chosen = self._tokens[0]

    def is_there(self) -> bool:
        """Whether the server's token is there."""
        with self._lock:
            return self._chosen is not None and self._chosen in self._tokens

    def wait(self, endpoint: str, deadline: float) -> None:
        """Waits for the server's token.

        Raises:
            OtherName: when there is none of that name, or more than one.
        """
        while True:
            self.look()
            if self.is_there():
                return
            if time.monotonic() >= deadline:
                break
            time.sleep(0.01)
        with self._lock:
            tokens = list(self._tokens)
        if len(tokens) > 1:
            raise OtherName(
                f"{len(tokens)} sessions behind {endpoint} say that they are the server "
                f"{self._sim!r} ({', '.join(tokens)}): connect to the server itself, or end "
                "the other"
            )
        replies = self._session.liveliness().get(f"{PREFIX}/*/alive/*", timeout=1.0)
        found = {str(reply.ok.key_expr).split("/")[1] for reply in replies if reply.ok}
        raise OtherName(
            f"somebody answers at {endpoint}, but no server is named {self._sim!r} (found: "
            f"{', '.join(sorted(found)) or 'none'}): choose one with sim=; where none is found, "
            "another program listens there, for example a ROS 2 router"
        )

    def sent(self, sample: zenoh.Sample) -> bool:
        """Whether the server published a sample."""
        source = sample.source_info
        return source is not None and str(source.source_id.zid) == self._chosen

    def answered(self, reply: zenoh.Reply) -> bool:
        """Whether the server gave a reply."""
        replier = reply.replier_id
        return replier is not None and str(replier.zid) == self._chosen
