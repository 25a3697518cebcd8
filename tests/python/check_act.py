"""Checks that our ACT equals LeRobot's: the same names and, with its random weights, the same
actions in evaluation and training; and that LeRobot reads our policy files. Tests of
client/learn compare Rust.

    python check_act.py client/learn/python
"""

import sys
import tempfile
from pathlib import Path

import torch

sys.path.insert(0, sys.argv[1])

from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from network import Policy, Shape
from safetensors.torch import load_file, save_file

import policy_file

CAMERAS = ["observation.images.gen3", "observation.images.wheelchair"]


def lerobot_act(shape):
    visual = PolicyFeature(FeatureType.VISUAL, (3, 128, 224))
    inputs = {name: visual for name in CAMERAS}
    inputs["observation.state"] = PolicyFeature(FeatureType.STATE, (shape.state,))
    inputs["observation.environment_state"] = PolicyFeature(FeatureType.ENV, (shape.word_width,))
    config = ACTConfig(
        input_features=inputs,
        output_features={"action": PolicyFeature(FeatureType.ACTION, (shape.action,))},
        chunk_size=shape.chunk, n_action_steps=shape.chunk, dim_model=shape.dim, n_heads=shape.heads,
        dim_feedforward=shape.feedforward, n_encoder_layers=shape.encoder_layers,
        n_decoder_layers=shape.decoder_layers, n_vae_encoder_layers=shape.vae_layers,
        latent_dim=shape.latent, pretrained_backbone_weights=None, dropout=0.0, device="cpu",
    )  # fmt: skip
    return ACTPolicy(config)


def main():
    torch.manual_seed(0)
    shape = Shape(norm="frozen-bn", words=7, dropout=0.0)
    lerobot = lerobot_act(shape)
    for name, buffer in lerobot.named_buffers():
        # Statistics of 0 and 1 would hide an error.
        if name.endswith("running_var"):
            buffer.uniform_(0.5, 2)
        elif name.endswith("running_mean"):
            buffer.normal_(0, 0.1)
    ours = Policy(shape)
    missing, unknown = ours.load_state_dict(lerobot.state_dict(), strict=False)
    assert not unknown and missing == ["words.weight"], (missing, unknown)

    count = 3
    images, state, language = torch.randn(count, 2, 3, 128, 224), torch.randn(count, 27), torch.randn(count, 300)
    actions, is_pad = torch.randn(count, shape.chunk, 12), torch.zeros(count, shape.chunk, dtype=torch.bool)
    is_pad[1, 15:] = True
    batch = {
        CAMERAS[0]: images[:, 0], CAMERAS[1]: images[:, 1], "observation.state": state,
        "observation.environment_state": language,
    }  # fmt: skip
    lerobot.eval(), ours.eval()
    with torch.no_grad():
        expected = lerobot.predict_action_chunk(batch)
        found = ours.model(images, state, language)[0]
    error = (expected - found).abs().max().item()
    print(f"evaluation: largest difference {error:.2e} of {expected.abs().max():.2f}")
    assert error < 1e-4

    lerobot.train(), ours.train()
    batch |= {"action": actions, "action_is_pad": is_pad}
    torch.manual_seed(5)
    loss, parts = lerobot(batch)
    torch.manual_seed(5)
    found, mean, log_variance, _ = ours.model(images, state, language, actions, is_pad)
    l1 = ((found - actions).abs() * ~is_pad[..., None]).mean().item()
    kl = (-0.5 * (1 + log_variance - mean**2 - log_variance.exp())).sum(-1).mean().item()
    print(f"training: L1 {l1:.6f} and {parts['l1_loss']:.6f}, divergence {kl:.6f} and {parts['kld_loss']:.6f}")
    assert abs(l1 - parts["l1_loss"]) < 1e-5 and abs(kl - parts["kld_loss"]) < 1e-4

    # LeRobot reads our files, without the word vectors.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "policy.safetensors"
        policy_file.write(path, ours.state_dict(), {"network": shape.to_dict()}, bits=32, training=True)
        state = load_file(path)
        own = {name: tensor for name, tensor in state.items() if name.startswith("model.")}
        save_file(own, path)
        result = lerobot.load_state_dict(load_file(path), strict=True)
        print("LeRobot reads our file:", result)


if __name__ == "__main__":
    main()
