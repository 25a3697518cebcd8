#!/usr/bin/env python3
"""Steps per second of one environment, and of several in parallel.

    python tests/steps.py [--most 4] [--obs-mode state] [--seconds 5]

Prints only: the figures depend on the machine and its load.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import wheelarm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--most", type=int, default=2)
    parser.add_argument("--obs-mode", default="state")
    parser.add_argument("--seconds", type=float, default=5.0)
    args = parser.parse_args()
    more = (
        {}
        if args.obs_mode == "state"
        else {"cameras": {"gen3": (320, 180), "wheelchair": (320, 180)}}
    )
    single = 0.0
    for count in range(1, args.most + 1):
        envs = wheelarm.WheelArmVectorEnv(
            count, task="pick_mustard", obs_mode=args.obs_mode, control_mode="ee_delta", **more
        )
        envs.reset(seed=0)
        action = np.zeros((count, 9), np.float32)
        action[:, 7] = 0.2
        steps, begun = 0, time.monotonic()
        while time.monotonic() - begun < args.seconds:
            envs.step(action)
            steps += count
        rate = steps / (time.monotonic() - begun)
        single = single or rate
        print(
            f"{args.obs_mode}: {count} environments, {rate:.1f} steps/s of 0.1 s "
            f"({rate / 10:.1f} simulated seconds per second), {rate / single:.2f} x one",
            flush=True,
        )
        envs.close()


if __name__ == "__main__":
    main()
