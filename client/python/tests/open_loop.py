#!/usr/bin/env python3
"""Executes the rows of a LeRobot data set in the environment, open loop.

    python tests/open_loop.py SET [--obs-mode pixels] [--most N]

For every episode of the set: a reset with the episode's seed, whose names and first
observation must equal those of the set, then its actions one by one. Prints the number of
successes, and the difference between `agent_pos` and the recorded ``observation.state``.
Exit status 1 when names differ, or fewer than nine in ten succeed.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re

import numpy as np
from pyarrow import parquet

import wheelarm
from wheelarm.rows import action_names

#: Steps that repeat the last row while the task is not done.
HELD = 30


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("set", type=pathlib.Path)
    parser.add_argument("--obs-mode", default="state")
    parser.add_argument("--most", type=int, default=1000)
    args = parser.parse_args()
    info = json.loads((args.set / "meta/info.json").read_text())
    features = info["features"]
    names = features["action"]["names"]
    mode = next(
        mode for mode, kind in wheelarm.env.ROW_KINDS.items() if action_names(kind) == names
    )
    data = parquet.read_table(sorted(args.set.glob("data/**/*.parquet")))
    episodes = parquet.read_table(sorted(args.set.glob("meta/episodes/**/*.parquet")))
    labels = episodes["recording"].to_pylist()
    number = np.array(data["episode_index"])
    done, furthest = 0, 0.0
    env = None
    labels = labels[: args.most]
    for index, label in enumerate(labels):
        task, seed = re.search(r"(\w+?)-seed(\d+)", str(label)).groups()
        if env is None or env.task != task:
            if env is not None:
                env.close()
            sizes = {}
            if args.obs_mode != "state":
                for key, feature in features.items():
                    if key.startswith("observation.images."):
                        height, width, _ = feature["shape"]
                        sizes[key.rsplit(".", 1)[1]] = (width, height)
            env = wheelarm.WheelArmEnv(
                task,
                control_mode=mode,
                obs_mode=args.obs_mode,
                cameras=sizes or None,
                control_rate=info["fps"],
            )
        chosen = number == index
        actions = np.stack(data["action"].to_numpy()[chosen])
        states = np.stack(data["observation.state"].to_numpy()[chosen])
        observation, _ = env.reset(options={"scenario_seed": int(seed)})
        assert env.action_names == names, (env.action_names, names)
        assert env.state_names == features["observation.state"]["names"]
        first = np.abs(observation["agent_pos"] - states[0]).max()
        assert first < 1e-6, f"{label}: the first state differs by {first}"
        off = []
        for i in range(len(actions) + HELD):
            if i < len(states):
                off.append(np.abs(observation["agent_pos"] - states[i]).max())
            action = actions[min(i, len(actions) - 1)]
            observation, _, terminated, truncated, last = env.step(action)
            if terminated or truncated:
                break
        done += last["is_success"]
        furthest = max(furthest, *off)
        print(
            f"{label}: {'success' if last['is_success'] else last['failure'] or 'not done'} after "
            f"{i + 1} of {len(actions)} rows, difference of the state {np.mean(off):.4f} mean, "
            f"{max(off):.4f} maximum",
            flush=True,
        )
    env.close()
    print(f"{mode}: {done} of {len(labels)} succeed")
    if done < 0.9 * len(labels):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
