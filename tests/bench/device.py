"""Measures `wheelarm collect` on a host with one or several GPUs.

device.py [--programs DIR] [--assets DIR] [--memory /dev/shm] [--disk DIR]
          [--out DIR] [--seconds 460] [--simulated 100] [--worker process]
          [--kinds small 720p 720p-u16] [--into memory disk] [--per-core 0.75]
          [--scratch DIR] [--rounds 1] [--against report.json]

Needs only Python's standard library and the programs `wheelarm`, `wheelarm-server`
and `wheelarm-worker`. Each row is one campaign: simulated seconds in the dataset over
wall seconds, including start and manifest. Rows with fewer cards than the host has use
the same share of its cores. The content of a file is dropped as soon as the campaign
has checked and registered it. With --rounds N the rows run N times, in turn: each shows
its median, and the least and greatest rate. With --against a former `report.json` each row
also shows its ratio to that. Writes `report.md` and `report.json` to --out. Exit code 1 when
a row misses its goal, 2 when a row could not be measured.
"""

import argparse
import json
import math
import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

PLAN = """
name = "bench"
purpose = "train"
first_seed = 10000
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
# A successful episode of that task lasts 14 to 17 s.
EPISODE_SECONDS = 14.0
KINDS = {
    "small": dict(size=(224, 126), depth="none", per_core=1.0),
    "720p": dict(size=(1280, 720), depth="f32", per_core=0.75),
    "720p-u16": dict(size=(1280, 720), depth="u16", per_core=0.75),
}
# Multiples of real time, summed: one large GPU with 16 cores; and per core of a host
# that renders on the CPU.
GOALS = {("small", 1, "memory"): 130.0, ("720p", 1, "memory"): 60.0, ("720p-u16", 1, "memory"): 70.0}
CORE_GOALS = {("small", 1, "memory"): 3.0}
# Two GPUs with twice the cores relative to one GPU.
SCALING = 1.9


def cards(programs):
    """Indices and names of the GPUs, or of the first other adapter."""
    command = [str(programs / "wheelarm-server"), "--list-adapters"]
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"listing the adapters failed: {result.stderr.strip()}")
    found = re.findall(r"^(\d+): (.*)$", result.stdout, re.M)
    return [pair for pair in found if "[GPU, " in pair[1]] or found[:1]


class Dropper(threading.Thread):
    """Frees the disk space of completed files; they keep their length."""

    def __init__(self, folder):
        super().__init__(daemon=True)
        self.folder, self.done = folder, threading.Event()
        self.dropped = set()

    def journal(self):
        names = set()
        for path in self.folder.glob("journal/*.jsonl"):
            for line in path.read_text().splitlines():
                try:
                    entry = json.loads(line)
                except ValueError:
                    continue
                if entry.get("kind") == "done":
                    names.add(entry["file"])
        return names

    def run(self):
        while not self.done.wait(0.5):
            for name in self.journal() - self.dropped:
                path = self.folder / name
                size = path.stat().st_size
                # Never shorter: the campaign checks that its files are complete.
                command = ["fallocate", "--punch-hole", "--offset", "0", "--length", str(size), path]
                subprocess.run(command, check=True)
                self.dropped.add(name)


def disk_rate(folder, seconds=4.0):
    """Durable write rate of the disk in bytes per second."""
    block = os.urandom(1 << 24)
    path = folder / "rate.bin"
    started, written = time.monotonic(), 0
    with open(path, "wb", buffering=0) as file:
        while time.monotonic() - started < seconds:
            written += file.write(block)
            if written % (1 << 28) == 0:
                os.fsync(file.fileno())
        os.fsync(file.fileno())
    rate = written / (time.monotonic() - started)
    path.unlink()
    return rate


def campaign(options, kind, adapters, cores, place, simulated, deadline):
    """Runs one campaign and returns its row."""
    settings = KINDS[kind]
    width, height = settings["size"]
    workers = max(1, round(len(cores) * (options.per_core or settings["per_core"])))
    episodes = workers * math.ceil(simulated / EPISODE_SECONDS)
    folder = Path(tempfile.mkdtemp(prefix="wheelarm_device_", dir=place))
    try:
        rate = disk_rate(folder) if place == options.disk else None
        plan = folder / "plan.toml"
        plan.write_text(PLAN.format(depth=settings["depth"], width=width, height=height, episodes=episodes))
        out = folder / "set"
        command = [options.programs / "wheelarm", "collect", plan, "--out", out]
        command += ["--workers", workers, "--assets", options.assets]
        if options.scratch is not None and place == options.disk:
            command += ["--scratch", options.scratch]
        if options.worker != "none":
            command += ["--adapters", ",".join(adapters), "--worker", options.worker]
        command = [str(part) for part in command]
        print(" ".join(command), flush=True)
        dropper = Dropper(out)
        dropper.start()
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        started = time.monotonic()
        left = deadline - started
        if left < 20:
            raise RuntimeError("not enough time left; increase --seconds")
        with tempfile.TemporaryFile("w+") as output:
            child = subprocess.Popen(
                command, stdout=output, stderr=output, preexec_fn=lambda: os.sched_setaffinity(0, cores)
            )
            try:
                status = child.wait(timeout=left)
            except subprocess.TimeoutExpired:
                child.terminate()
                child.wait(timeout=30)
                status = "timeout; increase --seconds"
            wall = time.monotonic() - started
            output.seek(0)
            tail = output.read()[-2000:]
        dropper.done.set()
        dropper.join()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if status != 0:
            raise RuntimeError(f"exit {status}: {tail}")
        manifest = json.loads((out / "manifest.json").read_text())
        made = manifest["episodes"]
        images = sum(count for e in made for name, count in e["counts"].items() if name.startswith("camera/"))
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return dict(
            factor=manifest["seconds"] / wall,
            simulated=manifest["seconds"],
            wall=wall,
            workers=workers,
            cores=len(cores),
            pictures_per_second=images / wall,
            megabytes_per_second=manifest["bytes"] * 1e-6 / wall,
            cpu_ms_per_simulated_second=1000 * cpu / manifest["seconds"],
            missed=sum(e["missed"] for e in made),
            failed=len(manifest["failed_attempts"]),
            disk_megabytes_per_second=None if rate is None else rate * 1e-6,
            command=" ".join(command),
        )
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def table(rows):
    """Markdown of rows that `summary` made."""
    head = "| images | cards | cores | workers | into | x real time | least to greatest | goal | former | simulated s | MB/s | disk alone MB/s | CPU ms per simulated s | missed |"
    columns = head.count("|") - 1
    lines = [head, "|" + " --- |" * columns]
    for row in rows:
        cells = [row["pictures"], row["cards"]]
        if "problem" in row:
            cells += ["", "", row["into"], f"not measured: {row['problem'].splitlines()[0]}"]
        else:
            shown = lambda value, form: "" if value is None else format(value, form)
            cells += [row["cores"], row["workers"], row["into"], f"{row['factor']:.1f}"]
            cells.append(f"{min(row['factors']):.1f} to {max(row['factors']):.1f}" if len(row["factors"]) > 1 else "")
            cells.append("" if row["goal"] is None else f">= {row['goal']:.1f}")
            cells.append("" if row["former"] is None else f"{row['former']:.1f} ({row['factor'] / row['former']:.2f} x)")
            cells += [f"{row['simulated']:.0f}", f"{row['megabytes_per_second']:.0f}"]
            cells += [shown(row["disk_megabytes_per_second"], ".0f"), f"{row['cpu_ms_per_simulated_second']:.0f}", row["missed"]]
        cells += [""] * (columns - len(cells))
        lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
    return "\n".join(lines)


def key(row):
    return row["pictures"], row["cards"], row["into"]


def summary(rounds, former):
    """One row of its rounds: the one with the median rate, and the rates of all."""
    done = sorted((row for row in rounds if "factor" in row), key=lambda row: row["factor"])
    if not done:
        return dict(rounds[-1])
    row = dict(done[(len(done) - 1) // 2])
    row["factors"] = [one["factor"] for one in done]
    row["factor"] = statistics.median(row["factors"])
    row["missed"] = max(one["missed"] for one in done)
    row["former"] = former.get(key(row))
    failed = [one["problem"] for one in rounds if "problem" in one]
    return row | dict(problem=failed[0]) if failed else row


def rates(path):
    """Rates of a former `report.json` by row."""
    try:
        rows = json.loads(path.read_text())["rows"]
        return {key(row): row["factor"] for row in rows if "factor" in row}
    except (OSError, ValueError, KeyError, TypeError) as problem:
        sys.exit(f"cannot read {path}: {problem}; name a report.json that this program wrote")


def main():
    root = Path(__file__).resolve().parents[2]
    options = argparse.ArgumentParser()
    options.add_argument("--programs", type=Path, default=root / "target" / "release")
    options.add_argument("--assets", type=Path, default=root / "assets")
    options.add_argument("--memory", type=Path, default=Path("/dev/shm"))
    options.add_argument("--disk", type=Path, default=Path(tempfile.gettempdir()))
    options.add_argument("--scratch", type=Path, help="folder for unfinished recordings, in rows to disk")
    options.add_argument("--out", type=Path, default=root / "data" / "bench_device")
    options.add_argument("--seconds", type=float, default=460.0, help="total wall time")
    options.add_argument("--simulated", type=float, default=100.0, help="seconds per worker into memory")
    options.add_argument("--worker", default="process", help="`none` for programs without this option")
    options.add_argument("--per-core", type=float, help="workers per core, instead of the kind's default")
    options.add_argument("--into", nargs="+", default=["memory", "disk"], choices=["memory", "disk"])
    options.add_argument("--kinds", nargs="+", default=list(KINDS), choices=list(KINDS))
    options.add_argument("--rounds", type=int, default=1, help="times that every row is measured, in turn")
    options.add_argument("--against", type=Path, help="report.json of a former run to compare with")
    options = options.parse_args()
    former = rates(options.against) if options.against else {}
    options.out.mkdir(parents=True, exist_ok=True)
    deadline = time.monotonic() + options.seconds
    found = cards(options.programs)
    cores = sorted(os.sched_getaffinity(0))
    print(f"{len(cores)} cores; " + "; ".join(f"{index}: {name}" for index, name in found), flush=True)
    counts = sorted({1, min(2, len(found)), len(found)})
    wanted = [(kind, count, "memory") for kind in options.kinds for count in counts]
    wanted += [(kind, counts[-1], "disk") for kind in options.kinds]
    wanted = [row for row in wanted if row[2] in options.into]
    rounds, rows = [], []
    for kind, count, into in wanted * max(1, options.rounds):
        share = cores[: max(1, len(cores) * count // counts[-1])]
        adapters = [index for index, _ in found[:count]]
        # A disk is slower, and a longer run gives the same result.
        place, simulated = (options.memory, options.simulated) if into == "memory" else (options.disk, 0.4 * options.simulated)
        row = dict(pictures=kind, cards=count, into=into)
        try:
            row |= campaign(options, kind, adapters, share, place, simulated, deadline)
            row["goal"] = GOALS.get((kind, count, into))
            if "[GPU, " not in found[0][1]:
                goal = CORE_GOALS.get((kind, count, into))
                row["goal"] = goal and goal * len(share)
            if count == 2 and into == "memory":
                one = next((r for r in rows if r["pictures"] == kind and r["cards"] == 1 and "factor" in r), None)
                row["goal"] = SCALING * one["factor"] if one else None
        except (OSError, RuntimeError, subprocess.SubprocessError) as problem:
            row["problem"] = str(problem)
        rounds.append(row)
        rows = [summary([row for row in rounds if key(row) == each], former) for each in dict.fromkeys(map(key, rounds))]
        print(table([summary([row], former)]).splitlines()[-1], flush=True)
        text = table(rows)
        (options.out / "report.md").write_text(text + "\n")
        report = dict(cores=len(cores), adapters=[name for _, name in found], rows=rows)
        (options.out / "report.json").write_text(json.dumps(report, indent=1) + "\n")
    print("\n" + table(rows))
    if any("problem" in row for row in rows):
        return 2
    met = all(row["goal"] is None or row["factor"] >= row["goal"] for row in rows)
    return 0 if met and all(row["missed"] == 0 for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
