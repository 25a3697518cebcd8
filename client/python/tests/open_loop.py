#!/usr/bin/env python3
"""Plays the rows of a LeRobot set through the environment, open loop.

    python tests/open_loop.py SET [--obs-mode pixels] [--most N]

For every episode of the set: a new environment state from the episode's seed, whose
names and first observation must be those of the set, then its actions one by one. Tells
how many are successes, and how far `agent_pos` is from the recorded
``observation.state``. Pictures are compared where the set has them as PNG. Exit status
1 when names differ, or fewer than nine in ten succeed.
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

#: The last row is held for so many steps while the task is not done.
HELD = 30


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("set", type=pathlib.Path)
    asked.add_argument("--obs-mode", default="state")
    asked.add_argument("--most", type=int, default=1000)
    args = asked.parse_args()
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
        assert first < 1e-6, f"{label}: the first state is off by {first}"
        off = []
        for i in range(len(actions) + HELD):
            if i < len(states):
                off.append(np.abs(observation["agent_pos"] - states[i]).max())
            action = actions[min(i, len(actions) - 1)]
            observation, _, terminated, truncated, told = env.step(action)
            if terminated or truncated:
                break
        done += told["is_success"]
        furthest = max(furthest, *off)
        print(
            f"{label}: {'success' if told['is_success'] else told['failure'] or 'not done'} after "
            f"{i + 1} of {len(actions)} rows, state off by {np.mean(off):.4f} in the mean, "
            f"{max(off):.4f} at most",
            flush=True,
        )
    env.close()
    print(f"{mode}: {done} of {len(labels)} succeed")
    if done < 0.9 * len(labels):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
