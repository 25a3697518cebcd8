#!/usr/bin/env python3
"""Serves a policy by PyTorch, on a GPU where there is one.

    wheelarm evaluate --policy "exec:python3 serve.py policy.safetensors" ...

Answers what `wheelarm-learn serve` answers, without PyTorch, on the processor. Needs the
package `wheelarm` (client/python), torch, numpy and safetensors.

Whether it uses eyes and ears: `--say` tells it another sentence than the task's,
`--pictures-of` shows it other episodes' pictures (of `dataset export --format tensors`).
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open

try:
    from wheelarm import policy, v1
except ImportError as problem:
    raise SystemExit(
        f"error: this Python cannot serve a policy ({problem}): pip install client/python of the repository, or "
        "name its folder client/python/src by PYTHONPATH"
    ) from None

import policy_file
from episodes import indices

TICKS_PER_SECOND = 240
ACTIONS = {"next-pose": v1.POLICY_ACTION_NEXT_POSE, "next-joints": v1.POLICY_ACTION_NEXT_JOINTS}


def ranges(seeds):
    """Runs of seeds as first and one after the last."""
    out = []
    for seed in sorted(seeds):
        if out and out[-1][1] == seed:
            out[-1][1] = seed + 1
        else:
            out.append([seed, seed + 1])
    return out


class Others:
    """Pictures of other episodes, one for each seed, at the same time since the start."""

    def __init__(self, paths, card):
        self.ticks = round(TICKS_PER_SECOND / card["rate_hz"])
        self.names = [f"pictures.{camera['name']}" for camera in card["cameras"]]
        self.paths, self.opened, self.begun = sorted(paths), {}, {}
        sizes = [[camera["height"], camera["width"], 3] for camera in card["cameras"]]
        for path in self.paths:
            with safe_open(path, "np") as file:
                if any(file.get_slice(name).get_shape()[1:] != size for name, size in zip(self.names, sizes)):
                    raise ValueError(f"{path} has not the pictures {sizes} of {', '.join(self.names)}")

    def seen(self, observation):
        path = self.paths[observation.seed % len(self.paths)]
        begun = self.begun.setdefault(observation.episode_key, observation.tick)
        if path not in self.opened:
            self.opened[path] = safe_open(path, "np")
        file, row = self.opened[path], (observation.tick - begun) // self.ticks
        slices = [file.get_slice(name) for name in self.names]
        return [told[min(row, told.get_shape()[0] - 1)].reshape(told.get_shape()[1:]) for told in slices]


class Trained:
    """A network with its card."""

    def __init__(self, path, device, batch, say=None, others=None):
        self.network, self.card = policy_file.load(path, device)
        self.say, self.others = say, Others(others, self.card) if others else None
        self.device, self.batch, self.hash = device, batch, policy_file.sha256(path)
        told = self.card["state"]
        self.shown = np.array([name not in told["hidden"] for name in told["names"]])

    def spec(self):
        card = self.card
        return v1.PolicySpec(
            name=card["name"] + self.altered(),
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
            training_seeds=[v1.SeedRange(first=first, end=end) for first, end in ranges(card["training_seeds"])],
        )

    def altered(self):
        """What it is not told or shown as it is, for reports."""
        said = f", told {self.say!r}" if self.say else ""
        return said + (", other episodes' pictures" if self.others else "")

    def reset(self, request):
        pass

    def pictures(self, observation):
        if self.others:
            return self.others.seen(observation)
        return [observation.pictures[-1][camera["name"]] for camera in self.card["cameras"]]

    @torch.no_grad()
    def infer(self, observations):
        card, told, shape = self.card, self.card["state"], self.network.shape
        states = np.stack([observation.state for observation in observations]).astype(np.float32)
        states = (states - np.float32(told["mean"])) / np.float32(told["std"]) * self.shown
        multiple = card["picture"]["multiple"]
        seen = np.stack([
            np.stack([policy_file.padded(picture, multiple) for picture in self.pictures(observation)])
            for observation in observations
        ])
        sentences = [self.say or observation.instruction for observation in observations]
        words = [indices(sentence, card["vocabulary"]) or [-1] for sentence in sentences]
        longest = max(map(len, words))
        words = torch.tensor([row + [-1] * (longest - len(row)) for row in words], device=self.device)
        noise = None
        if shape.kind == "flow":
            noise = torch.stack([self.noise(o.seed, o.tick) for o in observations]).to(self.device)
        pictures = policy_file.prepared(torch.from_numpy(seen).to(self.device), card)
        state = torch.from_numpy(states.astype(np.float32)).to(self.device)
        found = self.network(pictures, state, words, noise).float().cpu().numpy()
        rows = found * np.float32(card["action"]["std"]) + np.float32(card["action"]["mean"])
        return list(rows)

    def noise(self, seed, tick):
        """The same for the same episode and row."""
        generator = torch.Generator().manual_seed((seed * 1_000_003 + tick) % 2**63)
        return torch.randn(self.network.shape.chunk, self.network.shape.action, generator=generator)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", type=Path)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--batch", type=int, default=64, help="observations at a time")
    parser.add_argument("--say", metavar="SENTENCE", help="tells it this in the place of the task's sentence")
    parser.add_argument("--pictures-of", type=Path, nargs="+", metavar="FILE",
        help="shows it pictures of these exported episodes, one for each seed")
    options = parser.parse_args()
    try:
        trained = Trained(options.policy, options.device, options.batch, options.say, options.pictures_of)
    except (OSError, ValueError) as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 1
    policy.serve(trained)
    return 0


if __name__ == "__main__":
    sys.exit(main())
