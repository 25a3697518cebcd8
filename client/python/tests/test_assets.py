"""Files that a script of this repository generates are those that the script generates now."""

from __future__ import annotations

import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[3]


def test_robot_with_the_wide_gripper_is_generated_from_the_robot():
    script = ROOT / "assets/tools/wide_gripper.py"
    made = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)
    assert made.returncode == 0, made.stdout + made.stderr
