"""Where a training begins: at the weights of another policy."""

import base64

import numpy as np
import torch

import policy_file
from episodes import UNKNOWN

STATE_INPUTS = ("model.encoder_robot_state_input_proj", "model.vae_encoder_robot_state_input_proj")
ACTION_OUTPUT = "model.action_head"
WORDS = "words.weight"
MOST_TIMES = 3.0  # so much more than before a number of the state may weigh


def begin_from(network, path, card):
    """Takes every tensor that fits; words and sizes may differ. What the numbers of
    state and action are measured in, their means and deviations, differs with the
    data: the layers that read and write them are changed so that the network answers
    what it answered before. `card` tells the new ones. Gives the card of the policy,
    whose training seeds are those of this one too."""
    state, before = policy_file.read(path)
    if before["network"].get("text_layers"):
        state, before = without_text_encoder(path, state, before)
    own = network.state_dict()
    fits = {name: t for name, t in state.items() if name in own and own[name].shape == t.shape}
    fits |= words(state, own, before["vocabulary"], card["vocabulary"])
    if not fits:
        raise ValueError(f"{path} has no tensor that fits this network")
    if before["state"]["names"] == card["state"]["names"]:
        for layer in STATE_INPUTS:
            read_state(fits, layer, before["state"], card["state"])
    if before["network"]["kind"] == "act" and before["action"]["names"] == card["action"]["names"]:
        write_action(fits, before["action"], card["action"])
    network.load_state_dict(fits, strict=False)
    return before


def without_text_encoder(path, state, card):
    """What it was before `text_encoder.py` taught it, which changed its words alone."""
    told = card.get("text", {}).get("words")
    if not told:
        raise ValueError(
            f"{path} reads by a text encoder, and what is trained takes the mean of its words: "
            "begin with the policy that it was taught from, and teach what comes of it (text_encoder.py)"
        )
    vectors = np.frombuffer(base64.b64decode(told["vectors"]), np.int8).astype(np.float32)
    vectors = vectors.reshape(len(told["vocabulary"]), -1) * np.float32(told["scales"])[:, None]
    state = {name: tensor for name, tensor in state.items() if not name.startswith("text.")}
    state[WORDS] = torch.from_numpy(vectors)
    network = {**card["network"], "text_layers": 0, "words": len(told["vocabulary"])}
    return state, {**card, "network": network, "vocabulary": told["vocabulary"]}


def words(state, own, before, now):
    """Vectors of the words that both know."""
    if WORDS not in state or WORDS not in own or state[WORDS].shape[1] != own[WORDS].shape[1]:
        return {}
    vectors, places = own[WORDS].detach().cpu().clone(), {word: place for place, word in enumerate(before)}
    for place, word in enumerate(now):
        if word in places:
            vectors[place] = state[WORDS][places[word]]
    vectors[UNKNOWN] = state[WORDS][UNKNOWN]
    return {WORDS: vectors}


def numbers(told):
    return np.array(told["mean"], np.float32), np.array(told["std"], np.float32)


def read_state(fits, layer, before, now):
    weight, bias = fits.get(f"{layer}.weight"), fits.get(f"{layer}.bias")
    if weight is None or bias is None:
        return
    (mean_before, std_before), (mean, std) = numbers(before), numbers(now)
    shown_before = np.array([name not in before["hidden"] for name in before["names"]])
    shown = shown_before & np.array([name not in now["hidden"] for name in now["names"]])
    # A number that hardly varied before was noise then, and is not blown up.
    times = np.minimum(std / std_before, MOST_TIMES) * shown
    offset = np.clip((mean - mean_before) / std_before, -MOST_TIMES, MOST_TIMES) * shown
    fits[f"{layer}.bias"] = bias + weight @ torch.from_numpy(offset.astype(np.float32))
    fits[f"{layer}.weight"] = weight * torch.from_numpy(times.astype(np.float32))


def write_action(fits, before, now):
    weight, bias = fits.get(f"{ACTION_OUTPUT}.weight"), fits.get(f"{ACTION_OUTPUT}.bias")
    if weight is None or bias is None:
        return
    (mean_before, std_before), (mean, std) = map(lambda told: map(torch.from_numpy, numbers(told)), (before, now))
    fits[f"{ACTION_OUTPUT}.weight"] = weight * (std_before / std)[:, None]
    fits[f"{ACTION_OUTPUT}.bias"] = (bias * std_before + mean_before - mean) / std
