"""Initialization of a training with the weights of another policy."""

import base64

import numpy as np
import torch

import policy_file
from episodes import UNKNOWN

STATE_INPUTS = ("model.encoder_robot_state_input_proj", "model.vae_encoder_robot_state_input_proj")
ACTION_OUTPUT = "model.action_head"
WORDS = "words.weight"
MAX_SCALE = 3.0  # largest increase of the weight of a number of the state


def initialize_from(network, path, card):
    """Copies every tensor with an equal shape; vocabularies and sizes may differ.

    Means and deviations of state and action depend on the data. The layers that read and write
    them are adapted, so that the network returns the same actions as before. `card` has the new
    ones. Returns the card of the policy at `path`, whose training seeds are excluded from
    validation.

    Raises ValueError when the policy does not fit."""
    state, before = policy_file.read(path)
    if before["network"].get("text_layers"):
        state, before = remove_text_encoder(path, state, before)
    own = network.state_dict()
    fits = {name: t for name, t in state.items() if name in own and own[name].shape == t.shape}
    fits |= shared_words(state, own, before["vocabulary"], card["vocabulary"])
    if not fits:
        raise ValueError(f"cannot initialize from {path}: none of its tensors fits this network; use equal sizes")
    if before["state"]["names"] == card["state"]["names"]:
        for layer in STATE_INPUTS:
            adapt_state_layer(fits, layer, before["state"], card["state"])
    if before["network"]["kind"] == "act" and before["action"]["names"] == card["action"]["names"]:
        adapt_action_layer(fits, before["action"], card["action"])
    network.load_state_dict(fits, strict=False)
    return before


def remove_text_encoder(path, state, card):
    """The policy before `text_encoder.py`, which changes only the words."""
    stored = card.get("text", {}).get("words")
    if not stored:
        raise ValueError(
            f"cannot initialize from {path}: it has a text encoder and lacks its former word vectors; start "
            "from the policy before text_encoder.py, and apply text_encoder.py to the result"
        )
    vectors = np.frombuffer(base64.b64decode(stored["vectors"]), np.int8).astype(np.float32)
    vectors = vectors.reshape(len(stored["vocabulary"]), -1) * np.float32(stored["scales"])[:, None]
    state = {name: tensor for name, tensor in state.items() if not name.startswith("text.")}
    state[WORDS] = torch.from_numpy(vectors)
    network = {**card["network"], "text_layers": 0, "words": len(stored["vocabulary"])}
    return state, {**card, "network": network, "vocabulary": stored["vocabulary"]}


def shared_words(state, own, before, now):
    """Vectors of the words in both vocabularies."""
    if WORDS not in state or WORDS not in own or state[WORDS].shape[1] != own[WORDS].shape[1]:
        return {}
    vectors, places = own[WORDS].detach().cpu().clone(), {word: place for place, word in enumerate(before)}
    for place, word in enumerate(now):
        if word in places:
            vectors[place] = state[WORDS][places[word]]
    vectors[UNKNOWN] = state[WORDS][UNKNOWN]
    return {WORDS: vectors}


def mean_and_std(part):
    return np.array(part["mean"], np.float32), np.array(part["std"], np.float32)


def adapt_state_layer(fits, layer, before, now):
    weight, bias = fits.get(f"{layer}.weight"), fits.get(f"{layer}.bias")
    if weight is None or bias is None:
        return
    (mean_before, std_before), (mean, std) = mean_and_std(before), mean_and_std(now)
    shown_before = np.array([name not in before["hidden"] for name in before["names"]])
    shown = shown_before & np.array([name not in now["hidden"] for name in now["names"]])
    # Limits the scale of a number that was nearly constant before.
    scale = np.minimum(std / std_before, MAX_SCALE) * shown
    offset = np.clip((mean - mean_before) / std_before, -MAX_SCALE, MAX_SCALE) * shown
    fits[f"{layer}.bias"] = bias + weight @ torch.from_numpy(offset.astype(np.float32))
    fits[f"{layer}.weight"] = weight * torch.from_numpy(scale.astype(np.float32))


def adapt_action_layer(fits, before, now):
    weight, bias = fits.get(f"{ACTION_OUTPUT}.weight"), fits.get(f"{ACTION_OUTPUT}.bias")
    if weight is None or bias is None:
        return
    (mean_before, std_before), (mean, std) = map(lambda part: map(torch.from_numpy, mean_and_std(part)), (before, now))
    fits[f"{ACTION_OUTPUT}.weight"] = weight * (std_before / std)[:, None]
    fits[f"{ACTION_OUTPUT}.bias"] = (bias * std_before + mean_before - mean) / std
