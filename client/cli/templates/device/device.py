#!/usr/bin/env python3
"""NAME: an input device that drives chair, arm and gripper.

    python device.py                          # a joystick at /dev/input/js0, in real time
    python device.py --play motion.csv        # axes from a file, in lock-step
    python device.py --from-recording FILE.h5 --out motion.csv

Replace `Joystick` with your device: a class with `read()` that returns the eight axes.
"""

from __future__ import annotations

import argparse
import csv
import os
import struct
import time
from collections.abc import Iterator

import numpy as np
import wheelarm
from wheelarm.rows import multiply

#: Axes: speed of the hand along x, y, z of `base_link` (m/s), turn rate about the tool's own x, y,
#: z (rad/s), forward speed (m/s), turn rate of the chair (rad/s), rate of the knuckle (rad/s).
AXES = ("x", "y", "z", "rx", "ry", "rz", "forward", "left", "close")
#: Control ticks per second.
RATE = 60
#: Axes and buttons of the joystick by number: our axis, and its speed at the end of the stick.
STICKS = {0: ("left", -0.5), 1: ("forward", -0.4), 3: ("y", -0.1), 4: ("x", -0.1)}
BUTTONS = {0: ("z", 0.1), 1: ("z", -0.1), 4: ("close", 0.8), 5: ("close", -0.8)}


class Joystick:
    """The Linux joystick interface: events of eight bytes with time, value, type and number."""

    def __init__(self, path: str) -> None:
        self.file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        self.axes = dict.fromkeys(AXES, 0.0)

    def read(self) -> list[float]:
        """The present axes; called once per control tick."""
        while True:
            try:
                event = os.read(self.file, 8)
            except BlockingIOError:
                return list(self.axes.values())
            if not event:
                raise SystemExit("the joystick is gone: plug it in and start again")
            _, value, kind, number = struct.unpack("IhBB", event)
            if kind & 2 and number in STICKS:
                name, speed = STICKS[number]
                # A stick at rest is rarely exactly at 0.
                self.axes[name] = speed * value / 32767 if abs(value) > 3000 else 0.0
            elif kind & 1 and number in BUTTONS:
                name, speed = BUTTONS[number]
                self.axes[name] = speed * value


class Driver:
    """Converts axes to commands: each control tick is one step of the hand."""

    def __init__(self) -> None:
        self.knuckle = 0.0

    def command(self, axes: list[float]) -> wheelarm.v1.Command:
        x, y, z, rx, ry, rz, forward, left, close = axes
        self.knuckle = min(max(self.knuckle + close / RATE, 0.0), 0.8)
        step = [x / RATE, y / RATE, z / RATE, rx / RATE, ry / RATE, rz / RATE]
        moves = any(step)
        return wheelarm.command(
            step=step if moves else None,
            linear=forward,
            angular=left,
            knuckle=self.knuckle,
            device="gamepad",
            mode="hold",
        )


def drive(endpoint: str, sim: str, device: Joystick, label: str, recorders: int) -> None:
    """Drives in real time until the task is over. The server brakes 0.25 s after the last
    command, so a device that dies stops the chair."""
    driver = Driver()
    with wheelarm.connect(endpoint, sim) as client, client.commander("NAME") as me:
        client.start_episode(label, recorders=recorders)
        evaluation = iter(client.streams("evaluation"))
        try:
            while not next(evaluation).message.done:
                me.send(driver.command(device.read()))
        except KeyboardInterrupt:
            print("stopped")
        finally:
            print("success:", client.stop_episode().evaluation.success)
        me.check()


def play(
    endpoint: str, sim: str, motion: Iterator[list[float]], label: str, recorders: int
) -> bool:
    """Drives in lock-step with axes from a file: every run is the same."""
    driver = Driver()
    with (
        wheelarm.connect(endpoint, sim) as client,
        client.lockstep("NAME", label, recorders=recorders) as episode,
    ):
        over = False
        for axes in motion:
            moment = episode.step(driver.command(axes))
            if over := moment.message("evaluation").done:
                break
        # The conditions may need a second at rest.
        for _ in range(0 if over else 3 * RATE):
            moment = episode.step(driver.command([0.0] * len(AXES)))
            if moment.message("evaluation").done:
                break
        success = bool(moment.message("evaluation").success)
    print("success:", success)
    return success


def from_file(path: str) -> Iterator[list[float]]:
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            yield [float(row[name]) for name in AXES]


def from_recording(recording: str, out: str) -> None:
    """Writes the axes that repeat a recorded episode, for example one of `wheelarm demo`."""
    import h5py

    with h5py.File(recording) as file:
        applied = file["streams/applied"]
        pose, base, knuckle = (applied[name][:] for name in ("desired_pose", "base", "knuckle"))
    rows = []
    for i, (after, chair) in enumerate(zip(pose, base, strict=True)):
        last = max(i - 1, 0)
        before = pose[last]
        inverse = [-before[3], -before[4], -before[5], before[6]]
        turn = multiply(inverse, after[3:])
        turn = -turn if turn[3] < 0 else turn
        sine = np.linalg.norm(turn[:3])
        vector = turn[:3] / sine * 2.0 * np.arctan2(sine, turn[3]) if sine > 1e-12 else np.zeros(3)
        step = [*(after[:3] - before[:3]), *vector]
        rows.append(
            [*(RATE * v for v in step), *np.nan_to_num(chair), RATE * (knuckle[i] - knuckle[last])]
        )
    with open(out, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(AXES)
        writer.writerows([[f"{value:.9g}" for value in row] for row in rows])
    print(f"{len(rows) / RATE:.1f} s of motion in {out}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n", maxsplit=1)[0])
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447")
    parser.add_argument("--sim", default="sim")
    parser.add_argument("--joystick", default="/dev/input/js0")
    parser.add_argument("--play", metavar="CSV")
    parser.add_argument("--from-recording", metavar="H5")
    parser.add_argument("--out", default="motion.csv")
    parser.add_argument("--label", default=f"NAME-{time.strftime('%Y%m%d-%H%M%S')}")
    parser.add_argument("--recorders", type=int, default=0, help="recorders that must be ready")
    args = parser.parse_args()
    if args.from_recording:
        from_recording(args.from_recording, args.out)
    elif args.play:
        raise SystemExit(
            not play(args.connect, args.sim, from_file(args.play), args.label, args.recorders)
        )
    else:
        drive(args.connect, args.sim, Joystick(args.joystick), args.label, args.recorders)


if __name__ == "__main__":
    main()
