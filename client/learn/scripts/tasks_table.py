#!/usr/bin/env python3
"""The table of `train_tasks.sh`: successes by task of every evaluation in a folder.

    python3 client/learn/scripts/tasks_table.py OUT TASK,TASK,...
    python3 client/learn/scripts/tasks_table.py --whole OUT/EVALUATION TASK,...   # seeds of which all tasks are there
"""

import json
import math
import sys
from pathlib import Path

EVALUATIONS = ("seen", "held_out", "hold", "repeat", "replay")
BESIDE = "close_drawer"  # beside the thirteen tasks of WheelArm-Sim
PAIRS = (("pick_mustard", "pick_crackers"), ("pick_bowl", "pick_blue_mug"))


def entries(folder):
    path = folder / "episodes.jsonl"
    found = {}
    for line in path.read_text().splitlines() if path.exists() else []:
        try:
            entry = json.loads(line)
        except ValueError:  # cut by an interruption
            continue
        found[entry["task"], entry["seed"]] = entry
    return list(found.values())


def wilson(successes, count, z=1.959964):
    if not count:
        return 0.0, 1.0
    share, square = successes / count, z * z / count
    middle, half = share + square / 2, z * math.sqrt(share * (1 - share) / count + square / (4 * count))
    return max(0.0, (middle - half) / (1 + square)), min(1.0, (middle + half) / (1 + square))


def counted(told):
    """Successes and episodes; what the grammar has no sentence for is none."""
    told = [entry for entry in told if entry.get("broken") != "scenario"]
    return sum(entry["success"] for entry in told), len(told)


def share(successes, count):
    return f"{successes} of {count}" if count else "–"


def progress(told):
    ways = [entry["course"]["percent"] for entry in told if entry.get("course")]
    return f"{sum(ways) / len(ways):.0f}" if ways else "–"


def touched(told):
    reached = [entry["course"]["percent"] >= 40 for entry in told if entry.get("course")]
    return f"{sum(reached)} of {len(reached)}"


def whole(folder, tasks):
    """Seeds, from the first, of which all tasks are there."""
    there = {(entry["task"], entry["seed"]) for entry in entries(folder)}
    seeds = sorted({seed for _, seed in there})
    count = 0
    while count < len(seeds) and all((task, seeds[0] + count) in there for task in tasks):
        count += 1
    return count


def main():
    if sys.argv[1] == "--whole":
        print(whole(Path(sys.argv[2]), sys.argv[3].split(",")))
        return
    out, tasks = Path(sys.argv[1]), sys.argv[2].split(",")
    all_of = {name: [e for e in entries(out / name) if e["task"] in tasks] for name in EVALUATIONS}
    shown = [name for name in EVALUATIONS if all_of[name]]
    print("| task | " + " | ".join(shown) + " | progress seen, % | ends seen |")
    print("|---" * (len(shown) + 3) + "|")
    rates = {name: [] for name in shown}
    for task in tasks:
        own = {name: [e for e in all_of[name] if e["task"] == task] for name in shown}
        ends = {}
        for entry in own.get("seen", []):
            ends[entry["end"]] = ends.get(entry["end"], 0) + 1
        words = ", ".join(f"{n} {end}" for end, n in sorted(ends.items(), key=lambda pair: -pair[1]))
        cells = [share(*counted(own[name])) for name in shown]
        print(f"| {task} | " + " | ".join(cells) + f" | {progress(own.get('seen', []))} | {words} |")
        for name in shown:
            successes, count = counted(own[name])
            if count and task != BESIDE:
                rates[name].append(successes / count)
    means = {name: sum(r) / len(r) for name, r in rates.items() if r}
    print(f"\nMean of the tasks without {BESIDE}:")
    for name in means:
        successes, count = counted([e for e in all_of[name] if e["task"] != BESIDE])
        low, high = wilson(successes, count)
        refused = sum(e.get("broken") == "scenario" for e in all_of[name])
        print(
            f"- {name}: {100 * means[name]:.1f} % of {len(rates[name])} tasks; {successes} of {count} episodes "
            f"(Wilson {100 * low:.1f} to {100 * high:.1f} %), {refused} seeds refused for want of a sentence"
        )
    if means.get("seen") and "held_out" in means:
        print(f"- held-out wording: {means['held_out'] / means['seen']:.2f} of seen")
    for name in ("blind-pick_mustard", "blind-shipped"):
        if told := entries(out / name):
            print(f"- {name}, another episode's pictures: {share(*counted(told))}, touched {touched(told)}")
    for task, other in PAIRS:
        told = entries(out / f"told-{other}")
        for which in (task, other) if told else ():
            own = [e for e in told if e["task"] == which]
            print(f"- told the sentence of {other}, judged by {which}: {share(*counted(own))}, touched {touched(own)}")


if __name__ == "__main__":
    main()
