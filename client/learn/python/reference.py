#!/usr/bin/env python3
"""Writes small networks with random weights and PyTorch's outputs, for the Rust tests:

    python3 client/learn/python/reference.py client/learn/tests/data
"""

import sys
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import save

import policy_file
from network import Policy, Shape

STATE = ["alpha", "beta", "gamma", "delta", "epsilon"]
ACTION = [f"number{k}" for k in range(9)]
VOCABULARY = ["<unknown>", "the", "mug", "get", "me"]
SENTENCE = "Get me the MUG, the red one"
CASES = {
    "act": dict(),
    "act-frozen": dict(norm="frozen-bn", words=0, decoder_layers=2),
    "act-8bit": dict(bits=8, width=4),
    "act-16bit": dict(bits=16),
    "act-film": dict(film=True),
    "act-text": dict(film=True, text_layers=2, text_width=10, text_dim=8, text_heads=2),
    "flow": dict(kind="flow", flow_layers=2, flow_steps=4),
}


def make(folder, name, bits=32, **options):
    torch.manual_seed(sum(name.encode()))
    random = np.random.default_rng(7)
    shape = Shape(
        **{
            "state": len(STATE), "action": len(ACTION), "chunk": 4, "cameras": 2, "words": len(VOCABULARY),
            "word_width": 6, "width": 2, "group_channels": 1, "dim": 16, "feedforward": 24, "heads": 2,
            "encoder_layers": 2, "vae_layers": 1, "latent": 3, **options,
        }
    )  # fmt: skip
    network = Policy(shape).eval()
    state = network.state_dict()
    for key, tensor in state.items():
        # Identity norms and heads of zeros would hide errors.
        if key.endswith("running_var"):
            tensor.uniform_(0.5, 2)
        elif ".film." in key:
            tensor.add_(torch.randn_like(tensor) * 0.3)
        elif tensor.dim() == 1 or key.startswith("flow."):
            tensor.add_(torch.randn_like(tensor) * 0.2)
    numbers = lambda count: random.normal(size=count).astype(np.float32)  # noqa: E731
    card = {
        "name": name, "network": shape.to_dict(), "robot": "none", "rate_hz": 10.0, "chunk": 4, "execute": 2,
        "history": 1, "stochastic": shape.kind == "flow",
        "cameras": [{"name": c, "width": 50, "height": 41, "depth": False} for c in ("left", "right")],
        "picture": {"mean": [0.4, 0.5, 0.6], "std": [0.2, 0.25, 0.3], "multiple": 32, "padding": "edge"},
        "state": {"names": STATE, "mean": numbers(5).tolist(), "std": (0.5 + numbers(5) ** 2).tolist(), "hidden": ["gamma"]},
        "action": {"kind": "next-joints", "names": ACTION, "units": ["rad"] * 9, "mean": numbers(9).tolist(),
            "std": (0.5 + numbers(9) ** 2).tolist()},
        "vocabulary": VOCABULARY if shape.words else [], "training_seeds": [1, 2, 3], "validation_seeds": [9],
        "tasks": ["none"], "data": {}, "training": {},
    }  # fmt: skip
    path = folder / f"{name}.safetensors"
    policy_file.write(path, state, card, bits)
    path.with_suffix(".json").unlink()
    # Reloaded, in the precision of the file.
    network, card = policy_file.load(path)
    images = random.integers(0, 256, (2, 41, 50, 3), dtype=np.uint8)
    state, noise = numbers(5), numbers((1, 4, 9))
    rows = policy_file.infer(network, card, list(images), state, SENTENCE, torch.from_numpy(noise))
    answers = {"pictures": images, "state": state, "noise": noise, "rows": rows.astype(np.float32)}
    out = folder / f"{name}.answers.safetensors"
    out.write_bytes(save(answers, metadata={"wheelarm": SENTENCE}))
    print(f"{name}: {path.stat().st_size} bytes, first row {np.round(rows[0][:4], 4)}")


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, options in CASES.items():
        make(folder, name, **options)


if __name__ == "__main__":
    main()
