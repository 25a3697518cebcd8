#!/usr/bin/env python3
"""Measures the variety of the scripted expert's demonstrations, and the rhythm of its human style.

    python3 tests/bench/variety.py --programs target/release --out DIR --first 960000
    python3 tests/bench/variety.py --recordings DIR [--style human]

Records `--episodes` near starts of every task (`wheelarm evaluate --record`, smallest images)
in the style, or reads recordings, prints one row per task and writes DIR/variety.json. Failed
episodes are left out. Exit status 1 when a task misses a goal.

Columns of the style `quick` and goals:

    cv        coefficient of variation of the moving time, >= 30 %
    j1        standard deviation of joint 1 at the grasp, >= 15 degrees
    both      share of the moving time in which chair and arm both move, >= 10 %
    seq       step sequences (phase names) that make up 10 % each or more, >= 4
    straight  median over episodes of chord / path of the end effector in base_link, summed over
              strokes that are longer than 3 cm, <= 0.97
    bearing, height, lean   standard deviation at the grasp: bearing of the grasp point from the
              arm's base, its height over the object's origin, angle of the hand to the floor
    force     mean and standard deviation of the commanded force cap

Columns of the style `human` and goals:

    peak      greatest share of the end effector's speed power within 0.02 Hz of one frequency,
              from 0.1 Hz, in any episode, <= 15 %
    comb      greatest share at a frequency of 0.2 Hz or more and its harmonics within 0.02 Hz;
              `noise` is the share of the band that such a comb covers
    standing  share of the time in which neither chair nor arm moves, 30 to 60 %
    jerk      mean norm of the third difference of the end effector's position in house, through
              a Butterworth filter of second order at 1 Hz run forward and backward, m/s^3
    seconds   mean and range
"""

import argparse
import collections
import itertools
import json
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

# Speeds from which chair, hand and fingers count as moving: m/s, rad/s.
CHAIR = (0.01, 0.02)
HAND = (0.005, 0.02)
FINGERS = 0.02
RATE = 60.0
# Position of base_link in wheelchair_root, m; rotated by 180 degrees.
MOUNT = (0.42, 0.36, 0.55)
# Names that are in every sequence, or only mean that time passes.
ASIDE = {"planning", "stopping", "over", "thinking", "holding"}
GOALS = {"cv": 0.30, "j1": 15.0, "both": 0.10, "seq": 4, "straight": 0.97}
HUMAN = {"peak": 0.15, "standing": (0.30, 0.60)}


def rotate(quaternion, vector):
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    axis = np.stack([x, y, z], -1)
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + w[..., None] * vector)


def speeds(poses):
    """Linear and angular speed of a track of poses, m/s and rad/s."""
    steps = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1) * RATE
    dots = np.abs(np.sum(poses[1:, 3:] * poses[:-1, 3:], axis=1)).clip(0, 1)
    return steps, 2 * np.arccos(dots) * RATE


def low_pass(signal):
    """A Butterworth filter of second order at 1 Hz, forward and backward."""
    k = np.tan(np.pi / RATE)
    a0 = 1 + np.sqrt(2) * k + k * k
    b = np.array([k * k, 2 * k * k, k * k]) / a0
    a = np.array([2 * (k * k - 1), 1 - np.sqrt(2) * k + k * k]) / a0
    for _ in range(2):
        pad = 2 * signal[0] - signal[1:61][::-1]
        x, out = np.concatenate([pad, signal]), []
        x1 = x2 = y1 = y2 = x[0]
        for value in x:
            y = b[0] * value + b[1] * x1 + b[2] * x2 - a[0] * y1 - a[1] * y2
            x2, x1, y2, y1 = x1, value, y1, y
            out.append(y)
        signal = np.array(out[len(pad):])[::-1]
    return signal


def strokes(poses, speed):
    """Chord and path of each stroke of the end effector, metres."""
    moving = np.concatenate([[False], speed > HAND[0] * 2, [False]])
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    for begin, end in zip(edges[::2], edges[1::2]):
        path = np.linalg.norm(np.diff(poses[begin:end + 1, :3], axis=0), axis=1).sum()
        if path > 0.03:
            yield np.linalg.norm(poses[end, :3] - poses[begin, :3]), path


