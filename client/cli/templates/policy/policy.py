#!/usr/bin/env python3
"""NAME: a policy that looks at two images and returns rows of action.

It remembers recorded episodes. At each step it searches the recorded step whose images and
joints are most similar, and returns the rows that followed. Replace `Memory` with your network;
the guide docs/add-your-own/policy.md has the commands.
"""

from __future__ import annotations

import pathlib
import sys

import h5py
import numpy as np
from wheelarm import policy, v1

#: Cameras and their image size, pixels: that of the recorded rows.
CAMERAS, WIDTH, HEIGHT = ("gen3", "wheelchair"), 96, 54
#: Rows that it returns at once, and that are executed before the next images.
CHUNK, EXECUTE = 8, 4
#: Values of the state that it compares: the joints and the gripper, radians.
JOINTS = [0, 1, 2, 3, 4, 5, 12]


def features(images: dict[str, np.ndarray], state: np.ndarray) -> np.ndarray:
    """Images as small grey ones, and the joints, as one vector."""
    parts = [images[name].mean(axis=2)[::3, ::3].ravel() / 255.0 for name in CAMERAS]
    return np.concatenate([*parts, 3.0 * state[JOINTS]]).astype(np.float32)


class Memory:
    """The recorded steps: features, and the rows of action that followed each."""

    def __init__(self, file: str) -> None:
        found, rows = [], []
        with h5py.File(file) as recorded:
            for demo in recorded["data"].values():
                actions = demo["actions_raw"][:]
                # At the end of an episode the last row repeats.
                padded = np.concatenate([actions, np.repeat(actions[-1:], CHUNK, axis=0)])
                images = {name: demo["obs"][f"{name}_image"][:] for name in CAMERAS}
                for i, state in enumerate(demo["states"]):
                    found.append(features({name: images[name][i] for name in CAMERAS}, state))
                    rows.append(padded[i : i + CHUNK])
        self.features, self.rows = np.array(found), np.array(rows)

    def nearest(self, wanted: np.ndarray) -> np.ndarray:
        """The rows after the most similar step, (CHUNK, 12)."""
        distance = ((self.features - wanted) ** 2).sum(axis=1)
        return self.rows[int(distance.argmin())]


class Policy:
    def __init__(self, file: str) -> None:
        self.memory = Memory(file)

    def spec(self) -> v1.PolicySpec:
        """What the policy needs: the evaluation renders these images."""
        cameras = [v1.PolicyCamera(name=name, width=WIDTH, height=HEIGHT) for name in CAMERAS]
        return v1.PolicySpec(name="NAME", rate_hz=10, chunk=CHUNK, execute=EXECUTE, cameras=cameras)

    def reset(self, request: v1.PolicyResetRequest) -> None:
        """An episode begins; `request` has its key, seed and instruction."""

    def infer(self, observations: list[policy.Observation]) -> list[np.ndarray]:
        """Rows (CHUNK, 12) for each episode that waits: hand pose in `base_link`, knuckle, forward
        speed and turn rate."""
        return [self.memory.nearest(features(one.images[-1], one.state)) for one in observations]


if __name__ == "__main__":
    default = pathlib.Path(__file__).with_name("rows.hdf5")
    policy.serve(Policy(sys.argv[1] if len(sys.argv) > 1 else str(default)))
