"""How messages travel: encodings, and pictures without a copy.

Small messages are read by protobuf. A picture has megabytes, which protobuf would
copy twice; `walk` finds where its planes lie in the bytes that came, and numpy looks
at them there.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from . import v1
from ._contract import CONTRACT_VERSION, TOPICS
from .errors import Garbled, OtherVersion

MEDIA_TYPE = "application/protobuf"
NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")

#: Topic by name: its row of the table.
TOPIC = {row[0]: row for row in TOPICS}
#: Message class of each topic.
MESSAGE = {row[0]: getattr(v1, row[2]) for row in TOPICS}


def check_name(name: str) -> str:
    """A name that may stand in a key: 1 to 64 letters, digits, ``-`` or ``_``."""
    if not NAME.fullmatch(name):
        raise ValueError(
            f"the name {name!r} must be 1 to 64 letters, digits, `-` or `_` "
            "(it stands in a key expression)"
        )
    return name


def encoding(message: str) -> str:
    """The encoding of a message, for example ``application/protobuf;wheelarm.v1.Clock@2``."""
    return f"{MEDIA_TYPE};wheelarm.v1.{message}@{CONTRACT_VERSION}"


def check_encoding(told: str) -> None:
    """Refuses an encoding of another version of the contract.

    Raises:
        OtherVersion: with both versions.
    """
    theirs = "1"
    if told.startswith(MEDIA_TYPE) and "@" in told:
        theirs = told.rsplit("@", 1)[1]
    if theirs != str(CONTRACT_VERSION):
        raise OtherVersion(
            f"the other side speaks version {theirs} of the contract, this package version "
            f"{CONTRACT_VERSION}: use the server and the Python package of one release "
            "(`wheelarm-server --version` and `wheelarm.__version__`)"
        )


def read(kind: Any, payload: bytes, what: str) -> Any:
    """A message from its bytes.

    Raises:
        Garbled: when it cannot be read.
    """
    message = kind()
    try:
        message.ParseFromString(payload)
    except Exception as cause:  # protobuf's DecodeError differs between its versions
        raise Garbled(
            f"`{what}` cannot be read ({cause}): are server and package of one release?"
        ) from cause
    return message


def varint(data: bytes | memoryview, at: int) -> tuple[int, int]:
    """A number of variable length and the place behind it."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise IndexError("a number without an end")


def walk(data: bytes) -> Iterator[tuple[int, int | memoryview]]:
    """Field numbers and values of an encoded message, in their order.

    A value is a number where the wire has one, else a view into `data`: nothing is
    copied.

    Raises:
        Garbled: when it is cut off or no message.
    """
    view, at, end = memoryview(data), 0, len(data)
    try:
        while at < end:
            tag, at = varint(view, at)
            field, kind = tag >> 3, tag & 7
            value: int | memoryview
            if kind == 0:
                value, at = varint(view, at)
            elif kind == 2:
                length, at = varint(view, at)
                if at + length > end:
                    raise IndexError(f"field {field} has {length} bytes, {end - at} are left")
                value = view[at : at + length]
                at += length
            elif kind in (1, 5):
                length = 8 if kind == 1 else 4
                if at + length > end:
                    raise IndexError(f"field {field} is cut off")
                value = view[at : at + length]
                at += length
            else:
                raise IndexError(f"field {field} has the unknown type {kind}")
            yield field, value
    except IndexError as cause:
        raise Garbled(f"a message is damaged: {cause or 'it is cut off'}") from cause
