"""Checks `client/learn/python/text_encoder.py`: unknown words work by their vectors, the order of
words counts, and invalid input is an error with a message.

    python tests/python/check_text.py     # needs torch, numpy, safetensors
"""

import itertools
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch

LEARN = Path(__file__).parents[2] / "client/learn/python"
sys.path.insert(0, str(LEARN))

import warm_start
import policy_file
import text_encoder
from episodes import word_indices
from network import Policy, Shape

OBJECTS = ("mug", "bowl", "bottle")
NEW = {"beaker": "mug", "basin": "bowl", "flask": "bottle"}  # with near vectors
WIDTH = 12


def make(folder):
    """Writes a policy with random weights that knows OBJECTS, sentences, and word vectors."""
    torch.manual_seed(3)
    vocabulary = ["<unknown>", *sorted({"get", "take", "the", "left", "of", *OBJECTS})]
    shape = Shape(words=len(vocabulary), word_width=16, width=2, group_channels=1, dim=16, feedforward=8, heads=2,
        encoder_layers=1, vae_layers=1, film=True, state=3, action=2)  # fmt: skip
    network = Policy(shape)
    for layer in network.model.film:
        torch.nn.init.normal_(layer.weight, std=0.3)
    numbers = lambda count: {"mean": [0.0] * count, "std": [1.0] * count}  # noqa: E731
    card = {
        "name": "small", "network": shape.to_dict(), "vocabulary": vocabulary, "training_seeds": [1],
        "state": {"names": ["a", "b", "c"], "hidden": [], **numbers(3)}, "action": {"names": ["d", "e"], **numbers(2)},
    }  # fmt: skip
    policy_file.write(folder / "before.safetensors", network.state_dict(), card, 32)
    lines = []
    for verb, (target, other) in itertools.product(("get", "take"), itertools.permutations(OBJECTS, 2)):
        for sentence in (f"{verb} the {target}", f"{verb} the {target} left of the {other}"):
            lines += [json.dumps({"task": f"pick_{target}", "target": target, "seed": 1, "instruction": sentence})] * 4
    (folder / "sentences.jsonl").write_text("\n".join(lines))
    random = np.random.default_rng(5)
    vectors = {word: random.normal(size=WIDTH) for word in ("get", "take", "the", "left", "of", *OBJECTS)}
    vectors |= {new: vectors[known] + 0.25 * random.normal(size=WIDTH) for new, known in NEW.items()}
    rows = [word + " " + " ".join(f"{x:.4f}" for x in vector) for word, vector in vectors.items()]
    (folder / "vectors.txt").write_text("\n".join([f"{len(rows)} {WIDTH}", *rows]))


def run(folder, out, *more, policy="before.safetensors"):
    command = [sys.executable, LEARN / "text_encoder.py", policy, "--sentences", "sentences.jsonl", "--word-vectors",
        "vectors.txt", "--width", str(WIDTH), "--steps", "400", "--bits", "32", "--out", out, *more]  # fmt: skip
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def nearest_object(folder):
    """A function from a sentence to the object whose plain sentence has the nearest vector."""
    network, card = policy_file.load(folder / "reads.safetensors")
    encode = lambda sentence: network.language(torch.tensor([word_indices(sentence, card["vocabulary"]) or [-1]]))[0]  # noqa: E731
    vectors = {name: encode(f"get the {name}") for name in OBJECTS}
    assert encode("").isfinite().all()
    # Only the first words of a long sentence are read.
    assert torch.equal(encode("get the mug" + " please" * 30_000), encode("get the mug" + " please" * 300))
    return lambda sentence: min(vectors, key=lambda name: (encode(sentence) - vectors[name]).norm().item())


