#!/usr/bin/env python3
"""Measures the success of the scripted expert, near and anywhere, without and with a person.

    python3 tests/bench/expert.py --programs target/release --out DIR --first 950000 --episodes 20 --jobs 2

Runs `wheelarm evaluate` four times over the same seeds, prints one row per task and group,
and writes DIR/expert.json. Every attempted seed counts; none is replaced. Groups:

    near             every task
    anywhere         every task that is not a care task
    near+person      every task, with a person sampled from the seed
    anywhere+person  every task that is not a care task, with a person sampled from the seed

Exit status 1 when a group is below its goal (98, 97, 95, 95 %).
"""

import argparse
import collections
import json
import math
import subprocess
import sys
from pathlib import Path

CARE = ("serve_", "take_floor_", "throw_")
# Name, options of `wheelarm evaluate`, whether care tasks are included, goal.
GROUPS = (
    ("near", [], True, 0.98),
    ("anywhere", ["--starts", "anywhere"], False, 0.97),
    ("near+person", ["--person", "any"], True, 0.95),
    ("anywhere+person", ["--starts", "anywhere", "--person", "any"], False, 0.95),
)


def wilson(successes, count, z=1.959964):
    share, square = successes / count, z * z / count
    middle, half = share + square / 2, z * math.sqrt(share * (1 - share) / count + square / (4 * count))
    return (middle - half) / (1 + square), (middle + half) / (1 + square)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--programs", type=Path, default=Path("target/release"))
    parser.add_argument("--assets", type=Path, default=Path("assets"))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first", type=int, required=True, help="first seed")
    parser.add_argument("--episodes", type=int, default=20, help="episodes of each task and group")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--groups", default=",".join(name for name, *_ in GROUPS))
    parser.add_argument("--tasks", help="comma separated; every task of the assets when absent")
    args = parser.parse_args()
    names = sorted(path.stem for path in (args.assets / "tasks").glob("*.toml"))
    chosen = args.tasks.split(",") if args.tasks else names
    unknown = set(chosen) - set(names) | set(args.groups.split(",")) - {name for name, *_ in GROUPS}
    if unknown:
        sys.exit(f"unknown task or group {sorted(unknown)}; tasks: {names}")
    report, missed = [], []
    for group, options, with_care, goal in GROUPS:
        if group not in args.groups.split(","):
            continue
        tasks = [task for task in chosen if with_care or not task.startswith(CARE)]
        folder = args.out / group
        command = [
            args.programs / "wheelarm", "evaluate", "--task", ",".join(tasks), "--no-grid",
            "--seeds", f"{args.first}..{args.first + args.episodes}", "--jobs", args.jobs,
            "--assets", args.assets, "--out", folder, *options,
        ]
        folder.mkdir(parents=True, exist_ok=True)
        with open(args.out / f"{group}.log", "w") as log:
            subprocess.run([str(word) for word in command], stdout=log, stderr=subprocess.STDOUT, check=False)
        entries = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
        done = {(entry["task"], entry["seed"]): entry for entry in entries}
        wanted = len(tasks) * args.episodes
        if len(done) != wanted:
            missed.append(f"{group}: {len(done)} of {wanted} episodes ran, see {args.out / group}.log")
        for task in tasks:
            of = [entry for (name, _), entry in done.items() if name == task]
            print(f"  {group:16} {task:22} {sum(e['success'] for e in of):3} of {len(of)}")
        failures = [e for e in done.values() if not e["success"]]
        for entry in failures:
            print(f"    {entry['task']} {entry['seed']}: {entry['end']}: {entry['why'][:160]}")
        good = len(done) - len(failures)
        low, high = wilson(good, wanted)
        worst = collections.defaultdict(float)
        for entry in done.values():
            for condition in entry["conditions"] if entry["success"] else ():
                if condition["name"].startswith(("clear_of_person", "no_hard_collision")):
                    worst[condition["name"]] = max(worst[condition["name"]], condition["value"])
        row = {
            "group": group, "successes": good, "episodes": wanted, "interval": [low, high], "goal": goal,
            "ends": dict(collections.Counter(e["end"] for e in failures)), "greatest_in_successes": dict(worst),
        }
        report.append(row)
        print(f"{group:16} {good} of {wanted} = {good / wanted:.1%} [{low:.1%}, {high:.1%}], goal {goal:.0%}; greatest in successes {dict(worst)}", flush=True)
        if good / wanted < goal:
            missed.append(f"{group}: {good / wanted:.1%} is below {goal:.0%}")
    (args.out / "expert.json").write_text(json.dumps(report, indent=1) + "\n")
    for line in missed:
        print(f"missed: {line}")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
