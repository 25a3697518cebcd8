"""A policy is one safetensors file: weights by LeRobot's names, and in its metadata,
under the key `wheelarm`, the model card as JSON. `wheelarm-learn serve` reads it."""

import hashlib
import json
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from episodes import indices
from network import Policy, Shape

FORMAT = "wheelarm-policy/1"
SCALE = ".scale"
LEAST_QUANTISED = 4096  # smaller tensors are too few bytes to lose precision for
ONLY_IN_TRAINING = ("model.vae_encoder", "aims.")
COUNTER = ".num_batches_tracked"  # of a batch norm, which needs it no more


def packed(state, bits):
    """Tensors as they are stored. 32: as they are; 16: half precision; 8: matrices
    and convolutions as integers -127 to 127 times a scale for each output, the rest
    in half precision."""
    out = {}
    for name, tensor in state.items():
        tensor = tensor.detach().float().cpu().contiguous()
        if bits == 8 and tensor.dim() >= 2 and tensor.numel() >= LEAST_QUANTISED:
            rows = tensor.flatten(1)
            scale = rows.abs().amax(1).clamp(min=1e-12) / 127
            values = (rows / scale[:, None]).round().clamp(-127, 127).to(torch.int8)
            out[name] = values.reshape(tensor.shape).contiguous()
            out[name + SCALE] = scale
        elif bits in (8, 16):
            out[name] = tensor.half()
        elif bits == 32:
            out[name] = tensor
        else:
            raise ValueError(f"weights have 8, 16 or 32 bits, not {bits}")
    return out


def unpacked(tensors):
    """Single precision again."""
    out = {}
    for name, tensor in tensors.items():
        if name.endswith(SCALE):
            continue
        value = tensor.float()
        if tensor.dtype == torch.int8:
            scale = tensors[name + SCALE]
            value = value * scale.reshape(-1, *[1] * (value.dim() - 1))
        out[name] = value
    return out


def write(path, state, card, bits=16, training=False):
    """Writes the policy, and its card with the hash of the file as JSON beside it.
    Without `training` the part that only training needs is left out."""
    path = Path(path)
    state = {n: t for n, t in state.items() if training or not n.startswith(ONLY_IN_TRAINING)}
    state = {n: t for n, t in state.items() if not n.endswith(COUNTER)}
    if broken := [n for n, t in state.items() if not t.isfinite().all()]:
        raise ValueError(f"{broken[0]} is not finite: the training has diverged; go back to a checkpoint, with a smaller --lr")
    card = {"format": FORMAT, **card, "bits": bits}
    text = json.dumps(card, indent=1)
    part = path.with_name(path.name + ".part")
    part.write_bytes(save(packed(state, bits), metadata={"wheelarm": text}))
    part.replace(path)
    beside = {**card, "weights_sha256": sha256(path), "bytes": path.stat().st_size}
    path.with_suffix(".json").write_text(json.dumps(beside, indent=1) + "\n")


def read(path):
    """State and card."""
    try:
        with safe_open(path, "pt") as file:
            text = (file.metadata() or {}).get("wheelarm")
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except SafetensorError as problem:
        raise ValueError(f"{path} is cut short or no safetensors file ({problem}): fetch or train it anew") from None
    if text is None:
        raise ValueError(f"{path} has no model card: it was not written by train.py or `wheelarm-learn`")
    card = json.loads(text)
    if card.get("format") != FORMAT:
        raise ValueError(f"{path} has the format {card.get('format')!r}, expected {FORMAT!r}")
    return unpacked(tensors), card


def load(path, device="cpu"):
    """The network, ready to be asked, and its card."""
    state, card = read(path)
    network = Policy(Shape(**card["network"]))
    state = {name: tensor for name, tensor in state.items() if not name.startswith(ONLY_IN_TRAINING)}
    missing, unknown = network.load_state_dict(state, strict=False)
    missing = [name for name in missing if not name.startswith(ONLY_IN_TRAINING)]
    if missing or unknown:
        raise ValueError(f"{path} does not fit its card: missing {missing[:3]}, unknown {unknown[:3]}")
    return network.to(device).eval(), card


def sha256(path):
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def prepared(pictures, card):
    """Pictures [B, cameras, H, W, 3] of bytes to what the network takes."""
    mean, deviation = (np.array(card["picture"][k], np.float32) for k in ("mean", "std"))
    x = pictures.permute(0, 1, 4, 2, 3).float() / 255
    shape = (1, 1, 3, 1, 1)
    to = dict(device=x.device)
    return (x - torch.tensor(mean, **to).view(shape)) / torch.tensor(deviation, **to).view(shape)


def padded(picture, multiple):
    """[H, W, 3] bytes, the edge repeated on all sides up to multiples."""
    sides = [(-side % multiple) for side in picture.shape[:2]]
    around = [(side // 2, side - side // 2) for side in sides] + [(0, 0)]
    return np.pad(picture, around, mode="edge")


@torch.no_grad()
def ask(network, card, pictures, state, sentence, noise=None):
    """Rows of action [chunk, action] in their units, for pictures (a list of arrays
    [H, W, 3] in the order of the card) and a state in its units."""
    told = card["state"]
    shown = np.array([name not in told["hidden"] for name in told["names"]])
    state = (np.asarray(state, np.float32) - np.float32(told["mean"])) / np.float32(told["std"]) * shown
    seen = np.stack([padded(picture, card["picture"]["multiple"]) for picture in pictures])
    device = next(network.parameters()).device
    words = torch.tensor([indices(sentence, card["vocabulary"]) or [-1]], device=device)
    seen = prepared(torch.from_numpy(seen)[None].to(device), card)
    found = network(seen, torch.from_numpy(state.astype(np.float32))[None].to(device), words, noise)
    action = card["action"]
    return found[0].float().cpu().numpy() * np.float32(action["std"]) + np.float32(action["mean"])
