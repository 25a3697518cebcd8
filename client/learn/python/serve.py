#!/usr/bin/env python3
"""Serves a policy with PyTorch, on a GPU if available.

    wheelarm evaluate --policy "exec:python3 serve.py policy.safetensors" ...

Returns the same actions as `wheelarm-learn serve`, which needs no PyTorch and runs on the CPU.
Requires the package `wheelarm` (client/python), torch, numpy and safetensors.

Tests of the use of language and images: `--say` replaces the sentence of the task,
`--pictures-of` the images with those of other episodes (of `dataset export --format tensors`).
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open

try:
    from wheelarm import policy, v1
except ImportError as error:
    raise SystemExit(
        f"error: cannot import wheelarm: {error}; pip install client/python of the repository, or add "
        "its folder client/python/src to PYTHONPATH"
    ) from None

import policy_file
from episodes import word_indices

TICKS_PER_SECOND = 240
ACTIONS = {"next-pose": v1.POLICY_ACTION_NEXT_POSE, "next-joints": v1.POLICY_ACTION_NEXT_JOINTS}


def seed_ranges(seeds):
    """Ranges of consecutive seeds: first, and last plus 1."""
    out = []
    for seed in sorted(seeds):
        if out and out[-1][1] == seed:
            out[-1][1] = seed + 1
        else:
            out.append([seed, seed + 1])
    return out


class OtherImages:
    """Images of other episodes, one episode for each seed, at the same time since the start."""

    def __init__(self, paths, card):
        self.ticks = round(TICKS_PER_SECOND / card["rate_hz"])
        self.names = [f"pictures.{camera['name']}" for camera in card["cameras"]]
        self.paths, self.opened, self.first_tick = sorted(paths), {}, {}
        sizes = [[camera["height"], camera["width"], 3] for camera in card["cameras"]]
        for path in self.paths:
            with safe_open(path, "np") as file:
                if any(file.get_slice(name).get_shape()[1:] != size for name, size in zip(self.names, sizes)):
                    raise ValueError(f"{path} lacks images {sizes} of {', '.join(self.names)}: export it with the policy's --size")

    def images(self, observation):
        path = self.paths[observation.seed % len(self.paths)]
        first = self.first_tick.setdefault(observation.episode_key, observation.tick)
        if path not in self.opened:
            self.opened[path] = safe_open(path, "np")
        file, row = self.opened[path], (observation.tick - first) // self.ticks
        slices = [file.get_slice(name) for name in self.names]
        return [one[min(row, one.get_shape()[0] - 1)].reshape(one.get_shape()[1:]) for one in slices]


class NetworkPolicy:
    """A trained network with its card, as a policy."""

    def __init__(self, path, device, batch, sentence=None, others=None):
        self.network, self.card = policy_file.load(path, device)
        self.sentence, self.others = sentence, OtherImages(others, self.card) if others else None
        self.device, self.batch, self.hash = device, batch, policy_file.sha256(path)
        spec = self.card["state"]
        self.shown = np.array([name not in spec["hidden"] for name in spec["names"]])

    def spec(self):
        card = self.card
        return v1.PolicySpec(
            name=card["name"] + self.describe_changes(),
            weights_sha256=self.hash,
            cameras=[
                v1.PolicyCamera(name=c["name"], width=c["width"], height=c["height"]) for c in card["cameras"]
            ],
            state_names=card["state"]["names"],
            history=1,
            rate_hz=card["rate_hz"],
            chunk=card["network"]["chunk"],
            execute=card["execute"],
            action=ACTIONS[card["action"]["kind"]],
            action_names=card["action"]["names"],
            max_batch=self.batch,
            stochastic=card["network"]["kind"] == "flow",
            training_seeds=[v1.SeedRange(first=first, end=end) for first, end in seed_ranges(card["training_seeds"])],
        )

    def describe_changes(self):
        """The replaced inputs, for reports."""
        text = f", sentence {self.sentence!r}" if self.sentence else ""
        return text + (", images of other episodes" if self.others else "")

    def reset(self, request):
        pass

    def images(self, observation):
        if self.others:
            return self.others.images(observation)
        return [observation.images[-1][camera["name"]] for camera in self.card["cameras"]]

    @torch.no_grad()
    def infer(self, observations):
        card, spec, shape = self.card, self.card["state"], self.network.shape
        states = np.stack([observation.state for observation in observations]).astype(np.float32)
        states = (states - np.float32(spec["mean"])) / np.float32(spec["std"]) * self.shown
        multiple = card["picture"]["multiple"]
        padded = np.stack([
            np.stack([policy_file.pad_image(image, multiple) for image in self.images(observation)])
            for observation in observations
        ])
        sentences = [self.sentence or observation.instruction for observation in observations]
        words = [word_indices(sentence, card["vocabulary"]) or [-1] for sentence in sentences]
        longest = max(map(len, words))
        words = torch.tensor([row + [-1] * (longest - len(row)) for row in words], device=self.device)
        noise = None
        if shape.kind == "flow":
            noise = torch.stack([self.noise(o.seed, o.tick) for o in observations]).to(self.device)
        images = policy_file.normalize_images(torch.from_numpy(padded).to(self.device), card)
        state = torch.from_numpy(states.astype(np.float32)).to(self.device)
        found = self.network(images, state, words, noise).float().cpu().numpy()
        rows = found * np.float32(card["action"]["std"]) + np.float32(card["action"]["mean"])
        return list(rows)

    def noise(self, seed, tick):
        """Noise of an episode and row, from seed and tick alone."""
        generator = torch.Generator().manual_seed((seed * 1_000_003 + tick) % 2**63)
        return torch.randn(self.network.shape.chunk, self.network.shape.action, generator=generator)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", type=Path)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--batch", type=int, default=64, help="largest batch of observations")
    parser.add_argument("--say", metavar="SENTENCE", help="replaces the sentence of the task")
    parser.add_argument("--pictures-of", type=Path, nargs="+", metavar="FILE",
        help="replaces the images with those of these exported episodes, one for each seed")
    options = parser.parse_args()
    try:
        network = NetworkPolicy(options.policy, options.device, options.batch, options.say, options.pictures_of)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    policy.serve(network)
    return 0


if __name__ == "__main__":
    sys.exit(main())
