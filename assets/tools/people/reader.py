"""Reads the output of make_people.py with numpy and the standard library, for checks and images."""

import json
import pathlib
import struct
import tomllib
from dataclasses import dataclass

import numpy as np

KINDS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TYPES = {5126: "<f4", 5121: "u1", 5123: "<u2"}


def from_gltf(points):
    """From glTF's axes (x left, y up, z forward) to ours (x forward, y left, z up)."""
    return points[..., [2, 0, 1]]


@dataclass
class Asset:
    """One body: mesh at rest, skeleton, weights, and its two TOML files."""

    points: np.ndarray  # (N, 3) m
    normals: np.ndarray  # (N, 3)
    weights: np.ndarray  # (N, joints)
    triangles: np.ndarray  # (T, 3)
    labels: np.ndarray  # (T,) index of `materials`
    materials: list
    joints: list
    parents: list
    rest: np.ndarray  # (joints, 3) m
    inverse_bind: np.ndarray  # (joints, 3): the translations, our axes
    facts: dict
    postures: dict


def load(folder):
    folder = pathlib.Path(folder)
    facts = tomllib.loads((folder / "person.toml").read_text())
    postures = tomllib.loads((folder / "postures.toml").read_text())
    postures = {k: v for k, v in postures.items() if isinstance(v, dict)}
    data = (folder / facts["mesh"]).read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    if (magic, version, length) != (b"glTF", 2, len(data)):
        raise ValueError(f"{folder / facts['mesh']} is not a binary glTF 2.0 file of {len(data)} bytes")
    size, kind = struct.unpack_from("<I4s", data, 12)
    document = json.loads(data[20 : 20 + size])
    blob = data[28 + size :]

    def read(index):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        width = KINDS[accessor["type"]]
        count = accessor["count"] * width
        array = np.frombuffer(blob, TYPES[accessor["componentType"]], count, view["byteOffset"])
        return array.reshape(-1, width) if width > 1 else array

    skin = document["skins"][0]
    nodes = document["nodes"]
    joints = [nodes[k]["name"] for k in skin["joints"]]
    number = {node: k for k, node in enumerate(skin["joints"])}
    parents = [-1] * len(joints)
    for node in skin["joints"]:
        for child in nodes[node].get("children", []):
            parents[number[child]] = number[node]
    rest = np.zeros((len(joints), 3))
    for k, node in enumerate(skin["joints"]):
        if parents[k] >= k:
            raise ValueError(f"joint {joints[k]} is before its parent")
        own = from_gltf(np.array(nodes[node]["translation"]))
        rest[k] = own + (rest[parents[k]] if parents[k] >= 0 else 0)
    primitives = document["meshes"][0]["primitives"]
    at = primitives[0]["attributes"]
    points = from_gltf(read(at["POSITION"]).astype(float))
    steps, of = read(at["WEIGHTS_0"]).astype(float), read(at["JOINTS_0"]).astype(int)
    weights = np.zeros((len(points), len(joints)))
    for k in range(4):
        np.add.at(weights, (np.arange(len(points)), of[:, k]), steps[:, k] / 255)
    triangles, labels = [], []
    for primitive in primitives:
        faces = read(primitive["indices"]).astype(int).reshape(-1, 3)
        triangles.append(faces)
        labels.append(np.full(len(faces), primitive["material"]))
    return Asset(
        points,
        from_gltf(read(at["NORMAL"]).astype(float)),
        weights,
        np.concatenate(triangles),
        np.concatenate(labels),
        [m["name"] for m in document["materials"]],
        joints,
        parents,
        rest,
        from_gltf(read(skin["inverseBindMatrices"]).astype(float)[:, 12:15]),
        facts,
        postures,
    )


def rotation(vector):
    """Rotation matrix of a rotation vector, rad."""
    vector = np.asarray(vector, float)
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 1e-12 else vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def pose(asset, posture, extra={}):
    """Rotations (48, 3, 3) and places (48, 3) of the joints; `extra`: rotation matrices on top, by joint."""
    values = asset.postures[posture] if isinstance(posture, str) else posture
    count = len(asset.joints)
    rotations, at = np.empty((count, 3, 3)), np.empty((count, 3))
    for k, (joint, parent) in enumerate(zip(asset.joints, asset.parents)):
        own = rotation(values["joints"].get(joint, [0.0, 0.0, 0.0])) @ extra.get(joint, np.eye(3))
        if parent < 0:
            rotations[k], at[k] = own, values["root"]
        else:
            rotations[k] = rotations[parent] @ own
            at[k] = at[parent] + rotations[parent] @ (asset.rest[k] - asset.rest[parent])
    return rotations, at


def skin(asset, rotations, at):
    """Vertices (N, 3) and normals (N, 3) moved with the joints."""
    turned = np.einsum("vk,kij->vij", asset.weights, rotations)
    shift = at + np.einsum("kij,kj->ki", rotations, asset.inverse_bind)
    points = np.einsum("vij,vj->vi", turned, asset.points) + asset.weights @ shift
    return points, np.einsum("vij,vj->vi", turned, asset.normals)
