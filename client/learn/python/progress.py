"""Progress of a training: lines for users, `log.jsonl` for programs, and the lock that prevents a
second training in the folder."""

import fcntl
import json
import sys


class Log:
    """Lines for users on standard output, and for programs in log.jsonl."""

    def __init__(self, folder):
        self.path, self.is_terminal = folder / "log.jsonl", sys.stdout.isatty()

    def report(self, text):
        print(("\r\033[K" if self.is_terminal else "") + text, flush=True)

    def show_bar(self, step, steps, rate):
        if self.is_terminal:
            done = 30 * step // steps
            print(f"\r{'#' * done}{'.' * (30 - done)} {step} of {steps}, {rate:.0f} images/s", end="", flush=True)

    def entries(self):
        lines = self.path.read_text().splitlines() if self.path.exists() else []
        out = []
        for line in lines:
            try:
                out.append(json.loads(line))
            except ValueError:  # truncated by an interruption
                continue
        return out

    def add(self, entry):
        with open(self.path, "a") as file:
            file.write(json.dumps(entry) + "\n")

    def truncate(self, step):
        """Deletes the entries after the checkpoint."""
        kept = [entry for entry in self.entries() if entry["step"] <= step]
        part = self.path.with_suffix(".part")
        part.write_text("".join(json.dumps(entry) + "\n" for entry in kept))
        part.replace(self.path)


def summarize(entry, steps):
    """An entry of the log as one line."""
    parts = " ".join(f"{key} {entry[key]:.4f}" for key in ("l1", "kl", "flow", "aim") if key in entry)
    text = f"step {entry['step']} of {steps}, {entry['seconds']:.0f} s: {parts}"
    if "validation" in entry:
        text += f", held out {entry['validation']:.4f} (first row held {entry['hold_first_row']:.4f})"
    if "aim_metres" in entry:
        text += f", error of the object {entry['aim_metres']:.3f} m"
    if "asked_metres" in entry:
        text += f", of other objects {entry['asked_metres']:.3f} m"
    return text + f", {entry['pictures_per_second']} images/s"


def lock_folder(folder):
    """Locks a folder until the returned file is closed.

    Raises ValueError when another process holds the lock."""
    lock = open(folder / "lock", "w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ValueError(f"cannot lock {folder}: another train.py uses it; wait for its end, or choose another --out") from None
    return lock
