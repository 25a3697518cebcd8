"""Guesses the task from the sampled values of a scene, without image and sentence.

A scene that reveals the task teaches a policy to ignore the sentence. Three classifiers
(logistic regression, nearest centroid, random forest; five folds) use the output of
`wheelarm-server --draws`: presence, pose, mass and friction of every object of the home, all
drawers, the robot's start. They guess within each area, and over the areas among the scenes that
sampled the same areas, so that no other table or drawer may reveal the task. The best of them
may exceed chance by at most --margin. With --before they use the table of an old version, in
which every task sampled its own scene; there they must be right far more often, which shows
that the check detects a leak.

With --homes it guesses the target of a task of every home among the objects in the scene that
the task could request, from their kind, their place relative to the others and to the chair, mass
and friction. Chance is the mean of one over the number of these objects. At last it guesses over
all tasks together, mixed as in --plan.

Usage: guess_task.py --server PROGRAM --assets DIR [--seeds N] [--starts near]
       guess_task.py --server PROGRAM --assets DIR --homes [train|held_out|HOME,HOME] [--seeds N]
                     [--objects PACK,PACK] [--plan assets/campaigns/worlds-1k.toml]
       guess_task.py --before tests/data/draws-before.csv.gz
"""

import argparse
import csv
import gzip
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib
import warnings

import numpy
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold, StratifiedKFold, cross_val_score
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


def candidates(row, kinds):
    """One row of numbers for each of `kinds` in a scene, and which of them is the target."""
    there = [name for name in kinds if float(row.get(f"{name}_there") or 0.0) > 0.0]
    number = lambda name, key: float(row[f"{name}_{key}"])
    at = numpy.array([[number(name, key) for key in "xyz"] for name in there])
    start = numpy.array([float(row["start_x"]), float(row["start_y"])])
    inwards = at[:, :2] - start
    far = numpy.hypot(*inwards.T)
    # Towards the place, and to its left.
    ahead = inwards.mean(axis=0) / max(1e-6, numpy.hypot(*inwards.mean(axis=0)))
    middle = at[:, :2] - at[:, :2].mean(axis=0)
    deep = middle @ ahead
    left = middle @ numpy.array([-ahead[1], ahead[0]])
    values = []
    for i, name in enumerate(there):
        yaw = number(name, "yaw")
        own = [len(there), deep[i], left[i], abs(left[i]), far[i] - far.mean(), float(far[i] == far.min()),
               number(name, "mass"), number(name, "friction"), numpy.cos(yaw), numpy.sin(yaw),
               at[i, 2] - at[:, 2].mean(), number(name, "up")]
        values.append(own + [float(name == kind) for kind in kinds])
    return values, [name == row["target"] for name in there]


def guess_targets(what, rows, kinds, args):
    """Guesses the target among `kinds` in each scene; whether the best share is within its limit."""
    values, labels, groups, chance = [], [], [], []
    for scene, row in enumerate(rows):
        there = [name for name in kinds if float(row.get(f"{name}_there") or 0.0) > 0.0]
        # A target alone needs no sentence.
        if row["target"] not in there or len(there) < 2:
            continue
        own, targets = candidates(row, kinds)
        values += own
        labels += targets
        groups += [scene] * len(targets)
        chance.append(1 / len(targets))
    values, labels, groups = map(numpy.array, (values, labels, groups))
    if len(chance) < MIN_SCENES:
        print(f"{what}: {len(chance)} scenes with several objects, too few for a guess", flush=True)
        return True
    shares = {}
    for name, classifier in {
        "logistic regression": make_pipeline(StandardScaler(), LogisticRegression(max_iter=2000, C=0.1)),
        "random forest": RandomForestClassifier(300, min_samples_leaf=3, random_state=0, n_jobs=-1),
    }.items():
        right = 0
        for known, asked in GroupKFold(5).split(values, labels, groups):
            fitted = classifier.fit(values[known], labels[known])
            guess = fitted.predict_proba(values[asked])[:, 1]
            for scene in numpy.unique(groups[asked]):
                own = groups[asked] == scene
                right += labels[asked][own][guess[own].argmax()]
        shares[name] = right / len(chance)
    mean = float(numpy.mean(chance))
    within = max(shares.values()) <= mean + args.margin
    text = ", ".join(f"{name} {share:.1%}" for name, share in shares.items())
    print(f"{what}: {len(chance)} of {len(rows)} scenes, chance {mean:.1%}, at most {mean + args.margin:.1%}: "
          f"{text}{'' if within else '  FAILED'}", flush=True)
    return within


def worlds(args):
    """Guesses the target among the objects of scenes in many homes."""
    if args.homes in ("train", "held_out"):
        split = pathlib.Path(args.assets) / "splits/worlds/worlds-1.toml"
        homes = tomllib.loads(split.read_text())[args.homes]["homes"]
    else:
        homes = args.homes.split(",")
    options = []
    for name, value in (("--packs", args.packs), ("--objects", args.objects)):
        options += [name, value] if value else []
    if args.objects and args.homes in ("train", "held_out"):
        folder = tempfile.TemporaryDirectory()
        scenario = pathlib.Path(folder.name) / "scenario.toml"
        scenario.write_text(f'object_split = "{args.homes}"\n')
        options += ["--scenario", scenario]
    scenes, targets = {}, {}
    for index, home in enumerate(homes):
        base = [args.server, "--assets", args.assets, *options, "--scene", home]
        listed = subprocess.run([*base, "--list-tasks", "--json"], check=True, capture_output=True).stdout
        for task in json.loads(listed):
            # Tasks of an area belong to another home, and those of doors and drawers place no object.
            if task["area"] or task["name"].endswith(("_door", "_drawer")):
                continue
            if args.tasks and task["name"] not in args.tasks.split(","):
                continue
            first = 10_000 + index * args.seeds
            command = [*base, "--task", task["name"], "--starts", args.starts,
                       "--draws", f"{first}..{first + args.seeds}"]
            out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            scenes.setdefault(task["name"], []).extend(csv.DictReader(out.splitlines()))
            targets.setdefault(task["name"], set()).update(task["targets"])
    fine = True
    for task, rows in sorted(scenes.items()):
        fine &= guess_targets(f"{len(homes)} homes, {task}", rows, sorted(targets[task]), args)
    if args.plan:
        weights = {one["name"]: one["episodes"] for one in tomllib.loads(pathlib.Path(args.plan).read_text())["task"]}
        most = min(len(scenes[task]) / weight for task, weight in weights.items())
        mixed = [row for task, weight in weights.items() for row in scenes[task][:: max(1, int(len(scenes[task]) / (most * weight)))]]
        kinds = sorted(set().union(*(targets[task] for task in weights)))
        fine &= guess_targets(f"{len(homes)} homes, tasks of {pathlib.Path(args.plan).stem} together", mixed, kinds, args)
    return fine


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
    parser.add_argument("--homes", help="homes, or a side of splits/worlds/worlds-1.toml")
    parser.add_argument("--packs", help="folder of the packs of these homes")
    parser.add_argument("--objects", help="packs whose objects may be there, separated by commas")
    parser.add_argument("--tasks", help="only these tasks of homes, separated by commas")
    parser.add_argument("--plan", help="plan of a campaign whose tasks are also guessed together")
    args = parser.parse_args()
    fine = True
    if args.before:
        fine &= before(args.before)
    if args.server:
        fine &= worlds(args) if args.homes else now(args)
    sys.exit(0 if fine else 1)


if __name__ == "__main__":
    main()
