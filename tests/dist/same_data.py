"""Fails where two campaigns hold other data.

    python same_data.py ONE OTHER

Compares every dataset by SHA-256 of its values and every attribute of every
episode. Left out is what tells a run from another: its id, what is digested or
encoded together with that id, and wall time.
"""

import hashlib
import pathlib
import sys

import h5py
import numpy as np

OF_A_RUN = {
    "run_id",
    "wall_seconds",
    "digest",
    "digest_published",
    # Encoded with the run's id in their header.
    "scenario/episode_started",
    "scenario/episode_stopped",
    "streams/applied/message",
    "streams/command/message",
    # How fast the machine was.
    "streams/clock/real_time_factor",
}


def values(data):
    """SHA-256 of an array's values, texts and bytes of any length included."""
    data = np.asarray(data)
    if data.dtype.kind == "O":
        flat = [item.encode() if isinstance(item, str) else bytes(item) for item in data.ravel()]
        told = repr([len(item) for item in flat]).encode() + b"".join(flat)
    else:
        told = data.tobytes()
    return hashlib.sha256(repr((data.shape, data.dtype.str)).encode() + told).hexdigest()


def contents(path):
    """Hashes of a file's datasets and attributes by name."""
    told = {}
    with h5py.File(path) as file:

        def visit(name, item):
            if name in OF_A_RUN:
                return
            if isinstance(item, h5py.Dataset):
                told[name] = values(item[()])
            for key, value in item.attrs.items():
                if key not in OF_A_RUN:
                    told[f"{name}@{key}"] = values(value)

        visit("/", file)
        file.visititems(visit)
    return told


one, other = (pathlib.Path(folder) / "episodes" for folder in sys.argv[1:3])
names = sorted(path.name for path in one.glob("*.h5"))
if not names or names != sorted(path.name for path in other.glob("*.h5")):
    sys.exit(f"error: {one} and {other} do not hold the same episodes")
differing = []
for name in names:
    left, right = contents(one / name), contents(other / name)
    pictures = [key for key in left if key.endswith("/rgb")]
    if not pictures or "streams/state_hash/hash" not in left:
        sys.exit(f"error: {name} holds no pictures or no state hashes: nothing would be compared")
    wrong = [key for key in sorted(left | right) if left.get(key) != right.get(key)]
    differing += [f"{name}: {key}" for key in wrong]
    print(f"{name}: {len(left)} datasets and attributes, {len(wrong)} differ")
if differing:
    sys.exit("error: other data:\n" + "\n".join(differing[:20]))
