"""How far a training is: lines for people, `log.jsonl` for programs, and the lock that
keeps a second training out of the folder."""

import fcntl
import json
import sys


class Log:
    """Lines for people on standard output, and for programs in log.jsonl."""

    def __init__(self, folder):
        self.path, self.is_terminal = folder / "log.jsonl", sys.stdout.isatty()

    def say(self, words):
        print(("\r\033[K" if self.is_terminal else "") + words, flush=True)

    def bar(self, step, steps, rate):
        if self.is_terminal:
            done = 30 * step // steps
            print(f"\r{'#' * done}{'.' * (30 - done)} {step} of {steps}, {rate:.0f} pictures/s", end="", flush=True)

    def entries(self):
        lines = self.path.read_text().splitlines() if self.path.exists() else []
        out = []
        for line in lines:
            try:
                out.append(json.loads(line))
            except ValueError:  # cut by an interruption
                continue
        return out

    def add(self, entry):
        with open(self.path, "a") as file:
            file.write(json.dumps(entry) + "\n")

    def cut(self, step):
        """Forgets what came behind the checkpoint."""
        kept = [entry for entry in self.entries() if entry["step"] <= step]
        part = self.path.with_suffix(".part")
        part.write_text("".join(json.dumps(entry) + "\n" for entry in kept))
        part.replace(self.path)


def line(entry, steps):
    parts = " ".join(f"{key} {entry[key]:.4f}" for key in ("l1", "kl", "flow", "aim") if key in entry)
    words = f"step {entry['step']} of {steps}, {entry['seconds']:.0f} s: {parts}"
    if "validation" in entry:
        words += f", held out {entry['validation']:.4f} (first row held {entry['hold_first_row']:.4f})"
    if "aim_metres" in entry:
        words += f", thing missed by {entry['aim_metres']:.3f} m"
    if "asked_metres" in entry:
        words += f", others by {entry['asked_metres']:.3f} m"
    return words + f", {entry['pictures_per_second']} pictures/s"


def locked(folder):
    """The lock of a folder, as long as what is returned is open."""
    lock = open(folder / "lock", "w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ValueError(f"another train.py writes into {folder}: wait for its end, or say another --out") from None
    return lock
