"""Guesses the task from the sampled values of a scene, without image and sentence.

A scene that reveals the task teaches a policy to ignore the sentence. Three classifiers
(logistic regression, nearest centroid, random forest; five folds) use the output of
`wheelarm-server --draws`: presence, pose, mass and friction of every object of the home, all
drawers, the robot's start. They guess within each area, and over the areas among the scenes that
sampled the same areas, so that no other table or drawer may reveal the task. The best of them
may exceed chance by at most --margin. With --before they use the table of an old version, in
which every task sampled its own scene; there they must be right far more often, which shows
that the check detects a leak.

Usage: guess_task.py --server PROGRAM --assets DIR [--seeds N] [--starts near]
       guess_task.py --before tests/data/draws-before.csv.gz
"""

import argparse
import csv
import gzip
import json
import subprocess
import sys
import warnings

import numpy
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import StratifiedKFold, cross_val_score
from sklearn.neighbors import NearestCentroid
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

# Constant columns have no information, which is allowed.
warnings.filterwarnings("ignore", message="self.within_class_std_dev_ has at least 1 zero")

LABELS = {"task", "target", "variant", "home", "seed"}
# Smallest number of scenes of a task for the guesses over areas.
MIN_SCENES = 50
# Smallest share of right guesses on the old table, by area.
BEFORE = {"coffee_table": 0.60, "kitchen_table": 0.75}


def table(lines):
    """Rows of numbers with their labels; angles as sine and cosine too."""
    rows = list(csv.DictReader(lines))
    names = [name for name in rows[0] if name not in LABELS]
    values = numpy.array([[float(row[name]) for name in names] for row in rows])
    yaws = [i for i, name in enumerate(names) if name.endswith("yaw")]
    values = numpy.hstack([values, numpy.sin(values[:, yaws]), numpy.cos(values[:, yaws])])
    return rows, values


def best(values, labels, folds=5):
    """The share of right guesses of each classifier, the best first."""
    split = StratifiedKFold(folds, shuffle=True, random_state=0)
    classifiers = {
        "logistic regression": make_pipeline(StandardScaler(), LogisticRegression(max_iter=2000)),
        "nearest centroid": make_pipeline(StandardScaler(), NearestCentroid()),
        "random forest": RandomForestClassifier(200, random_state=0, n_jobs=-1),
    }
    found = {
        name: cross_val_score(classifier, values, labels, cv=split).mean()
        for name, classifier in classifiers.items()
    }
    return sorted(found.items(), key=lambda item: -item[1])


def check(what, values, labels, low=0.0, high=1.0):
    """Prints the shares of right guesses; returns whether the best one is within its limit."""
    counts = numpy.unique(labels, return_counts=True)[1]
    chance = counts.max() / counts.sum()
    shares = best(values, labels)
    text = ", ".join(f"{name} {share:.1%}" for name, share in shares)
    limit = f"at least {low:.0%}" if low else f"at most {chance + high:.1%}"
    fine = shares[0][1] >= low if low else shares[0][1] <= chance + high
    print(f"{what}: {len(labels)} scenes, chance {chance:.1%}, {limit}: {text}"
          f"{'' if fine else '  FAILED'}", flush=True)
    return fine


def before(path):
    fine = True
    text = gzip.open(path, "rt").read()
    for part in text.split("# ")[1:]:
        area, lines = part.split("\n", 1)
        rows, values = table(lines.splitlines())
        labels = numpy.array([row["task"] for row in rows])
        fine &= check(f"before, {area}", values, labels, low=BEFORE[area])
    return fine


def now(args):
    listed = [args.server, "--assets", args.assets, "--list-tasks", "--json"]
    tasks = json.loads(subprocess.run(listed, check=True, capture_output=True).stdout)
    areas, homes, header = {}, {}, None
    for task in tasks:
        areas.setdefault(task["area"], []).append(task)
    fine = True
    for area, of_area in sorted(areas.items()):
        lines = []
        for task in of_area:
            # Tasks have disjoint seeds.
            first = 10_000 + tasks.index(task) * args.seeds
            command = [args.server, "--assets", args.assets, "--task", task["name"],
                       "--starts", args.starts, "--draws", f"{first}..{first + args.seeds}"]
            out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            header, *rows = out.splitlines()
            lines += rows
            for row in rows:
                _, _, variant, home, _ = row.split(",", 4)
                homes.setdefault(f"{home} {variant}".strip(), []).append(row)
        rows, values = table([header, *lines])
        labels = numpy.array([row["task"] for row in rows])
        variants = numpy.array([row["variant"] for row in rows])
        for variant in sorted(set(variants)):
            # The check holds within each variant; the task of the bear has only one.
            inside = variants == variant
            if len(set(labels[inside])) > 1:
                name = f"{area} {variant}".strip()
                fine &= balanced(f"{name}, task", values[inside], labels[inside], args)
        for task in of_area:
            own = labels == task["name"]
            targets = numpy.array([row["target"] for row in rows])[own]
            if len(set(targets)) > 1:
                fine &= check(f"{area}, {task['name']}, which", values[own], targets, high=args.margin)
        if len(of_area) > 1 and any(len(task["targets"]) > 1 for task in of_area):
            both = numpy.array([f"{row['task']} {row['target']}" for row in rows])
            fine &= check(f"{area}, task and which", values, both, high=args.margin)
    for home, lines in sorted(homes.items()):
        rows, values = table([header, *lines])
        labels = numpy.array([row["task"] for row in rows])
        names, counts = numpy.unique(labels, return_counts=True)
        frequent = numpy.isin(labels, names[counts >= MIN_SCENES])
        if len(set(labels[frequent])) > 1 and len(rows) >= args.least_home:
            fine &= balanced(f"{home}, task", values[frequent], labels[frequent], args)
    return fine


def balanced(what, values, labels, args):
    """Checks with equally many scenes of every task, so that frequency does not help."""
    names, counts = numpy.unique(labels, return_counts=True)
    keep = numpy.concatenate([numpy.flatnonzero(labels == name)[: counts.min()] for name in names])
    return check(what, values[keep], labels[keep], high=args.margin)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--server")
    parser.add_argument("--assets", default="assets")
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--starts", default="near")
    parser.add_argument("--margin", type=float, default=0.03)
    parser.add_argument("--least-home", type=int, default=1000,
                        help="smallest number of scenes with the same areas for a guess over areas")
    parser.add_argument("--before")
    args = parser.parse_args()
    fine = True
    if args.before:
        fine &= before(args.before)
    if args.server:
        fine &= now(args)
    sys.exit(0 if fine else 1)


if __name__ == "__main__":
    main()