def check_best_said(folder):
    """The target of a task in --best-said is the mean over sentences with its words."""
    network, card = policy_file.load(folder / "before.safetensors")
    sentences = text_encoder.read_sentences([folder / "sentences.jsonl"])
    plain, best = (
        text_encoder.SentenceTargets(network, card["vocabulary"], sentences, words)
        for words in (None, {"pick_mug": ["left", "of"]})
    )
    kinds = sorted({kind for kind, _ in sentences})
    mug = kinds.index(("pick_mug", "mug"))
    has = torch.tensor(["left" in words for _, words in sentences])
    expected = network.language(best.rows)[(best.kind == mug) & has].mean(0)
    assert torch.allclose(best.means[mug], expected, atol=1e-6) and not torch.allclose(plain.means[mug], expected, atol=1e-3)
    others = [number for number in range(len(kinds)) if number != mug]
    assert torch.equal(best.means[others], plain.means[others])


def main():
    with tempfile.TemporaryDirectory() as name, torch.no_grad():
        folder = Path(name)
        make(folder)
        done = run(folder, "reads.safetensors")
        assert done.returncode == 0, done.stderr
        find_object = nearest_object(folder)
        for target, other in itertools.permutations(OBJECTS, 2):
            assert find_object(f"take the {target} left of the {other}") == target, (target, other)
        for new, known in NEW.items():
            assert find_object(f"get the {new}") == known, new
        # The rest of the network is unchanged.
        before, after = (policy_file.read(folder / f"{name}.safetensors")[0] for name in ("before", "reads"))
        for name in before:
            if name != "words.weight":
                assert torch.equal(before[name], after[name]), name
        (folder / "number.jsonl").write_text('{"task": "pick_mug", "instruction": 3}')
        (folder / "nan.txt").write_text("mug " + " ".join(["nan"] * WIDTH))
        (folder / "words.txt").write_text("mug " + " ".join(["cup"] * WIDTH))
        (folder / "cut.json").write_text('{"words": ["mug"]')
        for wrong, text in [
            (run(folder, "reads.safetensors"), "it exists"),
            (run(folder, "x.safetensors", policy="reads.safetensors"), "has a text encoder already"),
            (run(folder, "x.safetensors", "--width", "9"), "expected 9"),
            (run(folder, "x.safetensors", "--sentences", "vectors.txt"), "lines of `wheelarm-server --sentences`"),
            (run(folder, "x.safetensors", "--sentences", "number.jsonl"), "number.jsonl:1"),
            (run(folder, "x.safetensors", "--word-vectors", "nan.txt"), "not finite"),
            (run(folder, "x.safetensors", "--word-vectors", "words.txt"), "words.txt: 'mug'"),
            (run(folder, "x.safetensors", "--word-vectors", "cut.json"), "as in wink-embeddings"),
            (run(folder, "x.safetensors", "--layers", "0"), "invalid --layers 0"),
            (run(folder, "nowhere/x.safetensors"), "its folder does not exist"),
            (run(folder, "x.safetensors", "--best-said", "pick_mug=zebra"), "pick_mug mug has the words 'zebra'"),
            (run(folder, "x.safetensors", "--best-said", "zebra=left"), "names zebra"),
        ]:
            assert wrong.returncode == 1 and text in wrong.stderr and "Traceback" not in wrong.stderr, wrong.stderr
        assert "is not TASK=WORDS" in run(folder, "x.safetensors", "--best-said", "zebra").stderr
        check_best_said(folder)
        # A further training starts from the policy before the text encoder, with its word vectors.
        network, card = policy_file.load(folder / "before.safetensors")
        again = Policy(network.shape)
        warm_start.initialize_from(again, folder / "reads.safetensors", card)
        for (name, tensor), (_, expected) in zip(again.state_dict().items(), network.state_dict().items(), strict=True):
            assert name.startswith(policy_file.ONLY_IN_TRAINING) or torch.allclose(tensor, expected, atol=2e-2), name
        state, card = policy_file.read(folder / "reads.safetensors")
        del card["text"]["words"]
        policy_file.write(folder / "old.safetensors", state, card, 32)
        try:
            warm_start.initialize_from(again, folder / "old.safetensors", card)
        except ValueError as error:
            assert "text_encoder.py" in str(error)
        else:
            raise AssertionError("a training started from a policy without its former words")
    print("text encoder: ok")


if __name__ == "__main__":
    main()
