"""Measures the rate of `wheelarm collect` at the paper's settings, and how it scales.

collect.py ASSETS [--workers 1 2] [--depth f32 u16] [--size 1280x720]
           [--episodes 1] [--programs DIR] [--folder DIR] [--adapter NAME]
           [--worker process|socket]

Every line is one campaign: simulated seconds in the dataset over wall seconds
from start to manifest, including the start of the servers. `--episodes` is per
worker.
"""

import argparse
import json
import resource
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

PLAN = """
name = "bench"
depth = "{depth}"
[[scenario.cameras]]
name = "gen3"
width = {width}
height = {height}
[[scenario.cameras]]
name = "wheelchair"
width = {width}
height = {height}
[[task]]
name = "pick_mustard"
episodes = {episodes}
"""


def campaign(options, depth, workers, folder):
    width, height = options.size.split("x")
    plan = folder / "plan.toml"
    episodes = workers * options.episodes
    plan.write_text(PLAN.format(depth=depth, width=width, height=height, episodes=episodes))
    out = folder / "set"
    command = [options.programs / "wheelarm", "collect", plan, "--out", out]
    command += ["--workers", workers, "--assets", options.assets]
    if options.adapter:
        command += ["--adapter", options.adapter]
    if options.worker:
        command += ["--worker", options.worker]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.monotonic()
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    wall = time.monotonic() - started
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if result.returncode != 0:
        raise SystemExit(f"wheelarm collect failed: exit {result.returncode}: {result.stdout}{result.stderr}")
    manifest = json.loads((out / "manifest.json").read_text())
    images = sum(e["counts"]["camera/gen3"] + e["counts"]["camera/wheelchair"] for e in manifest["episodes"])
    print(
        f"{depth}, {workers} workers: {manifest['seconds'] / wall:.2f} x real time summed, "
        f"{images / wall:.1f} images/s, {manifest['bytes'] / images * 1e-6:.2f} MB per image, "
        f"{manifest['seconds']:.1f} s simulated in {wall:.1f} s, "
        f"{1000 * cpu / manifest['seconds']:.0f} ms of CPU per simulated s, "
        f"{len(manifest['failed_attempts'])} failed attempts",
        flush=True,
    )
    shutil.rmtree(out)


def main():
    options = argparse.ArgumentParser()
    options.add_argument("assets", type=Path)
    options.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    options.add_argument("--depth", nargs="+", default=["f32", "u16"])
    options.add_argument("--size", default="1280x720")
    options.add_argument("--episodes", type=int, default=1)
    options.add_argument("--programs", type=Path, default=Path(__file__).resolve().parents[2] / "target" / "release")
    options.add_argument("--folder", type=Path)
    options.add_argument("--adapter")
    options.add_argument("--worker", help="omit for programs without this option")
    options = options.parse_args()
    with tempfile.TemporaryDirectory(prefix="wheelarm_collect_", dir=options.folder) as folder:
        for depth in options.depth:
            for workers in options.workers:
                campaign(options, depth, workers, Path(folder))


if __name__ == "__main__":
    main()
