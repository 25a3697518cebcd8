"""Checks that two recordings of the same scenario have the same samples, bit for bit.

Usage: equal_streams.py FIRST.h5 SECOND.h5
Compares every dataset below /streams, except those that depend on wall time.
"""

import sys

import h5py
import numpy as np

# Simulated seconds per wall second differ from run to run; raw messages contain the id of the
# run.
WALL = {"real_time_factor", "message"}


def datasets(file):
    found = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset) and name.split("/")[-1] not in WALL:
            found[name] = item

    file["streams"].visititems(visit)
    return found


def main():
    first, second = (h5py.File(path, "r") for path in sys.argv[1:3])
    a, b = datasets(first), datasets(second)
    assert set(a) == set(b), f"datasets differ: {set(a) ^ set(b)}"
    for name in sorted(a):
        x, y = a[name][...], b[name][...]
        assert x.shape == y.shape, f"{name}: shape {x.shape} and {y.shape}"
        # Sequence numbers count from the start of a server, so they are equal too.
        same = (x == y) | ((x != x) & (y != y)) if x.dtype.kind == "f" else x == y
        assert np.all(same), f"{name}: {np.size(same) - np.count_nonzero(same)} values differ"
    print(f"{len(a)} datasets are equal")


if __name__ == "__main__":
    main()
