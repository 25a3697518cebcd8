"""Policy files: one safetensors file with weights under LeRobot's names, and the model card as
JSON in the metadata, under the key `wheelarm`. `wheelarm-learn serve` reads it."""

import hashlib
import json
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

import ledger
from episodes import word_indices
from network import Policy, Shape

FORMAT = "wheelarm-policy/1"
SCALE = ".scale"
MIN_QUANTISED = 4096  # elements; smaller tensors keep their precision, as they are few bytes
ONLY_IN_TRAINING = ("model.vae_encoder", "aims.")
COUNTER = ".num_batches_tracked"  # of a batch norm, unused after training


def pack(state, bits):
    """Tensors in the precision of the file. 32: unchanged; 16: half precision; 8: matrices and
    convolutions as integers -127 to 127 with a scale for each output, the rest in half
    precision."""
    out = {}
    for name, tensor in state.items():
        tensor = tensor.detach().float().cpu().contiguous()
        if bits == 8 and tensor.dim() >= 2 and tensor.numel() >= MIN_QUANTISED:
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
            raise ValueError(f"invalid number of bits {bits}: choose 8, 16 or 32")
    return out


def unpack(tensors):
    """Tensors in single precision."""
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


def write(path, state, card, bits=16, training=False, record=None):
    """Writes the policy, and next to it the card with the hash of the file as JSON, and the
    training ledger `record`. Without `training`, tensors that only training needs are left out.

    Raises ValueError when a tensor is not finite."""
    path = Path(path)
    state = {n: t for n, t in state.items() if training or not n.startswith(ONLY_IN_TRAINING)}
    state = {n: t for n, t in state.items() if not n.endswith(COUNTER)}
    if broken := [n for n, t in state.items() if not t.isfinite().all()]:
        raise ValueError(f"{broken[0]} is not finite: the training has diverged; return to a checkpoint, with a smaller --lr")
    card = {"format": FORMAT, **card, "bits": bits}
    text = json.dumps(card, indent=1)
    part = path.with_name(path.name + ".part")
    part.write_bytes(save(pack(state, bits), metadata={"wheelarm": text}))
    part.replace(path)
    sidecar = {**card, "weights_sha256": sha256(path), "bytes": path.stat().st_size}
    path.with_suffix(".json").write_text(json.dumps(sidecar, indent=1) + "\n")
    ledger.write(path, record, sidecar["weights_sha256"])


def read(path):
    """Reads state and card.

    Raises ValueError when the file is not a policy."""
    try:
        with safe_open(path, "pt") as file:
            text = (file.metadata() or {}).get("wheelarm")
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except SafetensorError as error:
        raise ValueError(f"cannot read {path}: {error}; download or train it again") from None
    if text is None:
        raise ValueError(f"{path} has no model card: use a file of train.py or `wheelarm-learn`")
    card = json.loads(text)
    if card.get("format") != FORMAT:
        raise ValueError(f"{path} has the format {card.get('format')!r}, expected {FORMAT!r}: use train.py of the same release")
    return unpack(tensors), card


def load(path, device="cpu"):
    """Loads the network in evaluation mode, and its card.

    Raises ValueError when the file is not a policy."""
    state, card = read(path)
    network = Policy(Shape(**card["network"]))
    state = {name: tensor for name, tensor in state.items() if not name.startswith(ONLY_IN_TRAINING)}
    missing, unknown = network.load_state_dict(state, strict=False)
    missing = [name for name in missing if not name.startswith(ONLY_IN_TRAINING)]
    if missing or unknown:
        raise ValueError(f"{path} does not fit its card: missing {missing[:3]}, unknown {unknown[:3]}; download or train it again")
    return network.to(device).eval(), card


def sha256(path):
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def normalize_images(images, card):
    """Converts images [B, cameras, H, W, 3], 8-bit, to [B, cameras, 3, H, W], normalised."""
    mean, deviation = (np.array(card["picture"][k], np.float32) for k in ("mean", "std"))
    x = images.permute(0, 1, 4, 2, 3).float() / 255
    shape = (1, 1, 3, 1, 1)
    to = dict(device=x.device)
    return (x - torch.tensor(mean, **to).view(shape)) / torch.tensor(deviation, **to).view(shape)


def pad_image(image, multiple):
    """Pads an image [H, W, 3] on all sides with its edge, to multiples."""
    sides = [(-side % multiple) for side in image.shape[:2]]
    around = [(side // 2, side - side // 2) for side in sides] + [(0, 0)]
    return np.pad(image, around, mode="edge")


@torch.no_grad()
def infer(network, card, images, state, sentence, noise=None):
    """Rows of action [chunk, action] in their units, for images (a list of arrays [H, W, 3] in the
    order of the card) and a state in its units."""
    spec = card["state"]
    shown = np.array([name not in spec["hidden"] for name in spec["names"]])
    state = (np.asarray(state, np.float32) - np.float32(spec["mean"])) / np.float32(spec["std"]) * shown
    padded = np.stack([pad_image(image, card["picture"]["multiple"]) for image in images])
    device = next(network.parameters()).device
    words = torch.tensor([word_indices(sentence, card["vocabulary"]) or [-1]], device=device)
    normalized = normalize_images(torch.from_numpy(padded)[None].to(device), card)
    found = network(normalized, torch.from_numpy(state.astype(np.float32))[None].to(device), words, noise)
    action = card["action"]
    return found[0].float().cpu().numpy() * np.float32(action["std"]) + np.float32(action["mean"])
