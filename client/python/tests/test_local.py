"""A server of a program's own ends with it, however it goes."""

from __future__ import annotations

import pathlib
import signal
import subprocess
import sys
import time

import pytest

import wheelarm


def gone(pid: int, within: float) -> bool:
    """Whether a process has ended within so many seconds."""
    deadline = time.monotonic() + within
    while time.monotonic() < deadline:
        try:
            state = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except OSError:
            return True
        if state == "Z":
            return True
        time.sleep(0.02)
    return False


PARENT = """
import os, sys, time
import wheelarm
server = wheelarm.Server(task="pick_mustard", pacing="lock-step")
client = server.connect()
if "fork" in sys.argv and os.fork() == 0:
    time.sleep(60)
    os._exit(0)
print(server.process.pid, flush=True)
if "wait" in sys.argv:
    time.sleep(60)
"""


@pytest.mark.parametrize("how", [["wait"], ["wait", "fork"], []])
def test_a_server_ends_with_its_parent(how):
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, *how], stdout=subprocess.PIPE, text=True
    )
    pid = int(parent.stdout.readline())
    if "wait" in how:
        parent.send_signal(signal.SIGKILL)
    parent.wait(30)
    assert gone(pid, within=10.0), f"the server {pid} outlived its parent"


def test_a_server_that_does_not_start_says_why():
    with pytest.raises(wheelarm.NoServer, match="pick_the_moon"):
        wheelarm.Server(task="pick_the_moon")
    with pytest.raises(wheelarm.NoServer, match="assets"):
        wheelarm.Server(assets="/nonexistent")


def test_a_missing_program_is_told_with_the_cure(monkeypatch, tmp_path):
    monkeypatch.setenv("WHEELARM_SERVER", str(tmp_path / "nothing"))
    with pytest.raises(wheelarm.NoServer, match="WHEELARM_SERVER"):
        wheelarm.find_program()
    with pytest.raises(wheelarm.NoServer, match="PATH"):
        wheelarm.find_program("wheelarm-ghost")


def test_fields_of_a_scenario_are_those_of_the_contract():
    with (
        wheelarm.Server(
            task="pick_bowl", seed=4, pacing="lock-step", starts="anywhere", time_limit_seconds=12.0
        ) as server,
        server.connect() as client,
    ):
        scenario = client.status().scenario
        assert scenario.time_limit_seconds == 12.0 and scenario.seed == 4
        pid = server.process.pid
    assert gone(pid, within=1.0)
    server.close()


def test_a_server_that_may_open_few_files_says_so(program):
    asked = ["sh", "-c", 'ulimit -n 20; exec "$0" --no-cameras', str(program)]
    ended = subprocess.run(asked, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 1, ended.stderr
    assert "at most 20 files may be open" in ended.stderr
    assert "panicked" not in ended.stderr
