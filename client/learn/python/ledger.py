"""Training ledgers: the seeds, homes, objects and sentences that a policy was trained on, as
`wheelarm evaluate --suite` reads them. A missing kind is undeclared, an empty one unused."""

import hashlib
import json
import re
from pathlib import Path

FORMAT = "wheelarm-ledger/1"
NUMBERS = ("seeds", "appearance_seeds", "specimens")
NAMES = ("homes", "objects", "sentences")


def path_of(policy):
    """The ledger beside a policy."""
    return Path(policy).with_suffix(".ledger.json")


def read(policy):
    """The ledger beside a policy, `None` without one.

    Raises ValueError when it is malformed."""
    path = path_of(policy)
    if not path.exists():
        return None
    try:
        ledger = json.loads(path.read_text())
    except ValueError as error:
        raise ValueError(f"cannot read {path}: {error}; train the policy again, or remove the file") from None
    if not isinstance(ledger, dict) or ledger.get("format") != FORMAT:
        raise ValueError(f"{path} is not a training ledger of the format {FORMAT!r}; remove it, or write it again")
    return ledger


def write(policy, ledger, sha256):
    """Writes the ledger beside a policy, for the weights with this hash; without a ledger removes
    the former one."""
    path = path_of(policy)
    if ledger is None:
        path.unlink(missing_ok=True)
        return
    path.write_text(json.dumps({**ledger, "format": FORMAT, "policy": sha256}) + "\n")


def merge(ledgers):
    """The ledger of a training on all of them. `None` stands for unknown content: the result then
    declares nothing."""
    ledgers = list(ledgers)
    out = {"format": FORMAT}
    for kind in (*NUMBERS, *NAMES):
        parts = [(ledger or {}).get(kind) for ledger in ledgers]
        if any(part is None for part in parts):
            continue
        if kind in NAMES:
            out[kind] = sorted({name for part in parts for name in part})
        else:
            out[kind] = ranges({n for part in parts for first, last in part for n in range(first, last + 1)})
    return out


def from_seeds(seeds):
    """The ledger of a policy of which the seeds alone are known."""
    return {"format": FORMAT, "seeds": ranges(set(seeds))}


def with_sentences(ledger, sentences):
    """The ledger after a training on more sentences."""
    if ledger is None or "sentences" not in ledger:
        return ledger
    return {**ledger, "sentences": sorted({*ledger["sentences"], *map(sentence, sentences)})}


def sentence(text):
    """Identity of a sentence, as `wheelarm_policy::ledger` computes it."""
    words = " ".join(re.findall(r"[^\W_]+", text.lower()))
    return hashlib.sha256(words.encode()).hexdigest()[:16]


def ranges(numbers):
    """Consecutive numbers as pairs, first and last."""
    out = []
    for number in sorted(numbers):
        if out and out[-1][1] + 1 == number:
            out[-1][1] = number
        else:
            out.append([number, number])
    return out
