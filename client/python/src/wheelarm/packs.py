"""World packs: a folder or a zip file as the bytes that a server receives."""

from __future__ import annotations

import hashlib
import io
import os
import pathlib
import secrets
import zipfile
from collections.abc import Iterator

from . import v1

#: Size of the pieces in which a pack is sent, bytes.
PIECE = 256 << 10
#: Longest zip file that a server accepts, bytes.
MOST_BYTES = 64 << 20


def zip_bytes(path: str | os.PathLike[str]) -> bytes:
    """The zip file of a pack: that at `path`, or the files of the folder `path`.

    Raises:
        ValueError: when `path` is neither, or is too large.
        OSError: when a file cannot be read.
    """
    path = pathlib.Path(path)
    if path.is_dir():
        if not (path / "pack.toml").is_file():
            raise ValueError(
                f"{path} is not a world pack: it has no pack.toml; name a folder or zip file of a "
                "pack, for example the result of `wheelarm home import`"
            )
        data = _zipped(path)
    else:
        data = path.read_bytes()
    if len(data) > MOST_BYTES:
        raise ValueError(
            f"{path} has {len(data)} bytes as a zip file, at most {MOST_BYTES} are accepted; leave "
            "out or simplify meshes"
        )
    return data


def _zipped(folder: pathlib.Path) -> bytes:
    # Files whose names begin with a dot are those of editors and file managers.
    files = sorted(
        file
        for file in folder.rglob("*")
        if file.is_file()
        and not any(part.startswith(".") for part in file.relative_to(folder).parts)
    )
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, file.relative_to(folder).as_posix())
    return memory.getvalue()


def put_requests(data: bytes) -> Iterator[v1.PackPutRequest]:
    """The requests that send the zip file `data`, in their order."""
    transfer = secrets.randbits(64)
    digest = "sha256:" + hashlib.sha256(data).hexdigest()
    for offset in range(0, max(len(data), 1), PIECE):
        yield v1.PackPutRequest(
            transfer=transfer,
            zip_digest=digest,
            zip_length=len(data),
            offset=offset,
            piece=data[offset : offset + PIECE],
        )