def rhythm(speed):
    """Greatest share of the power near one frequency, and near one and its harmonics."""
    power = np.abs(np.fft.rfft(speed - speed.mean())) ** 2
    frequency = np.fft.rfftfreq(len(speed), 1 / RATE)
    band = (frequency >= 0.1) & (frequency <= 5)
    power, frequency = power[band] / power[band].sum(), frequency[band]
    at = np.arange(0.1, 3, 0.01)
    peak = max(power[np.abs(frequency - f) <= 0.02].sum() for f in at)
    best = (0.0, 0.0)
    for f in at[at >= 0.2]:
        off = np.abs(frequency - f * np.round(frequency / f).clip(1))
        best = max(best, (power[off <= 0.02].sum(), 0.04 / f))
    return peak, *best


def measure(path):
    with h5py.File(path) as file:
        if not file.attrs["success"]:
            return None
        streams = file["streams"]
        names = list(streams["pose/pose"].attrs["names"])
        pose = streams["pose/pose"][:]
        tool, chair = pose[:, names.index("end_effector")], pose[:, names.index("wheelchair")]
        joints = list(streams["joint_state/position"].attrs["names"])
        position = streams["joint_state/position"][:]
        knuckle = position[:, joints.index("robotiq_85_left_knuckle_joint")]
        phases = [name.decode() for name in streams["command/phase_name"][:]]
        forces = streams["command/gripper"][:, 2]
        objects = streams["object_pose/pose"][:]
        task = file.attrs["task"]
        seconds = file.attrs["task_seconds"]
    count = min(len(tool), len(phases) + 1)
    linear, angular = speeds(tool[:count])
    rolled, turned = speeds(chair[:count])
    arm = (linear > HAND[0]) | (angular > HAND[1])
    base = (rolled > CHAIR[0]) | (turned > CHAIR[1])
    fingers = np.abs(np.diff(knuckle[:count])) * RATE > FINGERS
    moving = arm | base | fingers
    grasp = max(i for i, name in enumerate(phases) if name == "closing")
    while grasp and phases[grasp - 1] == "closing":
        grasp -= 1
    forward = rotate(tool[grasp, 3:], np.array([0.0, 0.0, 1.0]))
    point = tool[grasp, :3] + 0.13 * forward
    # The grasped object: the one that moved most after the grasp.
    moved = np.linalg.norm(objects[grasp:, :, :3] - objects[grasp, :, :3], axis=2).max(axis=0)
    object_height = objects[grasp, np.argmax(moved), 2] if moved.max() > 0.02 else 0.0
    parts = list(strokes(tool[:count], linear))
    sequence = [name for name, _ in itertools.groupby(n for n in phases if n not in ASIDE)]
    house = chair[:count, :3] + rotate(chair[:count, 3:], tool[:count, :3] * [-1, -1, 1] + MOUNT)
    hand = np.linalg.norm(np.diff(house, axis=0), axis=1) * RATE
    peak, comb, noise = rhythm(hand)
    smooth = np.stack([low_pass(house[:, axis]) for axis in range(3)], 1)
    return {
        "task": task,
        "moving": moving.sum() / RATE,
        "seconds": float(seconds),
        "j1": np.degrees(position[grasp, joints.index("joint_1")]),
        "both": (arm & base).sum() / max(moving.sum(), 1),
        "sequence": " > ".join(sequence),
        "straight": sum(c for c, _ in parts) / max(sum(p for _, p in parts), 1e-9),
        "bearing": np.degrees(np.arctan2(-point[1], -point[0])),
        "height": point[2] - object_height,
        "lean": np.degrees(np.arcsin(forward[2].clip(-1, 1))),
        "force": float(np.nanmedian(forces[grasp:grasp + 30])),
        "peak": peak,
        "comb": comb,
        "noise": noise,
        "standing": 1 - (arm | base).mean(),
        "jerk": np.linalg.norm(np.diff(smooth, 3, axis=0), axis=1).mean() * RATE**3,
    }


def spread(episodes, name):
    values = [episode[name] for episode in episodes]
    return float(np.std(values, ddof=1)) if len(values) > 1 else 0.0


def quick_row(episodes):
    counts = collections.Counter(episode["sequence"] for episode in episodes)
    moving = [episode["moving"] for episode in episodes]
    return {
        "episodes": len(episodes),
        "cv": spread(episodes, "moving") / np.mean(moving),
        "j1": spread(episodes, "j1"),
        "both": np.mean([episode["both"] for episode in episodes]),
        "seq": sum(n >= 0.1 * len(episodes) for n in counts.values()),
        "straight": np.median([episode["straight"] for episode in episodes]),
        "bearing": spread(episodes, "bearing"),
        "height": 1e3 * spread(episodes, "height"),
        "lean": spread(episodes, "lean"),
        "force": np.mean([episode["force"] for episode in episodes]),
        "force_sd": spread(episodes, "force"),
        "seconds": np.mean([episode["seconds"] for episode in episodes]),
        "sequences": {name: n / len(episodes) for name, n in counts.most_common()},
    }


