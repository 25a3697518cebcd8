#!/usr/bin/env python3
"""Checks the plugins with LeRobot itself; run by tests/lerobot.sh.

    python lerobot_check.py EXPORTED_SET RECORDED_SET SEED

EXPORTED_SET is the export of the episode of SEED by `wheelarm dataset export`,
RECORDED_SET the recording of its replay by `lerobot-record`. Checks that LeRobot counts
the success, that both sets have the same names and numbers, and that the recording is
complete.
"""

from __future__ import annotations

import json
import pathlib
import re
import sys

import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.envs.configs import EnvConfig
from lerobot.envs.factory import make_env
from lerobot.envs.utils import _call_make_env, _load_module_from_path, _normalize_hub_result
from lerobot.processor import PolicyProcessorPipeline
from lerobot.scripts.lerobot_eval import rollout
from lerobot.utils.import_utils import register_third_party_plugins
from pyarrow import parquet


def read_rows(folder: pathlib.Path, seed: int):
    """State and action of the episode of a seed, and the numbers' names."""
    info = json.loads((folder / "meta/info.json").read_text())
    data = parquet.read_table(sorted(folder.glob("data/**/*.parquet")))
    number = 0
    labels = parquet.read_table(sorted(folder.glob("meta/episodes/**/*.parquet")))
    if "recording" in labels.column_names:
        names = labels["recording"].to_pylist()
        number = next(i for i, name in enumerate(names) if re.search(rf"-seed{seed}$", name))
    chosen = np.array(data["episode_index"]) == number
    state, action = (
        np.stack(data[name].to_numpy()[chosen]) for name in ("observation.state", "action")
    )
    names = {name: info["features"][name]["names"] for name in ("observation.state", "action")}
    return state, action, names


class Rows(torch.nn.Module):
    """A policy that returns recorded rows."""

    def __init__(self, action: np.ndarray) -> None:
        super().__init__()
        self.rows, self.next = torch.from_numpy(np.array(action)), 0

    def reset(self) -> None:
        self.next = 0

    def select_action(self, observation):
        state = observation["observation.state"]
        assert state.shape[1] == 27 and observation["observation.images.gen3"].ndim == 4
        assert observation["task"][0], "the sentence of the task is missing"
        self.next += 1
        return self.rows[min(self.next, len(self.rows)) - 1].repeat(len(state), 1)


def main() -> None:
    exported, recorded, seed = (
        pathlib.Path(sys.argv[1]),
        pathlib.Path(sys.argv[2]),
        int(sys.argv[3]),
    )
    state, action, names = read_rows(exported, seed)
    register_third_party_plugins()
    config = EnvConfig.get_choice_class("wheelarm")(
        task="PickMustard-v0", observation_width=128, observation_height=96
    )
    envs = make_env(config, n_envs=1)["wheelarm"][0]

    def empty() -> PolicyProcessorPipeline:
        return PolicyProcessorPipeline(steps=[])

    def same() -> PolicyProcessorPipeline:
        return PolicyProcessorPipeline(steps=[], to_transition=lambda x: x, to_output=lambda x: x)

    result = rollout(envs, Rows(action), empty(), same(), same(), same(), seeds=[seed])
    envs.close()
    success = result["success"].any().item()
    print(f"rollout of recorded rows: {result['action'].shape[1]} steps, success {success}")
    assert success, "LeRobot counts no success"

    # As in LeRobot for a repository of its hub, without the download.
    file = pathlib.Path(__file__).resolve().parents[1] / "envhub/env.py"
    module = _load_module_from_path(str(file))
    hub = _normalize_hub_result(_call_make_env(module, n_envs=1, use_async_envs=False, cfg=None))
    shape = hub["wheelarm"][0].reset(seed=0)[0]["pixels"]["gen3"].shape
    hub["wheelarm"][0].close()
    print(f"EnvHub: images {shape}")
    assert shape == (1, 180, 320, 3), shape

    data = LeRobotDataset("me/wheelarm", root=recorded)
    item = data[0]
    again_state, again_action, again_names = read_rows(recorded, seed)
    assert again_names == names, (again_names, names)
    assert item["observation.images.gen3"].shape == (3, 96, 128), item.keys()
    count = min(len(action), len(again_action))
    assert count > 0.8 * len(action), (count, len(action))
    assert np.array_equal(again_action[:count], action[:count])
    off = np.abs(again_state[0] - state[0]).max()
    assert off < 1e-6, f"the first state differs by {off}"
    stamps = np.array([data[i]["timestamp"].item() for i in range(len(data))])
    assert np.allclose(np.diff(stamps), 1.0 / data.fps, atol=1e-4), "frames are missing"
    print(f"recorded set: {len(data)} frames at {data.fps} Hz, names and actions as exported")


if __name__ == "__main__":
    main()
