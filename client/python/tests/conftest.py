"""Fixtures: a server for each test, found in the same way as by users."""

from __future__ import annotations

import os
import pathlib

import pytest

import wheelarm

ROOT = pathlib.Path(__file__).resolve().parents[3]


def pytest_configure() -> None:
    if (ROOT / "assets/scenes").is_dir():
        os.environ.setdefault("WHEELARM_ASSETS", str(ROOT / "assets"))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A skipped test is a failure with WHEELARM_NO_SKIPS, which `make test` sets."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("WHEELARM_NO_SKIPS") and reporter.stats.get("skipped"):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.fixture(scope="session", autouse=True)
def program() -> pathlib.Path:
    """The server program. Its absence is an error of every test, not a skip."""
    return wheelarm.find_program()


@pytest.fixture
def server():
    """A server in lock-step without cameras."""
    with wheelarm.Server(task="pick_mustard", seed=0, pacing="lock-step") as server:
        yield server


@pytest.fixture
def client(server):
    with server.connect() as client:
        yield client
