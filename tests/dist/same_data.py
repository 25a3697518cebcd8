"""Fails when the data of two campaigns differs.

    python same_data.py ONE OTHER

Compares every dataset by SHA-256 of its values, and every attribute, of every episode. Values
that differ between runs are excluded: the id of the run, digests and messages that contain it,
and wall time.
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
    # Messages with the run's id in their header.
    "scenario/episode_started",
    "scenario/episode_stopped",
    "streams/applied/message",
    "streams/command/message",
    # Speed of the machine.
    "streams/clock/real_time_factor",
}


def digest(data):
    """SHA-256 of an array's values, texts and bytes of any length included."""
    data = np.asarray(data)
    if data.dtype.kind == "O":
        flat = [item.encode() if isinstance(item, str) else bytes(item) for item in data.ravel()]
        content = repr([len(item) for item in flat]).encode() + b"".join(flat)
    else:
        content = data.tobytes()
    return hashlib.sha256(repr((data.shape, data.dtype.str)).encode() + content).hexdigest()


def contents(path):
    """Hashes of a file's datasets and attributes by name."""
    hashes = {}
    with h5py.File(path) as file:

        def visit(name, item):
            if name in OF_A_RUN:
                return
            if isinstance(item, h5py.Dataset):
                hashes[name] = digest(item[()])
            for key, value in item.attrs.items():
                if key not in OF_A_RUN:
                    hashes[f"{name}@{key}"] = digest(value)

        visit("/", file)
        file.visititems(visit)
    return hashes


one, other = (pathlib.Path(folder) / "episodes" for folder in sys.argv[1:3])
names = sorted(path.name for path in one.glob("*.h5"))
if not names or names != sorted(path.name for path in other.glob("*.h5")):
    sys.exit(f"error: {one} and {other} have different episodes")
differing = []
for name in names:
    left, right = contents(one / name), contents(other / name)
    images = [key for key in left if key.endswith("/rgb")]
    if not images or "streams/state_hash/hash" not in left:
        sys.exit(f"error: {name} lacks images or state hashes: record both")
    wrong = [key for key in sorted(left | right) if left.get(key) != right.get(key)]
    differing += [f"{name}: {key}" for key in wrong]
    print(f"{name}: {len(left)} datasets and attributes, {len(wrong)} differ")
if differing:
    sys.exit("error: the data differs:\n" + "\n".join(differing[:20]))
