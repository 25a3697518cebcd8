"""A policy is taught to read by `client/learn/python/text_encoder.py`: what no training
had is told by its vector, order counts, and what cannot be used is refused in words.

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

import begin
import policy_file
import text_encoder
from episodes import indices
from network import Policy, Shape

THINGS = ("mug", "bowl", "bottle")
NEW = {"beaker": "mug", "basin": "bowl", "flask": "bottle"}  # whose vectors are near
WIDTH = 12


def make(folder):
    """A policy with random weights that knows THINGS, sentences, and vectors of words."""
    torch.manual_seed(3)
    vocabulary = ["<unknown>", *sorted({"get", "take", "the", "left", "of", *THINGS})]
    shape = Shape(words=len(vocabulary), word_width=16, width=2, group_channels=1, dim=16, feedforward=8, heads=2,
        encoder_layers=1, vae_layers=1, film=True, state=3, action=2)  # fmt: skip
    network = Policy(shape)
    for layer in network.model.film:
        torch.nn.init.normal_(layer.weight, std=0.3)
    numbers = lambda count: {"mean": [0.0] * count, "std": [1.0] * count}  # noqa: E731
    card = {
        "name": "small", "network": shape.told(), "vocabulary": vocabulary, "training_seeds": [1],
        "state": {"names": ["a", "b", "c"], "hidden": [], **numbers(3)}, "action": {"names": ["d", "e"], **numbers(2)},
    }  # fmt: skip
    policy_file.write(folder / "before.safetensors", network.state_dict(), card, 32)
    lines = []
    for verb, (thing, other) in itertools.product(("get", "take"), itertools.permutations(THINGS, 2)):
        for told in (f"{verb} the {thing}", f"{verb} the {thing} left of the {other}"):
            lines += [json.dumps({"task": f"pick_{thing}", "target": thing, "seed": 1, "instruction": told})] * 4
    (folder / "sentences.jsonl").write_text("\n".join(lines))
    random = np.random.default_rng(5)
    vectors = {word: random.normal(size=WIDTH) for word in ("get", "take", "the", "left", "of", *THINGS)}
    vectors |= {new: vectors[known] + 0.25 * random.normal(size=WIDTH) for new, known in NEW.items()}
    rows = [word + " " + " ".join(f"{x:.4f}" for x in vector) for word, vector in vectors.items()]
    (folder / "vectors.txt").write_text("\n".join([f"{len(rows)} {WIDTH}", *rows]))


def run(folder, out, *more, policy="before.safetensors"):
    command = [sys.executable, LEARN / "text_encoder.py", policy, "--sentences", "sentences.jsonl", "--word-vectors",
        "vectors.txt", "--width", str(WIDTH), "--steps", "400", "--bits", "32", "--out", out, *more]  # fmt: skip
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def nearest(folder):
    """Who is asked for, by the language vector that is nearest to that of the plain sentence."""
    network, card = policy_file.load(folder / "reads.safetensors")
    ask = lambda told: network.language(torch.tensor([indices(told, card["vocabulary"]) or [-1]]))[0]  # noqa: E731
    means = {thing: ask(f"get the {thing}") for thing in THINGS}
    assert ask("").isfinite().all()
    # Of a sentence without end the beginning is read.
    assert torch.equal(ask("get the mug" + " please" * 30_000), ask("get the mug" + " please" * 300))
    return lambda told: min(means, key=lambda thing: (ask(told) - means[thing]).norm().item())


def check_best_said(folder):
    """What is best said by certain words is answered as sentences with these are."""
    network, card = policy_file.load(folder / "before.safetensors")
    sentences = text_encoder.read_sentences([folder / "sentences.jsonl"])
    plain, best = (
        text_encoder.Lesson(network, card["vocabulary"], sentences, told) for told in (None, {"pick_mug": ["left", "of"]})
    )
    kinds = sorted({kind for kind, _ in sentences})
    mug = kinds.index(("pick_mug", "mug"))
    has = torch.tensor(["left" in words for _, words in sentences])
    wanted = network.language(best.rows)[(best.kind == mug) & has].mean(0)
    assert torch.allclose(best.means[mug], wanted, atol=1e-6) and not torch.allclose(plain.means[mug], wanted, atol=1e-3)
    others = [number for number in range(len(kinds)) if number != mug]
    assert torch.equal(best.means[others], plain.means[others])


def main():
    with tempfile.TemporaryDirectory() as name, torch.no_grad():
        folder = Path(name)
        make(folder)
        told = run(folder, "reads.safetensors")
        assert told.returncode == 0, told.stderr
        asked = nearest(folder)
        for thing, other in itertools.permutations(THINGS, 2):
            assert asked(f"take the {thing} left of the {other}") == thing, (thing, other)
        for new, known in NEW.items():
            assert asked(f"get the {new}") == known, new
        # The rest of the network is as it was.
        before, after = (policy_file.read(folder / f"{name}.safetensors")[0] for name in ("before", "reads"))
        for name in before:
            if name != "words.weight":
                assert torch.equal(before[name], after[name]), name
        (folder / "number.jsonl").write_text('{"task": "pick_mug", "instruction": 3}')
        (folder / "nan.txt").write_text("mug " + " ".join(["nan"] * WIDTH))
        (folder / "words.txt").write_text("mug " + " ".join(["cup"] * WIDTH))
        (folder / "cut.json").write_text('{"words": ["mug"]')
        for wrong, words in [
            (run(folder, "reads.safetensors"), "exists already"),
            (run(folder, "x.safetensors", policy="reads.safetensors"), "has a text encoder already"),
            (run(folder, "x.safetensors", "--width", "9"), "expected 9"),
            (run(folder, "x.safetensors", "--sentences", "vectors.txt"), "--sentences` prints"),
            (run(folder, "x.safetensors", "--sentences", "number.jsonl"), "number.jsonl:1"),
            (run(folder, "x.safetensors", "--word-vectors", "nan.txt"), "not finite"),
            (run(folder, "x.safetensors", "--word-vectors", "words.txt"), "words.txt: 'mug'"),
            (run(folder, "x.safetensors", "--word-vectors", "cut.json"), "as wink's has"),
            (run(folder, "x.safetensors", "--layers", "0"), "--layers is 0"),
            (run(folder, "nowhere/x.safetensors"), "there is no folder"),
            (run(folder, "x.safetensors", "--best-said", "pick_mug=zebra"), "pick_mug mug has the words 'zebra'"),
            (run(folder, "x.safetensors", "--best-said", "zebra=left"), "names zebra"),
        ]:
            assert wrong.returncode == 1 and words in wrong.stderr and "Traceback" not in wrong.stderr, wrong.stderr
        assert "is not TASK=WORDS" in run(folder, "x.safetensors", "--best-said", "zebra").stderr
        check_best_said(folder)
        # A further training begins with what it was before, the mean of its words too.
        network, card = policy_file.load(folder / "before.safetensors")
        again = Policy(network.shape)
        begin.begin_from(again, folder / "reads.safetensors", card)
        for (name, tensor), (_, wanted) in zip(again.state_dict().items(), network.state_dict().items(), strict=True):
            assert name.startswith(policy_file.ONLY_IN_TRAINING) or torch.allclose(tensor, wanted, atol=2e-2), name
        state, card = policy_file.read(folder / "reads.safetensors")
        del card["text"]["words"]
        policy_file.write(folder / "old.safetensors", state, card, 32)
        try:
            begin.begin_from(again, folder / "old.safetensors", card)
        except ValueError as problem:
            assert "text_encoder.py" in str(problem)
        else:
            raise AssertionError("a training began from a policy that does not tell its words")
    print("text encoder: ok")


if __name__ == "__main__":
    main()
