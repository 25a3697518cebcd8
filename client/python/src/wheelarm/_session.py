"""The Zenoh session of one client, its guard against forks, and the server's identity.

This module does not depend on the simulation.
"""

from __future__ import annotations

import json
import math
import os
import pathlib
import re
import threading
import time
from collections.abc import Callable
from typing import Any

import zenoh

from ._contract import PREFIX
from ._wire import check_name
from .errors import ForkedError, NoServerError, OtherNameError

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"

#: Variable that sets the number of the transport's threads; one thread for both directions.
THREADS_VARIABLE = "ZENOH_RUNTIME"
ONE_THREAD = "(rx: (worker_threads: 1), tx: (handover: rx))"

#: This process has opened a session, so a forked child of it cannot open one.
_opened = False
_forked = False


def _after_fork() -> None:
    global _forked
    _forked = _forked or _opened


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def refuse_fork(owner: int | None = None) -> None:
    """Rejects use in a forked child, where the transport would hang forever.

    Args:
        owner: Process id of the session's owner.

    Raises:
        ForkedError: in a forked child.
    """
    if _forked or (owner is not None and owner != os.getpid()):
        raise ForkedError(
            "this process was forked after it had opened a connection to a server, and the "
            "transport's threads do not survive a fork: start workers with another method, "
            'for example AsyncVectorEnv(..., context="forkserver") or '
            'multiprocessing.get_context("spawn"), or open no connection before the fork; '
            "wheelarm.WheelArmVectorEnv needs no workers"
        )


def transport_message(cause: BaseException) -> str:
    """The transport's error message without the location in its source code."""
    return str(cause).split(" at /", maxsplit=1)[0]


def check_endpoint(endpoint: str) -> None:
    """Checks the syntax: ``tcp/HOST:PORT``, ``tls/HOST:PORT`` or ``unixsock-stream/PATH``,
    optionally with transport settings after ``#`` or ``?``.

    Raises:
        ValueError: when it is another text.
    """
    transport, _, rest = re.split("[#?]", endpoint)[0].partition("/")
    if transport in ("tcp", "tls"):
        host, _, port = rest.rpartition(":")
        bracketed = host.startswith("[") and host.endswith("]")
        named = host and "/" not in host and " " not in host and (bracketed or ":" not in host)
        valid = bool(named and re.fullmatch("[0-9]{1,5}", port) and int(port) < 1 << 16)
    else:
        valid = transport == "unixsock-stream" and rest != ""
    if not valid:
        # The text of `wheelarm_proto::endpoint::BadEndpoint`.
        raise ValueError(
            f"{endpoint!r} is not an endpoint: an endpoint is tcp/HOST:PORT, for example "
            "tcp/127.0.0.1:7447, tls/HOST:PORT with keys, or unixsock-stream/PATH"
        )


