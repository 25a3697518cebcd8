"""Serves a LeRobot checkpoint, for `wheelarm evaluate --policy lerobot:DIR`.

    python -m wheelarm.lerobot_policy outputs/train/checkpoints/last/pretrained_model

Requires `lerobot` (0.4.4 on Python 3.10 and 3.11) and torch in the same environment. The
checkpoint must be trained on an export of WheelArm (`wheelarm dataset export --format
lerobot`): `observation.state` with 27 numbers, `observation.images.CAMERA` with the
robot's cameras, and rows of `next-pose` (12) or `next-joints` (9).

A reply is a whole chunk of rows; the checkpoint's `n_action_steps`, or `--execute` of
`wheelarm evaluate`, is the number of rows that are executed. Each episode has its own
history, so that many can run in parallel. Nothing is downloaded: the checkpoint contains
the weights of its pretrained backbone.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from . import policy, rows, v1

#: Size of a row of action, and its kind.
ACTIONS = {12: v1.POLICY_ACTION_NEXT_POSE, 9: v1.POLICY_ACTION_NEXT_JOINTS}
IMAGES = "observation.images."
STATE = "observation.state"
#: Fields that are cleared in the configuration: LeRobot would download these weights and
#: then replace them with those of the checkpoint.
DOWNLOADED = ("pretrained_backbone_weights",)


class Checkpoint:
    """A LeRobot policy with its processors.

    Args:
        folder: Folder `pretrained_model` of a checkpoint.
        rate_hz: Rate of the training data, Hz; the checkpoint does not store it.
        device: Device of torch.
        batch: Largest number of observations in one batch (count).

    Raises:
        SystemExit: when the checkpoint does not fit this robot.
    """

    def __init__(self, folder: Path, rate_hz: float, device: str | None, batch: int) -> None:
        import torch
        from lerobot.configs.policies import PreTrainedConfig
        from lerobot.policies.factory import get_policy_class, make_pre_post_processors

        config = PreTrainedConfig.from_pretrained(folder)
        for name in DOWNLOADED:
            if hasattr(config, name):
                setattr(config, name, None)
        config.device = device or ("cuda" if torch.cuda.is_available() else "cpu")
        self.torch, self.config = torch, config
        self.cameras, state, action = features(config)
        if action not in ACTIONS:
            raise SystemExit(
                f"{folder} has an action of {action} numbers, expected 12 (next-pose) or 9 "
                "(next-joints): train it on `wheelarm dataset export --format lerobot`"
            )
        if state is not None and state != rows.STATE:
            raise SystemExit(
                f"{folder} has {state} numbers in {STATE}, expected {rows.STATE}: train it on "
                "`wheelarm dataset export --format lerobot`"
            )
        self.network = get_policy_class(config.type).from_pretrained(folder, config=config)
        self.network.eval()
        moves = {"device_processor": {"device": config.device}}
        self.before, self.after = make_pre_post_processors(
            config, pretrained_path=str(folder), preprocessor_overrides=moves,
        )  # fmt: skip
        self.history = max(1, int(getattr(config, "n_obs_steps", 1)))
        self.rate, self.batch, self.action = rate_hz, batch, action
        # Diffusion returns as many rows as it executes, from a longer horizon.
        steps = getattr(config, "n_action_steps", getattr(config, "action_chunk_size", 1))
        self.execute = int(steps)
        self.chunk = int(getattr(config, "chunk_size", self.execute))
        self.name = f"lerobot {config.type}"
        self.hash = sha256(folder / "model.safetensors")

    def spec(self) -> Any:
        """Inputs and outputs of the policy."""
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
        """Does nothing: every observation carries its history."""

    def infer(self, observations: list[policy.Observation]) -> list[np.ndarray]:
        """Chunks of rows, each with its own seed: in one batch if the policy samples only its
        initial noise, else one after the other."""
        if len(observations) > 1 and self.can_batch:
            return list(self.predict(observations))
        return [self.predict([observation])[0] for observation in observations]

    @property
    def can_batch(self) -> bool:
        """Whether a batch gives the same rows as single observations. DDPM samples noise in
        every step, so the rows of a batch would share a seed."""
        kind = getattr(self.config, "noise_scheduler_type", None)
        return self.config.type == "act" or (self.config.type == "diffusion" and kind == "DDIM")

    def predict(self, observations: list[policy.Observation]) -> np.ndarray:
        """Chunks of rows, [observations, rows, numbers]."""
        torch = self.torch
        self.network.reset()
        batched = len(observations) > 1
        steps = [
            collate([self.preprocess(observation, i) for observation in observations])
            for i in range(self.history)
        ]
        with torch.inference_mode():
            batch = self.make_batch(steps)
            sampled = {}
            if batched and self.config.type == "diffusion":
                sampled["noise"] = torch.cat(
                    [self.sample_noise(observation) for observation in observations]
                )
            else:
                self.set_seed(observations[0])
            chunk = self.network.predict_action_chunk(batch, **sampled)
            chunk = torch.stack([self.after(chunk[:, i]) for i in range(chunk.shape[1])], dim=1)
        return chunk.float().cpu().numpy()

    def set_seed(self, observation: policy.Observation) -> None:
        """Sets torch's seed from seed and tick alone, so that the order of episodes has no
        effect."""
        self.torch.manual_seed((observation.seed * 1_000_003 + observation.tick) % 2**63)

    def sample_noise(self, observation: policy.Observation) -> Any:
        """The initial noise of a diffusion policy, equal to what it would sample itself."""
        self.set_seed(observation)
        parameter = next(self.network.parameters())
        size = (1, self.config.horizon, self.action)
        return self.torch.randn(size, dtype=parameter.dtype, device=parameter.device)

    def preprocess(self, observation: policy.Observation, i: int) -> dict[str, Any]:
        """Input of the network for the moment `i`. The processors add an action of None, which
        is removed."""
        processed = self.before(self.make_item(observation, i))
        return {k: v for k, v in processed.items() if v is not None}

    def make_item(self, observation: policy.Observation, i: int) -> dict[str, Any]:
        """The moment `i` as an item of a LeRobot data set."""
        torch = self.torch
        item: dict[str, Any] = {"task": observation.instruction}
        # ACT reads the device of the state even if the state is not an input.
        item[STATE] = torch.from_numpy(observation.states[i].astype(np.float32))
        for name in self.cameras:
            image = np.ascontiguousarray(observation.images[i][name].transpose(2, 0, 1))
            item[IMAGES + name] = torch.from_numpy(image).float() / 255
        return item

    def make_batch(self, steps: list[dict[str, Any]]) -> dict[str, Any]:
        """Input of `predict_action_chunk`: the newest moment. For a policy with a history, it
        also fills the policy's own queues in order of time."""
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


