"""Writes a skinned mesh as binary glTF 2.0: one buffer, a primitive for each material."""

import json
import struct

import numpy as np

from rig import NAMES, PARENTS

FLOAT, BYTE, SHORT = 5126, 5121, 5123
ARRAY, ELEMENTS = 34962, 34963


def to_gltf(points):
    """From our axes (x forward, y left, z up) to glTF's (x left, y up, z forward)."""
    return points[..., [1, 2, 0]]


def write_glb(path, name, points, normals, weights, triangles, labels, rest, materials, extras):
    """Writes the file. `materials`: [(name, linear base color, roughness)] by label."""
    blob, views, accessors = bytearray(), [], []

    def add(array, kind, component, target=None, bounds=False):
        while len(blob) % 4:
            blob.append(0)
        view = {"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes}
        if target:
            view["target"] = target
        blob.extend(array.tobytes())
        views.append(view)
        accessor = {
            "bufferView": len(views) - 1,
            "componentType": component,
            "count": len(array) if kind != "SCALAR" else array.size,
            "type": kind,
        }
        if bounds:
            accessor["min"] = [float(v) for v in array.min(axis=0)]
            accessor["max"] = [float(v) for v in array.max(axis=0)]
        accessors.append(accessor)
        return len(accessors) - 1

    order = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    steps = np.rint(np.take_along_axis(weights, order, axis=1) * 255).astype(np.uint8)
    joints = np.where(steps > 0, order, 0).astype(np.uint8)
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    attributes = {
        "POSITION": add(to_gltf(points).astype("<f4"), "VEC3", FLOAT, ARRAY, bounds=True),
        "NORMAL": add(to_gltf(normals).astype("<f4"), "VEC3", FLOAT, ARRAY),
        "JOINTS_0": add(joints, "VEC4", BYTE, ARRAY),
        "WEIGHTS_0": add(steps, "VEC4", BYTE, ARRAY),
    }
    accessors[attributes["WEIGHTS_0"]]["normalized"] = True
    primitives, described = [], []
    for label in np.unique(labels):
        index = add(triangles[labels == label].astype("<u2").ravel(), "SCALAR", SHORT, ELEMENTS)
        material, color, roughness = materials[label]
        described.append(
            {
                "name": material,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [round(float(c), 4) for c in color] + [1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": roughness,
                },
                "doubleSided": True,
            }
        )
        primitives.append(
            {"attributes": attributes, "indices": index, "material": len(described) - 1}
        )
    bind = np.repeat(np.eye(4)[None], len(rest), axis=0)
    # Column-major: the translation is the last row of each transposed matrix.
    bind[:, 3, :3] = -to_gltf(rest)
    binding = add(bind.astype("<f4").reshape(len(rest), 16), "MAT4", FLOAT)
    nodes = []
    for k, joint in enumerate(NAMES):
        parent = PARENTS[k]
        local = rest[k] - (rest[parent] if parent >= 0 else 0)
        node = {"name": joint, "translation": [round(float(v), 6) for v in to_gltf(local)]}
        children = [c for c, p in enumerate(PARENTS) if p == k]
        if children:
            node["children"] = children
        nodes.append(node)
    nodes.append({"name": name, "mesh": 0, "skin": 0})
    document = {
        "asset": {"version": "2.0", "generator": "WheelArm scripts/people", "extras": extras},
        "scene": 0,
        "scenes": [{"nodes": [0, len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": [{"name": name, "primitives": primitives}],
        "skins": [
            {"inverseBindMatrices": binding, "joints": list(range(len(NAMES))), "skeleton": 0}
        ],
        "materials": described,
        "accessors": accessors,
        "bufferViews": views,
    }
    while len(blob) % 4:
        blob.append(0)
    document["buffers"] = [{"byteLength": len(blob)}]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + len(blob)
    with open(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, size))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(blob), b"BIN\0") + bytes(blob))
