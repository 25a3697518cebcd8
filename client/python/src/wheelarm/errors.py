"""What can go wrong between a program and a server, in words that name the cure."""

from __future__ import annotations

from . import v1


class WheelArmError(Exception):
    """Every error of this package."""


class NoServer(WheelArmError):
    """Nobody listens at the endpoint, or no program can be started."""


class OtherName(WheelArmError):
    """Somebody listens, but no server of that name; or several of it."""


class OtherVersion(WheelArmError):
    """The server speaks another version of the contract than this package."""


class Silent(WheelArmError):
    """The server did not answer, or nothing came in time."""


class Gone(WheelArmError):
    """The server, or the connection to it, has ended."""


class Garbled(WheelArmError):
    """A message is not as the contract says."""


class Forked(WheelArmError):
    """The process was forked after a connection had been opened."""


class Refused(WheelArmError):
    """The server answered that it will not, or did not take a command.

    Attributes:
        query: Name of the query; ``command`` for a command.
        code: Why: a ``FailureCode`` of queries, a ``RefusalCode`` of commands (no unit).
        message: The server's own words.
    """

    def __init__(self, query: str, code: int, message: str) -> None:
        super().__init__(f"the server refused `{query}`: {message}")
        self.query, self.code, self.message = query, code, message

    @property
    def reason(self) -> str:
        """The code as a word, for example ``CONTROL_HELD``."""
        kind = v1.RefusalCode if self.query == "command" else v1.FailureCode
        prefix = "REFUSAL_CODE_" if self.query == "command" else "FAILURE_CODE_"
        return str(kind.Name(self.code)).replace(prefix, "")