def collate(items: list[dict[str, Any]]) -> dict[str, Any]:
    """Combines items of one row each into one item with all rows."""
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
    """Height and width by camera, and the sizes of state and action; the state is None if it
    is not an input.

    Raises:
        SystemExit: when the policy requires an input that the simulator does not have.
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
                f"the checkpoint requires {name!r}; available: {STATE}, {IMAGES}CAMERA and the "
                "sentence of the task"
            )
    action = (config.output_features or {}).get("action")
    return cameras, state, int(action.shape[0]) if action else 0


def sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
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
    parser.add_argument(
        "--device", default=os.environ.get("WHEELARM_DEVICE"), help="device of torch"
    )
    parser.add_argument("--batch", type=int, default=16, help="largest batch of observations")
    options = parser.parse_args()
    config = options.folder / "config.json"
    if not config.is_file():
        raise SystemExit(
            f"cannot read {config}: it does not exist; name the folder `pretrained_model` of a "
            "checkpoint"
        )
    try:
        json.loads(config.read_text())
    except ValueError as error:
        raise SystemExit(f"cannot read {config}: it is not JSON: {error}") from None
    try:
        import lerobot  # noqa: F401
    except ImportError:
        raise SystemExit(
            "cannot import lerobot: pip install lerobot==0.4.4, and set WHEELARM_PYTHON to that Python"
        ) from None
    policy.serve(Checkpoint(options.folder, options.rate, options.device, options.batch))


if __name__ == "__main__":
    main()
