"""A server of this program's own."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
import weakref
from collections.abc import Iterable, Mapping, Sequence
from typing import IO, Any

from ._session import ONE_THREAD, THREADS_VARIABLE, refuse_fork
from .client import Client, scenario_of
from .errors import NoServer

#: Until a server serves: it may build its pipelines on a CPU, s.
_READY = 300.0
#: For each way of ending it, before the next harder one, s.
_END = 10.0
#: Longest path of a socket's folder, bytes: the operating system's limit is 108.
_LONGEST = 80

#: Write ends of the servers' standard input. A forked child must not keep them open, or
#: a server would outlive its parent.
_lifelines: weakref.WeakSet[Any] = weakref.WeakSet()


def _let_go() -> None:
    for lifeline in list(_lifelines):
        try:
            os.close(lifeline.fileno())
        except (OSError, ValueError):
            pass


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_let_go)


def find_program(name: str = "wheelarm-server") -> pathlib.Path:
    """Where a program of WheelArm lies: named by ``WHEELARM_SERVER`` (the server alone),
    beside this Python, on PATH, or built in the checkout that this package lies in.

    Raises:
        NoServer: with the cure when it is not found.
    """
    told = os.environ.get("WHEELARM_SERVER")
    if told and name == "wheelarm-server":
        if os.access(told, os.X_OK) and not os.path.isdir(told):
            return pathlib.Path(told)
        raise NoServer(f"WHEELARM_SERVER names {told}, which is no program that can be run")
    folders = [sysconfig.get_path("scripts"), os.path.dirname(sys.executable)]
    if os.name == "posix":
        folders.append(sysconfig.get_path("scripts", "posix_user"))
    folders += os.environ.get("PATH", "").split(os.pathsep)
    target = os.environ.get("CARGO_TARGET_DIR")
    checkout = pathlib.Path(__file__).resolve().parents[4]
    if (checkout / "client" / "python").is_dir():
        folders.append(os.path.join(target or checkout / "target", "release"))
    for folder in folders:
        path = pathlib.Path(folder) / name
        if folder and path.is_file() and os.access(path, os.X_OK):
            return path
    raise NoServer(
        f"the program `{name}` is neither beside this Python nor on PATH: install the wheel "
        "for Linux (it carries the programs), put it on PATH, or name it with WHEELARM_SERVER; "
        "without one connect to a server elsewhere with wheelarm.connect(endpoint)"
    )


def _private_folder() -> str:
    folder = tempfile.mkdtemp(prefix="wheelarm-socket-")
    if len(os.fsencode(folder)) > _LONGEST:
        os.rmdir(folder)
        raise NoServer(
            f"{folder} is too long for a socket; set TMPDIR to a shorter folder such as /tmp"
        )
    return folder


class Server:
    """A server on a private unix socket. It ends with `close`, and with this process
    however that goes.

        with wheelarm.Server(task="pick_mustard", pacing="lock-step") as server:
            client = server.connect()

    Args:
        scenario: What to simulate; `fields` take the place of its own, as in
            `Client.reset`.
        cameras: ``{"gen3": (320, 180, 10.0)}``: width and height, pixels, rate, Hz.
            Empty, as it stands: no picture is drawn, no graphics driver is needed.
        assets: Assets folder; the server looks for it where absent.
        adapter: Graphics adapter by a part of its name.
        arguments: More of the program's own arguments.
        log: File for its messages; a temporary one where absent.
        program: The program; `find_program` where absent.

    Attributes:
        endpoint: Where it listens.
        sim: Its name.
        process: The process.

    Raises:
        NoServer: when there is no program, or it ends while starting; with its words.
    """

    def __init__(
        self,
        scenario: Any = None,
        *,
        cameras: Mapping[str, Sequence[float]] | None = None,
        assets: str | os.PathLike[str] | None = None,
        adapter: str | None = None,
        arguments: Iterable[str] = (),
        log: str | os.PathLike[str] | None = None,
        program: str | os.PathLike[str] | None = None,
        **fields: Any,
    ) -> None:
        refuse_fork()
        path = pathlib.Path(program) if program else find_program()
        self._folder = _private_folder()
        self.sim = f"local-{os.getpid()}"
        self.endpoint = f"unixsock-stream/{self._folder}/server"
        words = [str(path), "--sim", self.sim, "--listen", self.endpoint, "--end-with-stdin"]
        words += ["--assets", os.fspath(assets)] if assets else []
        words += ["--adapter", adapter] if adapter else []
        if cameras:
            for name, (width, height, rate) in cameras.items():
                words += ["--camera", f"{name}={int(width)}x{int(height)}@{rate:g}"]
        elif not (fields.get("cameras") or (scenario is not None and scenario.cameras)):
            words.append("--no-cameras")
        for key in ("task", "scene", "robot", "seed"):
            value = fields.pop(key, None)
            words += [f"--{key}", str(value)] if value is not None else []
        for key in ("pacing", "quality", "starts"):
            if isinstance(fields.get(key), str):
                words += [f"--{key}", str(fields.pop(key)).replace("_", "-")]
        words += list(arguments)
        self._log: IO[bytes] = open(log, "wb+") if log else tempfile.TemporaryFile()
        environment = dict(os.environ)
        if environment.get(THREADS_VARIABLE) == ONE_THREAD:
            # Another thread is just connecting: a server hands on, and needs more.
            del environment[THREADS_VARIABLE]
        environment.setdefault("RUST_LIB_BACKTRACE", "0")
        environment.setdefault("NO_COLOR", "1")
        self.process = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=self._log,
            stderr=self._log,
            env=environment,
            # The terminal's Ctrl-C is this program's to handle.
            start_new_session=True,
        )
        _lifelines.add(self.process.stdin)
        self._finalizer = weakref.finalize(
            self, _end, self.process, self._log, self._folder, os.getpid()
        )
        try:
            self._wait_until_ready()
            if scenario is not None or fields:
                with self.connect() as client:
                    client.reset(scenario, **fields)
        except BaseException:
            self._finalizer()
            raise

    def messages(self) -> str:
        """What the server has said so far, the newest 64 KiB."""
        if self._log.closed:
            return ""
        # Read beside the place at which the server writes.
        length = os.fstat(self._log.fileno()).st_size
        start = max(0, length - (1 << 16))
        return os.pread(self._log.fileno(), length - start, start).decode(errors="replace")

    def _wait_until_ready(self) -> None:
        deadline = time.monotonic() + _READY
        while True:
            # Before its messages are read: what it said last is among them.
            ended = self.process.poll()
            said = self.messages()
            if any(line.startswith("ready ") for line in said.splitlines()):
                return
            if ended is not None:
                raise NoServer(f"the server ended while starting (status {ended}):\n{said[-4000:]}")
            if time.monotonic() > deadline:
                raise NoServer(f"the server was not ready within {_READY:.0f} s:\n{said[-4000:]}")
            time.sleep(0.005)

    def connect(self, *, timeout: float = 10.0) -> Client:
        """A connection to it."""
        return Client(self.endpoint, self.sim, timeout=timeout)

    def close(self) -> None:
        """Ends the server and waits until it has gone."""
        self._finalizer()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Server({self.endpoint!r}, sim={self.sim!r}, pid={self.process.pid})"


def _end(process: subprocess.Popen[bytes], log: IO[bytes], folder: str, owner: int) -> None:
    if owner != os.getpid():
        return
    if process.stdin is not None:
        try:
            process.stdin.close()
        except OSError:
            pass
    for harder in (process.terminate, process.kill):
        try:
            process.wait(_END)
            break
        except subprocess.TimeoutExpired:
            harder()
    process.wait()
    log.close()
    shutil.rmtree(folder, ignore_errors=True)


__all__ = ["Server", "find_program", "scenario_of"]
