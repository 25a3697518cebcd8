"""The teleoperator: the actions of a recorded episode, one after the other."""

from __future__ import annotations

import json
import pathlib
import subprocess
import tempfile
from functools import cached_property
from typing import Any

import numpy as np
from lerobot.teleoperators.teleoperator import Teleoperator
from pyarrow import parquet

import wheelarm
from wheelarm.rows import action_names

from .config_wheelarm import WheelArmTeleoperatorConfig


class WheelArmTeleoperator(Teleoperator):  # type: ignore[misc]
    """Returns the rows of an episode, then repeats the last one, which holds the robot."""

    config_class = WheelArmTeleoperatorConfig
    name = "wheelarm"

    def __init__(self, config: WheelArmTeleoperatorConfig) -> None:
        super().__init__(config)
        self.config = config
        self._rows: np.ndarray[Any, Any] | None = None
        self._names: list[str] = []
        self._next = 0

    @cached_property
    def action_features(self) -> dict[str, Any]:
        """The numbers of a row by name."""
        return dict.fromkeys(self._names or action_names(self.config.action), float)

    @property
    def feedback_features(self) -> dict[str, Any]:
        """Always empty: the simulator sends none."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether the episode is loaded."""
        return self._rows is not None

    @property
    def is_calibrated(self) -> bool:
        """Always true: the teleoperator needs no calibration."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Loads the episode.

        Raises:
            ValueError: when the episode does not exist, or cannot be exported.
        """
        path = pathlib.Path(self.config.recording)
        if not self.config.recording or not path.exists():
            raise ValueError(
                f"cannot read the recording {self.config.recording!r}: it does not exist; name a .h5 "
                "file or an exported set with --teleop.recording"
            )
        if path.is_dir():
            self._read(path, self.config.episode)
            return
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "set"
            line = [
                str(wheelarm.find_program("wheelarm")),
                "dataset",
                "export",
                "--format",
                "lerobot",
                "--pictures",
                "png",
                "--action",
                self.config.action,
                str(path),
                "--out",
                str(out),
            ]
            done = subprocess.run(line, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise ValueError(f"cannot convert {path} to rows: {done.stderr.strip()}")
            self._read(out, 0)

    def _read(self, folder: pathlib.Path, episode: int) -> None:
        info = json.loads((folder / "meta/info.json").read_text())
        data = parquet.read_table(
            sorted(folder.glob("data/**/*.parquet")), columns=["episode_index", "action"]
        )
        chosen = np.array(data["episode_index"]) == episode
        if not chosen.any():
            raise ValueError(
                f"{folder} has no episode {episode}; available: 0 to {info['total_episodes'] - 1}"
            )
        self._rows = np.stack(data["action"].to_numpy()[chosen])
        self._names, self._next = info["features"]["action"]["names"], 0

    def calibrate(self) -> None:
        """Does nothing."""

    def configure(self) -> None:
        """Does nothing."""

    def get_action(self) -> dict[str, Any]:
        """The next row."""
        if self._rows is None:
            raise ConnectionError("the teleoperator is not connected: call connect() first")
        row = self._rows[min(self._next, len(self._rows) - 1)]
        self._next += 1
        return dict(zip(self._names, row.tolist(), strict=True))

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Does nothing."""

    def disconnect(self) -> None:
        """Releases the episode."""
        self._rows = None
