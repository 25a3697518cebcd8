"""Encoding of messages, and access to image data without a copy.

protobuf decodes small messages. A camera frame has megabytes, which protobuf would copy
twice; `walk` yields views of its planes in the received bytes, which numpy uses directly.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from . import v1
from ._contract import CONTRACT_VERSION, MEDIA_TYPE, TOPICS
from .errors import GarbledError, OtherVersionError

NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")

#: Topic by name: its row of the table.
TOPIC = {row[0]: row for row in TOPICS}
#: Message class of each topic.
MESSAGE = {row[0]: getattr(v1, row[2]) for row in TOPICS}


def check_name(name: str) -> str:
    """Checks a name for use in a key: 1 to 64 letters, digits, ``-`` or ``_``.

    Raises:
        ValueError: when it has another length or character.
    """
    if not NAME.fullmatch(name):
        # The text of `wheelarm_proto::keys::BadName`.
        raise ValueError(
            f"the name {name!r} must be 1 to 64 letters, digits, `-` or `_` "
            "(it is part of a key expression), and `policy` is taken"
        )
    return name


def check_topic(name: str) -> str:
    """Checks the name of a topic that a server publishes under one key.

    Raises:
        ValueError: for an unknown topic; the message lists all topics.
    """
    valid = [topic for topic, row in TOPIC.items() if row[6] == "server" and "{" not in row[1]]
    if name not in valid:
        raise ValueError(f"unknown topic {name!r}; available: {', '.join(sorted(valid))}")
    return name


def encoding(message: str) -> str:
    """The encoding of a message, for example ``application/protobuf;wheelarm.v1.Clock@2``."""
    return f"{MEDIA_TYPE};wheelarm.v1.{message}@{CONTRACT_VERSION}"


def check_encoding(received: str) -> None:
    """Rejects an encoding of another version of the contract.

    Raises:
        OtherVersionError: with both versions.
    """
    theirs = "1"  # the first version sent none
    if received.startswith(MEDIA_TYPE) and "@" in received:
        theirs = received.rsplit("@", 1)[1]
    if theirs != str(CONTRACT_VERSION):
        # The text of `wheelarm_proto::schema::OtherVersion`.
        raise OtherVersionError(
            f"the other side speaks version {theirs} of the contract, this program version "
            f"{CONTRACT_VERSION}: use server and clients of one build (`wheelarm --version` and "
            "`wheelarm-server --version` tell it; messages carry the encoding "
            f"`{MEDIA_TYPE};MESSAGE@{CONTRACT_VERSION}`)"
        )


def read(kind: Any, payload: bytes, what: str) -> Any:
    """Decodes a message of the class `kind`.

    Raises:
        GarbledError: when the bytes are not such a message.
    """
    message = kind()
    try:
        message.ParseFromString(payload)
    except Exception as cause:  # protobuf's DecodeError differs between its versions
        # The text of `LinkError::Garbled` of the Rust SDK.
        raise GarbledError(
            f"{what} cannot be read ({cause}): client and server differ in version?"
        ) from cause
    return message


def read_varint(data: bytes | memoryview, at: int) -> tuple[int, int]:
    """The variable-length integer at the offset `at`, and the offset after it.

    Raises:
        IndexError: when it has no end.
    """
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise IndexError("an integer without an end")


def walk(data: bytes) -> Iterator[tuple[int, int | memoryview]]:
    """Field numbers and values of an encoded message, in the order of the bytes.

    A value is an integer for the wire type varint, else a view of `data`: nothing is
    copied.

    Raises:
        GarbledError: when the message is truncated or damaged.
    """
    view, at, end = memoryview(data), 0, len(data)
    try:
        while at < end:
            tag, at = read_varint(view, at)
            field, kind = tag >> 3, tag & 7
            value: int | memoryview
            if kind == 0:
                value, at = read_varint(view, at)
            elif kind == 2:
                length, at = read_varint(view, at)
                if at + length > end:
                    raise IndexError(f"field {field} has {length} bytes, {end - at} are left")
                value = view[at : at + length]
                at += length
            elif kind in (1, 5):
                length = 8 if kind == 1 else 4
                if at + length > end:
                    raise IndexError(f"field {field} is truncated")
                value = view[at : at + length]
                at += length
            else:
                raise IndexError(f"field {field} has the unknown wire type {kind}")
            yield field, value
    except IndexError as cause:
        raise GarbledError(f"a message is damaged: {cause or 'it is truncated'}") from cause
