"""Errors of the package. Every message states what failed, why, and the fix."""

from __future__ import annotations

from . import v1


class WheelArmError(Exception):
    """Base class of every error of this package."""


class NoServerError(WheelArmError):
    """No server listens at the endpoint, or the server program cannot start."""


class OtherNameError(WheelArmError):
    """A peer listens at the endpoint, but no server, or several servers, have the name."""


class OtherVersionError(WheelArmError):
    """The server uses another version of the contract than this package."""


class SilentError(WheelArmError):
    """The server sent no reply or no data within the time limit."""


class GoneError(WheelArmError):
    """The server, or the connection to it, has ended."""


class GarbledError(WheelArmError):
    """A message does not follow the contract."""


class ForkedError(WheelArmError):
    """The process was forked after it had opened a connection."""


class RefusedError(WheelArmError):
    """The server rejected a request or a command.

    Attributes:
        query: Name of the query; ``command`` for a command.
        code: A ``FailureCode`` for queries, a ``RefusalCode`` for commands (no unit).
        message: Explanation by the server.
    """

    def __init__(self, query: str, code: int, message: str) -> None:
        super().__init__(f"the server refused `{query}`: {message}")
        self.query, self.code, self.message = query, code, message

    @property
    def reason(self) -> str:
        """The name of the code, for example ``CONTROL_HELD``."""
        kind = v1.RefusalCode if self.query == "command" else v1.FailureCode
        prefix = "REFUSAL_CODE_" if self.query == "command" else "FAILURE_CODE_"
        return str(kind.Name(self.code)).replace(prefix, "")


class EpisodeEndedError(WheelArmError):
    """The episode has ended without a request of this program.

    Attributes:
        stopped: The end of the episode as the server published it, with its `cause`.
    """

    def __init__(self, stopped: v1.EpisodeStopped) -> None:
        why = stopped.anomalies[-1] if stopped.anomalies else "another client ended it"
        super().__init__(f"the episode has ended: {why}")
        self.stopped = stopped
