"""World packs that a program sends to a server."""

from __future__ import annotations

import pathlib
import shutil
import zipfile

import pytest

import wheelarm
from wheelarm import packs

ROOT = pathlib.Path(__file__).resolve().parents[3]
FLAT = ROOT / "tests/data/flat"


@pytest.fixture
def store(tmp_path):
    return tmp_path / "store"


@pytest.fixture
def receiver(store):
    """A client of a server with a folder of packs of its own."""
    options = ["--packs", str(store)]
    with wheelarm.Server(arguments=options, pacing="lock-step") as server, server.connect() as client:
        yield client


def test_folder_and_zip_file_of_a_pack_become_a_scene(receiver, store, tmp_path, monkeypatch):
    # Small pieces: the flat alone fits into one.
    monkeypatch.setattr(packs, "PIECE", 1000)
    pack = receiver.put_pack(FLAT)
    assert (pack.name, pack.version, len(pack.physics_digest)) == ("flat", "1", 64)
    assert [one.name for one in store.iterdir()][0].startswith("flat@")
    assert receiver.reset(scene=pack.name, task="pick_jar").packs[0] == pack
    file = tmp_path / "sent.zip"
    file.write_bytes(packs.zip_bytes(FLAT))
    assert receiver.put_pack(file) == pack
    assert len(list(store.iterdir())) == 1


def test_upload_that_breaks_off_leaves_nothing_and_hinders_no_other(receiver, store, monkeypatch):
    monkeypatch.setattr(packs, "PIECE", 1000)
    data = packs.zip_bytes(FLAT)
    for _ in range(6):
        begun = packs.put_requests(data)
        for _ in range(3):
            assert not receiver.request(next(begun)).HasField("pack")
    assert not store.exists() or not list(store.iterdir())
    # Two at once, piece by piece in turn.
    replies = [
        [receiver.request(one) for one in pair]
        for pair in zip(packs.put_requests(data), packs.put_requests(data), strict=True)
    ]
    assert [reply.pack.name for reply in replies[-1]] == ["flat", "flat"]
    assert len(list(store.iterdir())) == 1


def test_pack_sent_again_with_other_content_is_the_scene_of_the_next_reset(
    receiver, store, tmp_path
):
    first = receiver.put_pack(FLAT)
    in_force = receiver.reset(scene="flat", task="pick_jar")
    copy = tmp_path / "flat"
    shutil.copytree(FLAT, copy)
    home = copy / "home.toml"
    home.write_text(home.read_text().replace("height = 2.5", "height = 2.6"))
    second = receiver.put_pack(copy)
    assert second.physics_digest != first.physics_digest
    # The running scenario keeps its pack, and the first one can still be named.
    assert receiver.status().scenario.packs == in_force.packs
    assert receiver.reset(seed=3).packs[0] == first
    assert receiver.reset(scene="flat").packs[0] == second
    assert receiver.reset(scene="flat", packs=[first]).packs[0] == first
    # A file that is damaged on disk costs the next reset only.
    receiver.reset(scene="flat")
    for stored in store.iterdir():
        stored.write_bytes(b"damaged")
    assert receiver.status().scenario.packs[0] == second
    with pytest.raises(wheelarm.RefusedError, match="flat"):
        receiver.reset(scene="home")
        receiver.reset(scene="flat")
    assert receiver.put_pack(copy) == second
    assert receiver.reset(scene="flat").packs[0] == second


def test_what_is_not_a_pack_is_refused_with_the_fix(receiver, tmp_path):
    with pytest.raises(ValueError, match="home import"):
        receiver.put_pack(tmp_path)
    with pytest.raises(OSError):
        receiver.put_pack(tmp_path / "absent.zip")
    empty = tmp_path / "empty.zip"
    empty.write_bytes(b"")
    with pytest.raises(wheelarm.RefusedError, match="0 bytes"):
        receiver.put_pack(empty)
    other = tmp_path / "other.zip"
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("pack.toml", "format = 1\nname = \"a\"\nversion = \"1\"\n")
    with pytest.raises(wheelarm.RefusedError, match=r"home\.toml"):
        receiver.put_pack(other)
