"""Serves a checkpoint of LeRobot, for `wheelarm evaluate --policy lerobot:DIR`.

    python -m wheelarm.lerobot_policy outputs/train/checkpoints/last/pretrained_model

Needs `lerobot` (0.4.4 on Python 3.10 and 3.11) and torch beside this package. The
checkpoint is one that was trained on an export of ours (`wheelarm dataset export --format
lerobot`): `observation.state` with 27 numbers, `observation.images.CAMERA` by the robot's
cameras, and rows of `next-pose` (12) or `next-joints` (9).

Actions are taken as whole chunks; how many rows of one are carried out is the
checkpoint's `n_action_steps`, or `--execute` of `wheelarm evaluate`. Each episode has a
history of its own, so that many run at one time. Nothing is downloaded: weights of a
pretrained backbone are in the checkpoint already.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from collections import OrderedDict, deque
from pathlib import Path
from typing import Any

import numpy as np

from . import policy, v1

#: Numbers of a row of action, and what they are.
ACTIONS = {12: v1.POLICY_ACTION_NEXT_POSE, 9: v1.POLICY_ACTION_NEXT_JOINTS}
IMAGES = "observation.images."
STATE = "observation.state"
#: Episodes whose history is kept.
EPISODES = 512
#: Set to `null` in a copy of the configuration: LeRobot would fetch these weights
#: from the internet, to replace them by those of the checkpoint.
FETCHED = ("pretrained_backbone_weights",)


class Checkpoint:
    """A policy of LeRobot with its processors.

    Args:
        folder: `pretrained_model` of a checkpoint.
        rate_hz: rate of the data that it was trained on; told by `train_config.json` or
            `info.json` beside it nowhere, so 10 Hz unless it is said.
        device: of torch.
        batch: observations that are answered at a time.

    Raises:
        SystemExit: in words, where it is no policy for this robot.
    """

    def __init__(self, folder: Path, rate_hz: float, device: str | None, batch: int) -> None:
        import torch
        from lerobot.configs.policies import PreTrainedConfig
        from lerobot.policies.factory import get_policy_class, make_pre_post_processors

        config = PreTrainedConfig.from_pretrained(folder)
        for name in FETCHED:
            if hasattr(config, name):
                setattr(config, name, None)
        config.device = device or ("cuda" if torch.cuda.is_available() else "cpu")
        self.torch, self.config = torch, config
        self.cameras, state, action = features(config)
        if action not in ACTIONS:
            raise SystemExit(
                f"its action has {action} numbers; ours have 12 (next-pose) or 9 (next-joints): "
                "train it on an export by `wheelarm dataset export --format lerobot`"
            )
        if state is not None and state != 27:
            raise SystemExit(f"its {STATE} has {state} numbers, a row of state has 27")
        self.network = get_policy_class(config.type).from_pretrained(folder, config=config)
        self.network.eval()
        moves = {"device_processor": {"device": config.device}}
        self.before, self.after = make_pre_post_processors(
            config, pretrained_path=str(folder), preprocessor_overrides=moves,
        )  # fmt: skip
        self.history = max(1, int(getattr(config, "n_obs_steps", 1)))
        self.rate, self.batch, self.action = rate_hz, batch, action
        # Diffusion answers as many rows as it carries out, from a horizon.
        self.execute = int(getattr(config, "n_action_steps", getattr(config, "action_chunk_size", 1)))
        self.chunk = int(getattr(config, "chunk_size", self.execute))
        self.name = f"lerobot {config.type}"
        self.hash = sha256(folder / "model.safetensors")
        self.seen: OrderedDict[str, deque[Any]] = OrderedDict()

    def spec(self) -> Any:
        """What it wants and answers."""
        cameras = [
            v1.PolicyCamera(name=name, width=width, height=height)
            for name, (height, width) in self.cameras.items()
        ]
        return v1.PolicySpec(
            name=self.name, weights_sha256=self.hash, cameras=cameras, history=self.history,
            rate_hz=self.rate, chunk=self.chunk, execute=min(self.execute, self.chunk),
            action=ACTIONS[self.action], max_batch=self.batch,
            stochastic=self.config.type in ("diffusion", "smolvla", "pi0", "pi05"),
        )  # fmt: skip

    def reset(self, request: Any) -> None:
        """An episode begins."""

    def infer(self, observations: list[policy.Observation]) -> list[np.ndarray]:
        """Chunks of rows, each by its own seed: together where the policy draws nothing but
        the noise that it begins with, else one after the other."""
        if len(observations) > 1 and self.answers_together:
            return list(self.rows(observations))
        return [self.rows([observation])[0] for observation in observations]

    @property
    def answers_together(self) -> bool:
        """DDPM draws noise in every step, so that rows of a batch would share a seed."""
        kind = getattr(self.config, "noise_scheduler_type", None)
        return self.config.type == "act" or (self.config.type == "diffusion" and kind == "DDIM")

    def rows(self, observations: list[policy.Observation]) -> np.ndarray:
        """[observations, rows, numbers]."""
        torch = self.torch
        self.network.reset()
        together = len(observations) > 1
        steps = [
            collated([self.moment(observation, i) for observation in observations])
            for i in range(self.history)
        ]
        with torch.inference_mode():
            batch = self.together(steps)
            drawn = {}
            if together and self.config.type == "diffusion":
                drawn["noise"] = torch.cat(
                    [self.noise(observation) for observation in observations]
                )
            else:
                self.seed(observations[0])
            rows = self.network.predict_action_chunk(batch, **drawn)
            rows = torch.stack([self.after(rows[:, i]) for i in range(rows.shape[1])], dim=1)
        return rows.float().cpu().numpy()

    def seed(self, observation: policy.Observation) -> None:
        """From seed and tick alone, so that an episode is the same in any order."""
        self.torch.manual_seed((observation.seed * 1_000_003 + observation.tick) % 2**63)

    def noise(self, observation: policy.Observation) -> Any:
        """What a diffusion policy begins with, as it would draw it itself."""
        self.seed(observation)
        parameter = next(self.network.parameters())
        size = (1, self.config.horizon, self.action)
        return self.torch.randn(size, dtype=parameter.dtype, device=parameter.device)

    def moment(self, observation: policy.Observation, i: int) -> dict[str, Any]:
        """A moment as the network takes it. The processors tell an action that is not there."""
        told = self.before(self.item(observation, i))
        return {k: v for k, v in told.items() if v is not None}

    def item(self, observation: policy.Observation, i: int) -> dict[str, Any]:
        """A moment as LeRobot's data sets tell it."""
        torch = self.torch
        item: dict[str, Any] = {"task": observation.instruction}
        # ACT looks at it for its device even where it does not take it.
        item[STATE] = torch.from_numpy(observation.states[i].astype(np.float32))
        for name in self.cameras:
            picture = np.ascontiguousarray(observation.pictures[i][name].transpose(2, 0, 1))
            item[IMAGES + name] = torch.from_numpy(picture).float() / 255
        return item

    def together(self, steps: list[dict[str, Any]]) -> dict[str, Any]:
        """What `predict_action_chunk` takes: the newest moment; where a policy sees
        several, its own queues are filled in their order."""
        torch = self.torch
        queues = getattr(self.network, "_queues", None)
        newest = steps[-1]
        if not queues or (self.history == 1 and STATE not in queues):
            return newest
        from lerobot.policies.utils import populate_queues
        from lerobot.utils.constants import OBS_IMAGES

        for step in steps:
            known = dict(step)
            if self.config.image_features:
                images = [step[key] for key in self.config.image_features]
                known[OBS_IMAGES] = torch.stack(images, dim=-4)
            queues = populate_queues(queues, known)
        return {**newest, **({OBS_IMAGES: known[OBS_IMAGES]} if self.config.image_features else {})}


