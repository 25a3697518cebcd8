"""Checks `wheelarm.lerobot_policy` with small LeRobot checkpoints with random weights: the rows
equal LeRobot's own, in the units of the data; each episode has its own history; and nothing is
downloaded.

    PYTHONPATH=client/python/src python check_lerobot_policy.py [FOLDER]

Writes an ACT checkpoint to FOLDER/act and diffusion policies to FOLDER/diffusion and FOLDER/ddim
(the latter allows batches), for `wheelarm evaluate --policy lerobot:FOLDER/act`.
"""

import json
import os
import sys
import tempfile
from pathlib import Path

os.environ["HF_HUB_OFFLINE"] = "1"

import numpy as np
import torch
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.diffusion.configuration_diffusion import DiffusionConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from wheelarm import v1
from wheelarm.lerobot_policy import Checkpoint
from wheelarm.policy import Observation

STATE, ACTION, CAMERAS = 27, 12, {"gen3": (54, 96), "wheelchair": (54, 96)}


def configuration(kind):
    features = {
        f"observation.images.{name}": PolicyFeature(FeatureType.VISUAL, (3, *size)) for name, size in CAMERAS.items()
    }
    features["observation.state"] = PolicyFeature(FeatureType.STATE, (STATE,))
    common = {
        "input_features": features,
        "output_features": {"action": PolicyFeature(FeatureType.ACTION, (ACTION,))},
        "pretrained_backbone_weights": None,
        "device": "cpu",
        "push_to_hub": False,
    }
    if kind == "act":
        return ACTConfig(
            chunk_size=8, n_action_steps=5, dim_model=32, n_heads=2, dim_feedforward=32, n_encoder_layers=1,
            n_vae_encoder_layers=1, latent_dim=4, **common,
        )  # fmt: skip
    return DiffusionConfig(
        n_obs_steps=2, horizon=8, n_action_steps=4, down_dims=(16, 32), n_groups=4, diffusion_step_embed_dim=16,
        num_train_timesteps=4, num_inference_steps=2, spatial_softmax_num_keypoints=4, crop_shape=(48, 84),
        noise_scheduler_type="DDIM" if kind == "ddim" else "DDPM", **common,
    )  # fmt: skip


def save(kind, folder):
    """Saves a policy in the format of `lerobot-train`."""
    torch.manual_seed(7)
    config = configuration(kind)
    random = np.random.default_rng(7)
    statistics = {}
    for name, size in (("observation.state", STATE), ("action", ACTION)):
        mean = random.normal(size=size).astype(np.float32)
        spread = random.uniform(0.5, 2, size).astype(np.float32)
        statistics[name] = {"mean": mean, "std": spread, "min": mean - spread, "max": mean + spread}
    for name in CAMERAS:
        one = np.ones((3, 1, 1), np.float32)
        statistics[f"observation.images.{name}"] = {"mean": 0.5 * one, "std": 0.25 * one, "min": 0 * one, "max": one}
    statistics = {k: {s: torch.from_numpy(np.asarray(v)) for s, v in d.items()} for k, d in statistics.items()}
    network = get_policy_class(config.type)(config)
    network.save_pretrained(folder)
    before, after = make_pre_post_processors(config, dataset_stats=statistics)
    before.save_pretrained(folder)
    after.save_pretrained(folder)
    # Checkpoints of lerobot-train name weights that LeRobot would download again.
    configuration_json = json.loads((folder / "config.json").read_text())
    configuration_json["pretrained_backbone_weights"] = "ResNet18_Weights.IMAGENET1K_V1"
    (folder / "config.json").write_text(json.dumps(configuration_json))
    return network, before, after


def observation(seed, tick, history):
    random = np.random.default_rng(1000 * seed + tick)
    images = [
        {name: random.integers(0, 256, (*size, 3), np.uint8) for name, size in CAMERAS.items()} for _ in range(history)
    ]
    return Observation(
        episode_key=f"run-{seed}", seed=seed, first=tick == 0, tick=tick, instruction="Take the mug",
        states=random.normal(size=(history, STATE)), images=images, depths=[{} for _ in range(history)],
    )  # fmt: skip


def lerobot_rows(network, before, after, observed):
    """Rows of LeRobot in an environment, step by step: `select_action` with its queues."""
    torch.manual_seed((observed.seed * 1_000_003 + observed.tick) % 2**63)
    network.reset()
    network.eval()
    rows = []
    steps = len(observed.states)
    with torch.inference_mode():
        for i in range(steps):
            item = {"task": observed.instruction, "observation.state": torch.from_numpy(observed.states[i].astype(np.float32))}
            for name, image in observed.images[i].items():
                item[f"observation.images.{name}"] = torch.from_numpy(image.transpose(2, 0, 1).copy()).float() / 255
            batch = {k: v for k, v in before(item).items() if v is not None}
            if i + 1 < steps:
                # Fills the queue before the first action.
                fill(network, batch)
        rows.append(after(network.select_action(batch)))
        for _ in range(3):
            rows.append(after(network.select_action(batch)))
    return torch.cat(rows).numpy()


def fill(network, batch):
    from lerobot.policies.utils import populate_queues

    if not hasattr(network, "_queues"):
        return
    images = torch.stack([batch[key] for key in network.config.image_features], dim=-4)
    network._queues = populate_queues(network._queues, {**batch, "observation.images": images})


def check(kind, folder):
    folder.mkdir(parents=True, exist_ok=True)
    own = save(kind, folder)
    served = Checkpoint(folder, 10.0, "cpu", 4)
    spec = served.spec()
    history = 1 if kind == "act" else 2
    assert served.can_batch == (kind != "diffusion")
    assert (spec.history, spec.rate_hz, spec.action) == (history, 10.0, v1.POLICY_ACTION_NEXT_POSE), spec
    assert {c.name: (c.height, c.width) for c in spec.cameras} == CAMERAS, spec
    assert len(spec.weights_sha256) == 64 and 1 <= spec.execute <= spec.chunk
    observations = [observation(seed, 24 * seed, history) for seed in (3, 4)]
    both = served.infer(observations)
    for observed, rows in zip(observations, both, strict=True):
        assert rows.shape[1] == ACTION and rows.shape[0] >= spec.execute, rows.shape
        expected = lerobot_rows(*own, observed)
        count = len(expected)
        off = np.abs(rows[:count] - expected).max()
        print(f"{kind}: {rows.shape[0]} rows, difference to LeRobot {off:.1e}")
        assert off < 1e-5, (rows[:count], expected)
    again = served.infer(observations[::-1])[::-1]
    for one, other in zip(both, again, strict=True):
        assert np.abs(one - other).max() < 1e-5, "rows depend on earlier observations, or on the batch"
    alone = [served.infer([one])[0] for one in observations]
    again = [served.infer([one])[0] for one in observations[::-1]][::-1]
    for one, other in zip(alone, again, strict=True):
        assert np.array_equal(one, other), "rows depend on earlier observations"


def main():
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(temporary)
        for kind in ("act", "diffusion", "ddim"):
            check(kind, folder / kind)


main()
