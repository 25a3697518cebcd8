#!/usr/bin/env python3
"""Prints the table of `train_tasks.sh`: successes by task of every evaluation in a folder.

    python3 client/learn/scripts/tasks_table.py OUT TASK,TASK,...
    python3 client/learn/scripts/tasks_table.py --whole OUT/EVALUATION TASK,...   # seeds with all tasks
"""

import json
import math
import sys
from pathlib import Path

EVALUATIONS = ("seen", "held_out", "hold", "repeat", "replay")
EXCLUDED = "close_drawer"  # not one of the thirteen tasks of WheelArm-Sim
PAIRS = (("pick_mustard", "pick_crackers"), ("pick_bowl", "pick_blue_mug"))


def read_entries(folder):
    path = folder / "episodes.jsonl"
    found = {}
    for line in path.read_text().splitlines() if path.exists() else []:
        try:
            entry = json.loads(line)
        except ValueError:  # truncated by an interruption
            continue
        found[entry["task"], entry["seed"]] = entry
    return list(found.values())


def wilson(successes, count, z=1.959964):
    """Wilson interval of a share, 95 %."""
    if not count:
        return 0.0, 1.0
    share, square = successes / count, z * z / count
    middle, half = share + square / 2, z * math.sqrt(share * (1 - share) / count + square / (4 * count))
    return max(0.0, (middle - half) / (1 + square)), min(1.0, (middle + half) / (1 + square))


def count_successes(entries):
    """Successes and episodes, without seeds for which the grammar has no sentence."""
    entries = [entry for entry in entries if entry.get("broken") != "scenario"]
    return sum(entry["success"] for entry in entries), len(entries)


def format_share(successes, count):
    return f"{successes} of {count}" if count else "–"


def mean_progress(entries):
    percents = [entry["course"]["percent"] for entry in entries if entry.get("course")]
    return f"{sum(percents) / len(percents):.0f}" if percents else "–"


def count_touched(entries):
    reached = [entry["course"]["percent"] >= 40 for entry in entries if entry.get("course")]
    return f"{sum(reached)} of {len(reached)}"


def count_complete_seeds(folder, tasks):
    """Number of seeds, from the first one, with all tasks."""
    present = {(entry["task"], entry["seed"]) for entry in read_entries(folder)}
    seeds = sorted({seed for _, seed in present})
    count = 0
    while count < len(seeds) and all((task, seeds[0] + count) in present for task in tasks):
        count += 1
    return count


def main():
    if sys.argv[1] == "--whole":
        print(count_complete_seeds(Path(sys.argv[2]), sys.argv[3].split(",")))
        return
    out, tasks = Path(sys.argv[1]), sys.argv[2].split(",")
    all_of = {name: [e for e in read_entries(out / name) if e["task"] in tasks] for name in EVALUATIONS}
    shown = [name for name in EVALUATIONS if all_of[name]]
    print("| task | " + " | ".join(shown) + " | progress seen, % | ends seen |")
    print("|---" * (len(shown) + 3) + "|")
    rates = {name: [] for name in shown}
    for task in tasks:
        own = {name: [e for e in all_of[name] if e["task"] == task] for name in shown}
        ends = {}
        for entry in own.get("seen", []):
            ends[entry["end"]] = ends.get(entry["end"], 0) + 1
        text = ", ".join(f"{n} {end}" for end, n in sorted(ends.items(), key=lambda pair: -pair[1]))
        cells = [format_share(*count_successes(own[name])) for name in shown]
        print(f"| {task} | " + " | ".join(cells) + f" | {mean_progress(own.get('seen', []))} | {text} |")
        for name in shown:
            successes, count = count_successes(own[name])
            if count and task != EXCLUDED:
                rates[name].append(successes / count)
    means = {name: sum(r) / len(r) for name, r in rates.items() if r}
    print(f"\nMean of the tasks without {EXCLUDED}:")
    for name in means:
        successes, count = count_successes([e for e in all_of[name] if e["task"] != EXCLUDED])
        low, high = wilson(successes, count)
        refused = sum(e.get("broken") == "scenario" for e in all_of[name])
        print(
            f"- {name}: {100 * means[name]:.1f} % of {len(rates[name])} tasks; {successes} of {count} episodes "
            f"(Wilson {100 * low:.1f} to {100 * high:.1f} %), {refused} seeds without a sentence"
        )
    if means.get("seen") and "held_out" in means:
        print(f"- held-out wording: {means['held_out'] / means['seen']:.2f} of seen")
    for name in ("blind-pick_mustard", "blind-shipped"):
        if found := read_entries(out / name):
            print(f"- {name}, images of another episode: {format_share(*count_successes(found))}, touched {count_touched(found)}")
    for task, other in PAIRS:
        found = read_entries(out / f"sentence-{other}")
        for which in (task, other) if found else ():
            own = [e for e in found if e["task"] == which]
            print(
                f"- with the sentence of {other}, judged by {which}: {format_share(*count_successes(own))}, "
                f"touched {count_touched(own)}"
            )


if __name__ == "__main__":
    main()