def human_row(episodes):
    mean = lambda name: float(np.mean([episode[name] for episode in episodes]))
    seconds = [episode["seconds"] for episode in episodes]
    return {
        "episodes": len(episodes),
        "peak": max(episode["peak"] for episode in episodes),
        "comb": mean("comb"),
        "noise": mean("noise"),
        "standing": mean("standing"),
        "jerk": mean("jerk"),
        "seconds": np.mean(seconds),
        "least": min(seconds),
        "most": max(seconds),
        "cv": spread(episodes, "seconds") / np.mean(seconds),
    }


def missed_goals(row, human):
    if human:
        least, most = HUMAN["standing"]
        held = {"peak": row["peak"] <= HUMAN["peak"], "standing": least <= row["standing"] <= most}
    else:
        held = {name: row[name] >= goal for name, goal in GOALS.items() if name != "straight"}
        held["straight"] = row["straight"] <= GOALS["straight"]
    return [name for name, holds in held.items() if not holds]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--programs", type=Path, default=Path("target/release"))
    parser.add_argument("--assets", type=Path, default=Path("assets"))
    parser.add_argument("--recordings", type=Path, help="reads these instead of making some")
    parser.add_argument("--out", type=Path, help="folder of new recordings")
    parser.add_argument("--first", type=int, default=960000, help="first seed")
    parser.add_argument("--episodes", type=int, default=40, help="episodes of each task")
    parser.add_argument("--tasks", default="all", help="comma separated")
    parser.add_argument("--style", choices=("quick", "human"), default="quick")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--sequences", action="store_true", help="prints every step sequence")
    args = parser.parse_args()
    folder = args.recordings or args.out
    if folder is None:
        sys.exit("name a folder: --out for new recordings, --recordings for old ones")
    if args.recordings is None:
        command = [
            args.programs / "wheelarm", "evaluate", "--task", args.tasks, "--no-grid", "--record",
            "--seeds", f"{args.first}..{args.first + args.episodes}", "--style", args.style,
            "--camera", "gen3=32x18@1", "--depth", "none", "--jobs", args.jobs,
            "--assets", args.assets, "--out", folder,
        ]
        folder.mkdir(parents=True, exist_ok=True)
        with open(folder / "evaluate.log", "w") as log:
            subprocess.run([str(word) for word in command], stdout=log, stderr=subprocess.STDOUT, check=False)
    tasks = collections.defaultdict(list)
    for path in sorted(folder.glob("*.h5")):
        if episode := measure(path):
            tasks[episode["task"]].append(episode)
    if not tasks:
        sys.exit(f"no successful recording in {folder}")
    human, rows, missed = args.style == "human", {}, {}
    for task, episodes in sorted(tasks.items()):
        row = rows[task] = human_row(episodes) if human else quick_row(episodes)
        missed[task] = missed_goals(row, human)
        if human:
            print(
                f"{task:22} {row['episodes']:3}  peak {row['peak']:5.1%}  comb {row['comb']:4.0%} (noise {row['noise']:4.0%})  "
                f"standing {row['standing']:4.0%}  jerk {row['jerk']:.3f}  {row['seconds']:5.0f} s "
                f"({row['least']:.0f} to {row['most']:.0f}, cv {row['cv']:.0%})  {' '.join(missed[task])}"
            )
        else:
            print(
                f"{task:22} {row['episodes']:3}  cv {row['cv']:4.0%}  j1 {row['j1']:5.1f}  both {row['both']:5.1%}  "
                f"seq {row['seq']}  straight {row['straight']:.3f}  bearing {row['bearing']:5.1f}  height {row['height']:4.1f} mm  "
                f"lean {row['lean']:4.1f}  force {row['force']:.0f} +- {row['force_sd']:.0f} N  {row['seconds']:.0f} s  {' '.join(missed[task])}"
            )
            if args.sequences:
                for name, share in row["sequences"].items():
                    print(f"    {share:4.0%}  {name}")
    (folder / "variety.json").write_text(json.dumps(rows, indent=1) + "\n")
    sys.exit(any(missed.values()))


if __name__ == "__main__":
    main()