def collated(items: list[dict[str, Any]]) -> dict[str, Any]:
    """Items of one row each as one of all rows."""
    if len(items) == 1:
        return items[0]
    import torch

    out: dict[str, Any] = {}
    for key, first in items[0].items():
        values = [item[key] for item in items]
        if torch.is_tensor(first):
            out[key] = torch.cat(values) if first.dim() else first
        else:
            out[key] = (
                [one for value in values for one in value] if isinstance(first, list) else first
            )
    return out


def features(config: Any) -> tuple[dict[str, tuple[int, int]], int | None, int]:
    """Height and width by camera, and how many numbers state and action have.

    Raises:
        SystemExit: in words, where it wants what no robot tells.
    """
    cameras: dict[str, tuple[int, int]] = {}
    state = None
    for name, feature in (config.input_features or {}).items():
        if name.startswith(IMAGES):
            _, height, width = feature.shape
            cameras[name[len(IMAGES) :]] = (int(height), int(width))
        elif name == STATE:
            state = int(feature.shape[0])
        else:
            raise SystemExit(
                f"it wants {name!r}; told are {STATE}, {IMAGES}CAMERA and the task's sentence"
            )
    action = (config.output_features or {}).get("action")
    return cameras, state, int(action.shape[0]) if action else 0


def sha256(path: Path) -> str:
    with path.open("rb") as file:
        return (
            hashlib.file_digest(file, "sha256").hexdigest()
            if hasattr(hashlib, "file_digest")
            else (hashlib.sha256(file.read()).hexdigest())
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, help="folder `pretrained_model` of a checkpoint")
    parser.add_argument("--rate", type=float, default=10.0, help="rows per second of its data, Hz")
    parser.add_argument("--device", default=os.environ.get("WHEELARM_DEVICE"), help="of torch")
    parser.add_argument("--batch", type=int, default=16, help="observations at a time")
    options = parser.parse_args()
    told = options.folder / "config.json"
    if not told.is_file():
        raise SystemExit(f"there is no {told}; name the folder `pretrained_model` of a checkpoint")
    try:
        json.loads(told.read_text())
    except ValueError as problem:
        raise SystemExit(f"{told} is no JSON: {problem}") from None
    try:
        import lerobot  # noqa: F401
    except ImportError:
        raise SystemExit(
            "this Python has no lerobot: pip install lerobot==0.4.4, and name that Python by WHEELARM_PYTHON"
        ) from None
    policy.serve(Checkpoint(options.folder, options.rate, options.device, options.batch))


if __name__ == "__main__":
    main()
