"""Measures the exports, and reading aligned data against WheelArm-Sim's layout.

dataset.py [RECORDING.h5]

Without a recording it records one at 1280x720. Reading alternates between the two
layouts over the same samples (joints, poses, IMU, color and depth of both cameras);
the best of three rounds counts. Both files are in the page cache. Exit code 1 when
a command fails.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
RELEASE = ROOT / "target" / "release"
SAMPLES = 20
GOAL = 3.0


def run(*command):
    started = time.perf_counter()
    environment = dict(os.environ, WHEELARM_ASSETS=str(ROOT / "assets"))
    result = subprocess.run([str(c) for c in command], env=environment, capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"{command[:4]} failed: {result.stderr or result.stdout}")
    return time.perf_counter() - started


def formats(tool):
    """Names of the export formats, from the help of the program."""
    text = subprocess.run([tool, "export", "--help"], capture_output=True, text=True, check=True).stdout
    names = re.findall(r"^ +- ([a-z0-9-]+): ", text.split("\n      --format")[1].split("\n      --")[0], re.MULTILINE)
    assert "csv" in names, text
    return names


def size(path):
    files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
    return sum(p.stat().st_size for p in files) / 1e6


def read_aligned(path, rows):
    with h5py.File(path) as file:
        streams = file["streams"]
        for name in ("joint_state/position", "joint_state/velocity", "pose/pose", "pose/twist",
                     "imu/orientation", "imu/angular_velocity", "imu/linear_acceleration"):
            streams[name][rows.start:rows.stop]
        for camera in ("gen3", "wheelchair"):
            for row in rows:
                streams[f"camera/{camera}/rgb"][row]
                streams[f"camera/{camera}/depth"][row]


def read_original(path, rows):
    with h5py.File(path) as file:
        for row in rows:
            group = file["data"][str(row)]
            for name, data in group.items():
                value = data[()]
                if "cameras" in name and not name.endswith("time"):
                    value = value.astype(np.uint8)
                    value = value.view("<f4") if "depth" in name else value


def main():
    with tempfile.TemporaryDirectory(prefix="wheelarm_bench_") as folder:
        folder = Path(folder)
        if len(sys.argv) > 1:
            recording = Path(sys.argv[1])
        else:
            run(RELEASE / "wheelarm", "demo", "--seed", 0, "--no-sheet", "--out", folder / "raw")
            recording = next((folder / "raw").glob("*.h5"))
        with h5py.File(recording) as file:
            rows, height, width = file["streams/camera/gen3/rgb"].shape[:3]
        print(f"{rows} rows, two cameras of {width}x{height}, {size(recording):.0f} MB, {os.cpu_count()} cores")
        tool = RELEASE / "wheelarm-dataset"
        jobs = {"align": [tool, "align", recording, "--out", folder / "aligned"]}
        for name in formats(tool):
            out = folder / ("robomimic.hdf5" if name == "robomimic" else name)
            jobs[name] = [tool, "export", "--format", name, recording, "--out", out]
        for name, command in jobs.items():
            seconds = run(*command)
            print(f"{name:<14} {rows / seconds:8.1f} rows/s  {size(Path(command[-1])):8.1f} MB", flush=True)
        aligned = next((folder / "aligned").glob("*.h5"))
        # The folder also contains the original's camera information.
        original = next((folder / "wheelarm-sim").glob("*.hdf5"))
        best = [float("inf")] * 2
        for _ in range(3):
            for i, (read, path) in enumerate(((read_aligned, aligned), (read_original, original))):
                started = time.perf_counter()
                read(path, range(1, 1 + SAMPLES))
                best[i] = min(best[i], time.perf_counter() - started)
        ours, theirs = (SAMPLES / seconds for seconds in best)
        print(f"read by h5py   {ours:8.1f} aligned, {theirs:.1f} original's layout, samples/s: {ours / theirs:.1f}x (goal >= {GOAL:.0f}x)")


if __name__ == "__main__":
    main()
