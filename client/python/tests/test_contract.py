"""The package contains the contract of the .proto files."""

from __future__ import annotations

import ast
import pathlib
import subprocess
import sys

import pytest

from wheelarm import _contract, _wire, v1

SCRIPT = pathlib.Path(__file__).resolve().parents[1] / "scripts/make_contract.py"


def test_generated_files_are_up_to_date():
    pytest.importorskip("grpc_tools", reason="grpcio-tools compiles the .proto files")
    found = subprocess.run(
        [sys.executable, str(SCRIPT), "--check"], capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stdout + found.stderr


def test_every_query_and_topic_has_its_messages():
    for name, request, reply, field in _contract.QUERIES:
        message = getattr(v1, request)()
        assert not field or hasattr(message, field), name
        assert getattr(v1, reply)() is not None
    assert len(_contract.TOPICS) > 20
    for row in _contract.TOPICS:
        assert "header" in getattr(v1, row[2]).DESCRIPTOR.fields_by_name, row


def test_ros_node_decides_for_every_stream():
    # The node imports rclpy, so its lists are read from its source.
    path = pathlib.Path(__file__).resolve().parents[1] / "src/wheelarm/ros/node.py"
    lists = {
        target.id: ast.literal_eval(node.value)
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name) and target.id in ("STREAMS", "UNPUBLISHED", "OTHERS")
    }
    streams = {row[0] for row in _contract.TOPICS if row[1].startswith("stream/")}
    decided = [name for names in lists.values() for name in names]
    assert len(decided) == len(set(decided))
    assert streams <= set(decided), f"{path}: publish {streams - set(decided)} or list it"
    assert set(decided) <= {row[0] for row in _contract.TOPICS}


def test_messages_have_their_own_descriptor_pool():
    from google.protobuf import descriptor_pool

    with pytest.raises(KeyError):
        descriptor_pool.Default().FindMessageTypeByName("wheelarm.v1.Clock")
    clock = v1.Clock(header=v1.Header(tick=4))
    assert v1.Clock.FromString(clock.SerializeToString()).header.tick == 4
    assert v1.Pacing.Name(v1.PACING_LOCK_STEP) == "PACING_LOCK_STEP"


def test_error_for_another_contract_version_has_both_numbers():
    own = _wire.encoding("Clock")
    assert own == f"application/protobuf;wheelarm.v1.Clock@{_contract.CONTRACT_VERSION}"
    _wire.check_encoding(own)
    for other in (
        "zenoh/bytes",
        "application/protobuf",
        "application/protobuf;wheelarm.v1.Clock@99",
    ):
        with pytest.raises(_wire.OtherVersionError, match="version"):
            _wire.check_encoding(other)