def tls_settings(endpoint: str) -> dict[str, Any]:
    """The TLS settings of an endpoint that requires keys, from the folder that
    ``WHEELARM_KEYS`` names. If that folder has several users, ``WHEELARM_USER`` selects one.

    Raises:
        NoServerError: when the endpoint requires keys, and a file is missing.
    """
    if not endpoint.startswith("tls/"):
        return {}
    folder, user = os.environ.get("WHEELARM_KEYS"), os.environ.get("WHEELARM_USER")
    if folder is None:
        raise NoServerError(
            f"{endpoint} takes keys: name the folder that you were given with WHEELARM_KEYS, or on "
            "the server's host its folder of keys with WHEELARM_KEYS and WHEELARM_USER"
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
            raise NoServerError(
                f"{path} holds no {file.name}: name the folder that you were given "
                "(WHEELARM_KEYS), or on the server's host its folder of keys with "
                "WHEELARM_USER, after `wheelarm keys user NAME`"
            )
    names = {name: str(file) for name, file in files.items()}
    return {"transport/link/tls": {**names, "enable_mtls": True, "verify_name_on_connect": True}}


def open_session(endpoint: str, timeout: float) -> zenoh.Session:
    """Connects to an endpoint.

    Args:
        endpoint: See `check_endpoint`.
        timeout: Time limit, s.

    Raises:
        ValueError: when the endpoint is invalid.
        NoServerError: when no server accepts the connection within the time limit.
        ForkedError: in a forked child.
    """
    global _opened
    refuse_fork()
    check_endpoint(endpoint)
    wait = min(max(timeout, 0.1), 86_400.0) if math.isfinite(timeout) else 86_400.0
    config = zenoh.Config()
    settings = {
        "mode": "client",
        # Both sides send a keep-alive every 2.5 s.
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
        **tls_settings(endpoint),
    }
    try:
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
    except zenoh.ZError as cause:
        raise ValueError(
            f"the endpoint {endpoint!r} has invalid settings ({transport_message(cause)}): "
            "write it as tcp/127.0.0.1:7447"
        ) from None
    # With TLS, one thread must send and receive: with two, the transport corrupts its memory
    # when a connection ends (eclipse-zenoh/zenoh#2557). Zenoh reads the variable once,
    # before the first session of a process.
    uses_tls = endpoint.startswith("tls/") or "WHEELARM_KEYS" in os.environ
    sets_variable = uses_tls and not _opened and THREADS_VARIABLE not in os.environ
    if sets_variable:
        os.environ[THREADS_VARIABLE] = ONE_THREAD
    _opened = True
    try:
        return zenoh.open(config)
    except zenoh.ZError as cause:
        raise NoServerError(
            f"no server answers at {endpoint} (waited {wait:.1f} s): start one with "
            "`wheelarm-server` or `wheelarm.Server()`, or name its address "
            f"({transport_message(cause)})"
        ) from None
    finally:
        if sets_variable:
            os.environ.pop(THREADS_VARIABLE, None)


def direct_callback(function: Callable[[Any], Any]) -> Any:
    """A callback on the receiving thread, so that samples keep their order across
    subscribers. It must return at once."""
    return zenoh.handlers.Callback(function, indirect=False)


class ServerIdentity:
    """Server identity: the Zenoh session id carried in the server's liveliness token.
    Samples and replies from any other session are dropped."""

    def __init__(self, session: zenoh.Session, sim: str) -> None:
        self._session, self._sim = session, check_name(sim)
        self._lock = threading.Lock()
        self._tokens: list[str] = []
        self._chosen: str | None = None
        self._direct = False
        self._subscriber = session.liveliness().declare_subscriber(
            f"{PREFIX}/{sim}/alive/*", direct_callback(self._update), history=True
        )

    def _update(self, sample: zenoh.Sample) -> None:
        zid = str(sample.key_expr).rsplit("/", 1)[1]
        with self._lock:
            if zid in self._tokens:
                self._tokens.remove(zid)
            if sample.kind == zenoh.SampleKind.PUT:
                self._tokens.append(zid)

    def refresh(self) -> None:
        """Selects the server's session again after the server started, ended or restarted."""
        if self.is_alive():
            return
        info = self._session.info
        connected = {str(zid) for zid in [*info.routers_zid(), *info.peers_zid()]}
        with self._lock:
            neighbor = next((zid for zid in self._tokens if zid in connected), None)
            if neighbor is not None:
                self._chosen, self._direct = neighbor, True
            elif len(self._tokens) == 1 and not self._direct:
                # Behind a router: the only server with this name.
                self._chosen = self._tokens[0]

    def is_alive(self) -> bool:
        """Whether the liveliness token of the server exists."""
        with self._lock:
            return self._chosen is not None and self._chosen in self._tokens

    def wait(self, endpoint: str, deadline: float) -> None:
        """Waits for the server's liveliness token until the monotonic time `deadline`, s.

        Raises:
            OtherNameError: when no server, or more than one, has the name.
        """
        while True:
            self.refresh()
            if self.is_alive():
                return
            if time.monotonic() >= deadline:
                break
            time.sleep(0.01)
        with self._lock:
            tokens = list(self._tokens)
        if len(tokens) > 1:
            # The text of `LinkError::Several` of the Rust SDK.
            raise OtherNameError(
                f"{len(tokens)} sessions behind {endpoint} say that they are the server "
                f"{self._sim!r} ({', '.join(tokens)}): one of them is a stranger or a second "
                "server of the same name; connect to the server itself, or end the other"
            )
        replies = self._session.liveliness().get(f"{PREFIX}/*/alive/*", timeout=1.0)
        found = {str(reply.ok.key_expr).split("/")[1] for reply in replies if reply.ok}
        raise OtherNameError(
            f"a server answers at {endpoint}, but none is named {self._sim!r} (found: "
            f"{', '.join(sorted(found)) or 'none'}): choose one with sim=; if none is found, "
            "another program listens there, for example a ROS 2 router"
        )

    def published(self, sample: zenoh.Sample) -> bool:
        """Whether the server published a sample."""
        source = sample.source_info
        return source is not None and str(source.source_id.zid) == self._chosen

    def sent(self, reply: zenoh.Reply) -> bool:
        """Whether the server sent a reply."""
        replier = reply.replier_id
        return replier is not None and str(replier.zid) == self._chosen
