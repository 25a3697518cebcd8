"""Compares a campaign over many homes with the same campaign in one home, pair by pair.

worlds.py [--programs DIR] [--assets DIR] [--out DIR] [--homes train|HOME,HOME] [--one HOME]
          [--episodes 8] [--rounds 3] [--workers N] [--adapters 0] [--into /dev/shm] [--seconds 900]

Both campaigns have small images without depth, the objects of the packs, the same task, seeds and
workers. A round runs both, in turn first the one and the other. The rate is simulated seconds over
wall seconds, including start and manifest. All homes are made before the first round; workers then read them
from the cache folder. Needs only Python's standard library. Prints one table: rates, their ratio,
and memory of a worker (largest resident set; proportional set, in which shared pages count once).
Exit code 1 when the median ratio is below 0.9.
"""

import argparse
import json
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import tomllib

PLAN = """
name = "bench"
purpose = "train"
first_seed = 10000
attempts = 8
depth = "none"
[[scenario.cameras]]
name = "gen3"
width = 224
height = 126
[[scenario.cameras]]
name = "wheelchair"
width = 224
height = 126
[variation]
homes = {homes}
objects = "train"
[[task]]
name = "take_anything"
episodes = {episodes}
"""
GOAL = 0.9


class Memory(threading.Thread):
    """Largest resident set and proportional set of the workers, bytes."""

    def __init__(self):
        super().__init__(daemon=True)
        self.done, self.resident, self.proportional = threading.Event(), 0, []

    def run(self):
        while not self.done.wait(1.0):
            sizes = []
            for folder in pathlib.Path("/proc").glob("[0-9]*"):
                try:
                    if (folder / "comm").read_text().strip() != "wheelarm-worker":
                        continue
                    lines = (folder / "smaps_rollup").read_text().splitlines()
                except OSError:
                    continue
                found = {line.split(":")[0]: line.split()[1] for line in lines if line.endswith(" kB")}
                self.resident = max(self.resident, 1024 * int(found.get("Rss", 0)))
                sizes.append(1024 * int(found.get("Pss", 0)))
            if sizes:
                self.proportional.append(statistics.mean(sizes))


def campaign(options, homes, deadline):
    """Runs one campaign; returns its rate and the memory of a worker."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="wheelarm_worlds_", dir=options.into))
    try:
        plan = folder / "plan.toml"
        plan.write_text(PLAN.format(homes=json.dumps(homes), episodes=options.workers * options.episodes))
        command = [options.programs / "wheelarm", "collect", plan, "--out", folder / "set",
                   "--workers", options.workers, "--assets", options.assets]
        if options.adapters:
            command += ["--adapters", options.adapters]
        memory = Memory()
        memory.start()
        started = time.monotonic()
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True,
                              timeout=max(1.0, deadline - started))
        wall = time.monotonic() - started
        memory.done.set()
        manifest = json.loads((folder / "set/manifest.json").read_text())
        if done.returncode not in (0, 3) or not manifest["episodes"]:
            raise RuntimeError(f"exit {done.returncode}: {(done.stdout + done.stderr)[-2000:]}")
        attempts = manifest["episodes"] + manifest["failed_attempts"]
        return dict(rate=sum(one["seconds"] for one in attempts) / wall, wall=wall,
                    episodes=len(manifest["episodes"]), failed=len(manifest["failed_attempts"]),
                    resident=memory.resident, proportional=statistics.mean(memory.proportional or [0]))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--programs", type=pathlib.Path, default=pathlib.Path("target/release"))
    parser.add_argument("--assets", type=pathlib.Path, default=pathlib.Path("assets"))
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--homes", default="train")
    parser.add_argument("--one", default="family-nordic-0")
    parser.add_argument("--episodes", type=int, default=8, help="episodes of a worker in each campaign")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--adapters", help="GPUs, as of wheelarm collect")
    parser.add_argument("--into", type=pathlib.Path, default=pathlib.Path("/dev/shm"))
    parser.add_argument("--seconds", type=float, default=900.0)
    options = parser.parse_args()
    deadline = time.monotonic() + options.seconds
    if options.homes == "train":
        split = tomllib.loads((options.assets / "splits/worlds/worlds-1.toml").read_text())
        homes = split["train"]["homes"]
    else:
        homes = options.homes.split(",")
    started = time.monotonic()
    for home in {*homes, options.one}:
        subprocess.run([options.programs / "wheelarm-server", "--assets", options.assets, "--scene", home,
                        "--list-tasks"], check=True, capture_output=True)
    print(f"{len(homes)} homes made or read in {time.monotonic() - started:.1f} s", flush=True)
    pairs = []
    for turn in range(options.rounds):
        order = ("worlds", "one") if turn % 2 else ("one", "worlds")
        pair = {name: campaign(options, homes if name == "worlds" else [options.one], deadline) for name in order}
        pair["ratio"] = pair["worlds"]["rate"] / pair["one"]["rate"]
        pairs.append(pair)
        print(f"round {turn + 1}: one home {pair['one']['rate']:.1f} x, {len(homes)} homes "
              f"{pair['worlds']['rate']:.1f} x, ratio {pair['ratio']:.3f}", flush=True)
    ratio = statistics.median(pair["ratio"] for pair in pairs)
    print("| campaign | x real time | episodes, failed attempts | worker: largest resident, proportional MB |")
    print("| --- | --- | --- | --- |")
    for name in ("one", "worlds"):
        rows = [pair[name] for pair in pairs]
        print(f"| {name} | {statistics.median(row['rate'] for row in rows):.1f} "
              f"| {sum(row['episodes'] for row in rows)}, {sum(row['failed'] for row in rows)} "
              f"| {max(row['resident'] for row in rows) / 1e6:.0f}, "
              f"{statistics.mean(row['proportional'] for row in rows) / 1e6:.0f} |")
    print(f"median ratio {ratio:.3f}, goal at least {GOAL}")
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        report = dict(ratio=ratio, homes=homes, workers=options.workers, pairs=pairs)
        (options.out / "worlds.json").write_text(json.dumps(report, indent=1) + "\n")
    sys.exit(0 if ratio >= GOAL else 1)


if __name__ == "__main__":
    main()
