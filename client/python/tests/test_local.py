"""A local server ends together with its program, also after SIGKILL."""

from __future__ import annotations

import pathlib
import signal
import subprocess
import sys
import time

import pytest

import wheelarm


def has_ended(pid: int, within: float) -> bool:
    """Whether a process ends within so many seconds."""
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
def test_server_ends_with_its_parent(how):
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, *how], stdout=subprocess.PIPE, text=True
    )
    pid = int(parent.stdout.readline())
    if "wait" in how:
        parent.send_signal(signal.SIGKILL)
    parent.wait(30)
    assert has_ended(pid, within=10.0), f"the server {pid} outlived its parent"


def test_error_of_a_failed_start_contains_the_cause():
    with pytest.raises(wheelarm.NoServerError, match="pick_the_moon"):
        wheelarm.Server(task="pick_the_moon")
    with pytest.raises(wheelarm.NoServerError, match="assets"):
        wheelarm.Server(assets="/nonexistent")


def test_error_for_a_missing_program_contains_the_fix(monkeypatch, tmp_path):
    monkeypatch.setenv("WHEELARM_SERVER", str(tmp_path / "nothing"))
    with pytest.raises(wheelarm.NoServerError, match="WHEELARM_SERVER"):
        wheelarm.find_program()
    with pytest.raises(wheelarm.NoServerError, match="PATH"):
        wheelarm.find_program("wheelarm-ghost")


def test_server_starts_with_the_scenario_fields():
    with (
        wheelarm.Server(
            task="pick_bowl", seed=4, pacing="lock-step", starts="anywhere", time_limit_seconds=12.0
        ) as server,
        server.connect() as client,
    ):
        scenario = client.status().scenario
        assert scenario.time_limit_seconds == 12.0 and scenario.seed == 4
        pid = server.process.pid
    assert has_ended(pid, within=1.0)
    server.close()


def test_server_with_a_low_file_limit_reports_it(program):
    line = ["sh", "-c", 'ulimit -n 20; exec "$0" --no-cameras', str(program)]
    ended = subprocess.run(line, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 1, ended.stderr
    assert "at most 20 files may be open" in ended.stderr
    assert "panicked" not in ended.stderr
