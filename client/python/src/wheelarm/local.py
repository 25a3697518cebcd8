"""A server process that this program starts and ends."""

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
from .client import Client
from .errors import NoServerError

#: Time limit of a start, s: on a CPU the server may build its render pipelines first.
_READY_TIMEOUT = 300.0
#: Time limit of each step of the shutdown: end of input, SIGTERM, SIGKILL, s.
_END_TIMEOUT = 10.0
#: Longest path of a socket's folder, bytes: the operating system allows 108 for the socket.
_MAX_FOLDER = 80

#: Write ends of the servers' standard input. A forked child must close them, else a server
#: would outlive its parent.
_lifelines: weakref.WeakSet[Any] = weakref.WeakSet()


def _close_lifelines() -> None:
    for lifeline in list(_lifelines):
        try:
            os.close(lifeline.fileno())
        except (OSError, ValueError):
            pass


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_lifelines)


def find_program(name: str = "wheelarm-server") -> pathlib.Path:
    """Finds a program of WheelArm: the value of ``WHEELARM_SERVER`` (the server alone), next
    to this Python, on PATH, or built in the checkout of this package.

    Raises:
        NoServerError: when it is not found.
    """
    chosen = os.environ.get("WHEELARM_SERVER")
    if chosen and name == "wheelarm-server":
        if os.access(chosen, os.X_OK) and not os.path.isdir(chosen):
            return pathlib.Path(chosen)
        raise NoServerError(
            f"cannot run WHEELARM_SERVER={chosen}: it is not an executable file; set it to the "
            "program `wheelarm-server`"
        )
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
    raise NoServerError(
        f"the program `{name}` is neither next to this Python nor on PATH: install the wheel "
        "for Linux (it contains the programs), add its folder to PATH, or set WHEELARM_SERVER; "
        "without one, connect to a server elsewhere with wheelarm.connect(endpoint)"
    )


def _private_folder() -> str:
    folder = tempfile.mkdtemp(prefix="wheelarm-socket-")
    if len(os.fsencode(folder)) > _MAX_FOLDER:
        os.rmdir(folder)
        raise NoServerError(
            f"cannot create a socket in {folder}: the path is too long; set TMPDIR to a shorter "
            "folder such as /tmp"
        )
    return folder


class Server:
    """A server on a private unix socket. It ends with `close`, and with this process in every
    case, also on SIGKILL.

        with wheelarm.Server(task="pick_mustard", pacing="lock-step") as server:
            client = server.connect()

    Args:
        scenario: The scenario; `fields` override its values, as in `Client.reset`.
        cameras: ``{"gen3": (320, 180, 10.0)}``: width and height, pixels, rate, Hz. By
            default the server renders nothing and needs no graphics driver.
        assets: Assets folder; the server searches for it if absent.
        adapter: Graphics adapter by a part of its name.
        arguments: More command-line arguments of the program.
        log: File for its messages; a temporary one if absent.
        program: The program; `find_program` if absent.

    Attributes:
        endpoint: Endpoint of the server.
        sim: Name of the server.
        process: The process.

    Raises:
        NoServerError: when the program is missing, or ends during its start; with the end of
            its log.
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
        line = [str(path), "--sim", self.sim, "--listen", self.endpoint, "--end-with-stdin"]
        line += ["--assets", os.fspath(assets)] if assets else []
        line += ["--adapter", adapter] if adapter else []
        if cameras:
            for name, (width, height, rate) in cameras.items():
                line += ["--camera", f"{name}={int(width)}x{int(height)}@{rate:g}"]
        elif not (fields.get("cameras") or (scenario is not None and scenario.cameras)):
            line.append("--no-cameras")
        for key in ("task", "scene", "robot", "seed"):
            value = fields.pop(key, None)
            line += [f"--{key}", str(value)] if value is not None else []
        for key in ("pacing", "quality", "starts"):
            if isinstance(fields.get(key), str):
                line += [f"--{key}", str(fields.pop(key)).replace("_", "-")]
        line += list(arguments)
        self._log: IO[bytes] = open(log, "wb+") if log else tempfile.TemporaryFile()
        environment = dict(os.environ)
        if environment.get(THREADS_VARIABLE) == ONE_THREAD:
            # Set by a thread that connects at this moment. A server forwards images and needs
            # more threads than one.
            del environment[THREADS_VARIABLE]
        environment.setdefault("RUST_LIB_BACKTRACE", "0")
        environment.setdefault("NO_COLOR", "1")
        self.process = subprocess.Popen(
            line,
            stdin=subprocess.PIPE,
            stdout=self._log,
            stderr=self._log,
            env=environment,
            # Ctrl-C in the terminal must reach this program alone.
            start_new_session=True,
        )
        _lifelines.add(self.process.stdin)
        self._finalizer = weakref.finalize(
            self, _end_server, self.process, self._log, self._folder, os.getpid()
        )
        try:
            self._wait_until_ready()
            if scenario is not None or fields:
                with self.connect() as client:
                    client.reset(scenario, **fields)
        except BaseException:
            self._finalizer()
            raise

    def log_tail(self) -> str:
        """The last 64 KiB of the server's log."""
        if self._log.closed:
            return ""
        # `pread` keeps the offset at which the server writes.
        length = os.fstat(self._log.fileno()).st_size
        start = max(0, length - (1 << 16))
        return os.pread(self._log.fileno(), length - start, start).decode(errors="replace")

    def _wait_until_ready(self) -> None:
        deadline = time.monotonic() + _READY_TIMEOUT
        while True:
            # Poll before reading, so that the log of an ended server is complete.
            status = self.process.poll()
            log = self.log_tail()
            if any(line.startswith("ready ") for line in log.splitlines()):
                return
            if status is not None:
                raise NoServerError(
                    f"the server ended during its start with status {status}:\n{log[-4000:]}"
                )
            if time.monotonic() > deadline:
                raise NoServerError(
                    f"the server was not ready within {_READY_TIMEOUT:.0f} s:\n{log[-4000:]}"
                )
            time.sleep(0.005)

    def connect(self, *, timeout: float = 10.0) -> Client:
        """Connects to the server; `timeout` is the time limit, s."""
        return Client(self.endpoint, self.sim, timeout=timeout)

    def close(self) -> None:
        """Ends the server and waits for the end of its process."""
        self._finalizer()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Server({self.endpoint!r}, sim={self.sim!r}, pid={self.process.pid})"


def _end_server(process: subprocess.Popen[bytes], log: IO[bytes], folder: str, owner: int) -> None:
    if owner != os.getpid():
        return
    if process.stdin is not None:
        try:
            process.stdin.close()
        except OSError:
            pass
    for end_harder in (process.terminate, process.kill):
        try:
            process.wait(_END_TIMEOUT)
            break
        except subprocess.TimeoutExpired:
            end_harder()
    process.wait()
    log.close()
    shutil.rmtree(folder, ignore_errors=True)


__all__ = ["Server", "find_program"]
