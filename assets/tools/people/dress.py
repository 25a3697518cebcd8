"""Skin, hair, clothes and eyes on a body, with one topology for all bodies.

The body under the clothes is left out. The clothes are MakeHuman's shell `tights` pushed
outwards, hair is the scalp pushed outwards, and long hair also the shell `hair`.
"""

from dataclasses import dataclass

import numpy as np

from rig import FINGERS, INDEX, NAMES, forward, from_vector, places, skin
from shape import make_body
from simplify import simplify_mesh
from source import BODY_VERTICES

MATERIALS = [
    "skin",
    "lips",
    "mouth",
    "brows",
    "hair",
    "shirt",
    "sleeves",
    "trousers",
    "shoes",
    "eye_white",
    "iris",
]
MATERIAL = {name: k for k, name in enumerate(MATERIALS)}
# Triangles that each part may have after simplification. [choice: 6,000 in all]
BUDGET = {
    "head": 1750,
    "left_hand": 520,
    "right_hand": 520,
    "clothes": 2150,
    "scalp": 330,
    "long_hair": 260,
    "eyes": 150,
}
# A vertex inside the mouth, behind the upper lip.
INSIDE_MOUTH = 588
# Outward offset of clothes from their shell, m; the shell is 8 mm from the skin. [choice]
SHIRT, TROUSERS, SHOES = 0.003, 0.002, 0.006
HAIR = {"cropped": 0.004, "short": 0.013, "long": 0.016, "bun": 0.012}


@dataclass
class Part:
    """A part of the surface: triangles over the vertices of the source, pushed out along the normals."""

    name: str
    triangles: np.ndarray
    labels: np.ndarray
    # Outwards along the piece's own vertex normals, m, by source vertex.
    offset: np.ndarray


def normals(points, triangles):
    """Vertex normals (N, 3), weighted by area; zero for vertices without triangle."""
    face = np.cross(
        points[triangles[:, 1]] - points[triangles[:, 0]],
        points[triangles[:, 2]] - points[triangles[:, 0]],
    )
    out = np.zeros_like(points)
    for k in range(3):
        np.add.at(out, triangles[:, k], face)
    return out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]


class Wardrobe:
    """Clothes, hair and eyes of all bodies, computed on a reference body and simplified once."""

    def __init__(self, source, table):
        self.source, self.table = source, table
        reference = {"sex": "male", "age": 0.72}
        self.reference = make_body(source, reference, 0.6, 0.4)
        self.parts = self._parts()
        self._simplify()

    def _parts(self):
        source, reference = self.source, self.reference
        joints = dict(zip(NAMES, places(source, reference)))
        main = np.array(NAMES)[self.table.argmax(axis=1)]
        body = source.triangles("body")
        count = len(reference)
        none = np.zeros(count)

        def of(*names):
            return np.isin(main, names)

        def hand(side):
            return np.array([n.startswith(side) and _is_hand(n) for n in main])

        # Head and neck.
        head = of("head", "jaw", "neck_1", "neck_2")
        triangles = body[_whole(head[body].any(axis=1))]
        parts = [Part("head", triangles, self._face_labels(triangles), none)]
        for side in ("left", "right"):
            triangles = body[_whole(hand(side)[body].any(axis=1))]
            labels = np.full(len(triangles), MATERIAL["skin"])
            parts.append(Part(f"{side}_hand", triangles, labels, none))
        # Clothes.
        triangles = source.triangles("helper-tights")
        middle = _middle(reference, triangles)
        waist = joints["spine_1"][2] + 0.015
        ankle = joints["left_foot"][2] + 0.02
        labels = np.full(len(triangles), MATERIAL["shirt"])
        arms = of(*(n for n in NAMES if "forearm" in n or _is_hand(n)))
        labels[_whole(arms[triangles].sum(axis=1) >= 2)] = MATERIAL["sleeves"]
        elbow = np.abs(joints["left_forearm"][1])
        low = (middle[:, 2] < waist) & (np.abs(middle[:, 1]) < elbow)
        labels[low & (labels == MATERIAL["shirt"])] = MATERIAL["trousers"]
        labels[middle[:, 2] < ankle] = MATERIAL["shoes"]
        offset = np.zeros(count)
        for name, out in (("shirt", SHIRT), ("sleeves", SHIRT), ("trousers", TROUSERS), ("shoes", SHOES)):
            offset[triangles[labels == MATERIAL[name]]] = out
        # The shirt hangs over the trousers.
        offset[triangles[labels == MATERIAL["shirt"]]] = SHIRT
        parts.append(Part("clothes", triangles, labels, offset))
        # Hair.
        scalp = self._scalp()
        inside = _whole(scalp[body].sum(axis=1) >= 2)
        triangles = body[inside]
        rim = np.intersect1d(triangles, body[~inside])
        offset = np.zeros(count)
        offset[np.unique(triangles)] = 1.0
        offset[rim] = 0.15
        hair = np.full(len(triangles), MATERIAL["hair"])
        parts.append(Part("scalp", triangles, hair, offset))
        triangles = source.triangles("helper-hair")
        chin = joints["head"][2]
        middle = _middle(reference, triangles)
        # To the shoulders, and not before the face.
        triangles = triangles[(middle[:, 2] > chin - 0.06) & (middle[:, 0] < self.eye[0] - 0.062)]
        parts.append(Part("long_hair", triangles, np.full(len(triangles), MATERIAL["hair"]), none))
        # Eyes.
        triangles = source.triangles("helper-l-eye", "helper-r-eye")
        labels = np.full(len(triangles), MATERIAL["eye_white"])
        for group in ("helper-l-eye", "helper-r-eye"):
            own = np.unique(source.triangles(group))
            middle = reference[own].mean(axis=0)
            front = reference[own][:, 0].max()
            near = np.linalg.norm((reference[triangles] - middle)[:, :, 1:], axis=2) < 0.0068
            ahead = reference[triangles][:, :, 0] > middle[0] + 0.3 * (front - middle[0])
            labels[(near & ahead).all(axis=1)] = MATERIAL["iris"]
        parts.append(Part("eyes", triangles, labels, none))
        return parts

    def _face_labels(self, triangles):
        reference, source = self.reference, self.source
        labels = np.full(len(triangles), MATERIAL["skin"])
        jaw = source.place(source.bones["jaw"]["head"], reference)
        self.eye = reference[np.unique(source.triangles("helper-l-eye"))].mean(axis=0)
        x, y, z = (_middle(reference, triangles) - jaw).T
        y = np.abs(y)
        # Positions on the reference body, m, relative to the jaw joint.
        lips = ((y / 0.028) ** 2 + ((z + 0.0425) / 0.0120) ** 2 < 1) & (x > 0.0955 - 12 * y**2)
        labels[lips] = MATERIAL["lips"]
        # The inside of the mouth: the connected triangles behind the lips.
        region = (y < 0.037) & (z > -0.08) & (z < 0.012) & ~lips & (x < 0.0975)
        inside = {INSIDE_MOUTH}
        grown = True
        while grown:
            touched = region & np.isin(triangles, list(inside)).any(axis=1)
            before = len(inside)
            inside |= set(triangles[touched].ravel().tolist())
            grown = len(inside) > before
        labels[touched] = MATERIAL["mouth"]
        arch = 0.0545 - 0.25 * np.maximum(y - 0.034, 0)
        brows = (np.abs(z - arch) < 0.0038) & (y > 0.012) & (y < 0.050) & (x > 0.06)
        labels[brows] = MATERIAL["brows"]
        return labels

    def _scalp(self):
        reference, source = self.reference, self.source
        main = self.table.argmax(axis=1)
        head = np.isin(main, [INDEX["head"], INDEX["jaw"], INDEX["neck_1"], INDEX["neck_2"]])
        head[BODY_VERTICES:] = False
        eyes = reference[np.unique(source.triangles("helper-l-eye", "helper-r-eye"))].mean(axis=0)
        top = reference[head]
        above = (reference - (eyes + [0.005, 0, 0.055])) @ np.array([-0.714, 0, 0.70])
        chosen = head & (above > 0) & (reference[:, 2] > eyes[2] - 0.055)
        wide = np.percentile(np.abs(top[top[:, 2] > eyes[2] + 0.03][:, 1]), 96) + 0.004
        ears = head & (np.abs(reference[:, 1]) > wide) & (reference[:, 2] < eyes[2] + 0.035)
        return chosen & ~ears

    def _simplify(self):
        """Simplifies each part once, with the error of three bodies at rest and seated."""
        source = self.source
        bodies = [
            self.reference,
            make_body(source, {"sex": "female", "age": 0.7}, 0.9, 0.3),
            make_body(source, {"sex": "male", "age": 0.8}, 1.0, 0.5, 1.3),
        ]
        at_rest = [self._push(v) for v in bodies]
        for part in self.parts:
            shapes = []
            for vertices, moved_out in zip(bodies, at_rest):
                points = moved_out[part.name]
                rest = places(source, vertices)
                rotations, at = forward(rest, rest[0], _trial_turns())
                shapes += [points, skin(points, self.table, rest, rotations, at)]
            used = np.unique(part.triangles)
            renumber = np.full(len(self.reference), -1)
            renumber[used] = np.arange(len(used))
            triangles, labels = simplify_mesh(
                np.array(shapes)[:, used],
                renumber[part.triangles],
                part.labels,
                BUDGET[part.name],
                self._importance(part)[used],
            )
            part.simple, part.simple_labels = used[triangles], labels

    def _importance(self, part):
        """Weight of the simplification error per vertex; higher on the face."""
        out = np.ones(len(self.reference))
        if part.name == "head":
            face = self.reference[:, 0] > self.eye[0] - 0.045
            out[face] = 6.0
            neck = np.isin(self.table.argmax(1), [INDEX["neck_1"], INDEX["neck_2"]])
            out[neck] = 0.5
        return out

    def _push(self, vertices, hair=0.013):
        """Vertices of each part of a dressed body at rest, {name: (N, 3)}."""
        out = {}
        for part in self.parts:
            normal = normals(vertices, part.triangles)
            offset = part.offset * (hair if part.name == "scalp" else 1.0)
            out[part.name] = vertices + normal * offset[:, None]
        return out

    def dress(self, vertices, hair):
        """Mesh of a dressed body at rest: vertices, normals, source vertices, triangles, labels."""
        moved_out = self._push(vertices, HAIR[hair])
        points, directions, origin, triangles, labels = [], [], [], [], []
        start = 0
        for part in self.parts:
            if part.name == "long_hair" and hair != "long":
                continue
            used = np.unique(part.simple)
            renumber = np.full(len(vertices), -1)
            renumber[used] = np.arange(len(used)) + start
            start += len(used)
            points.append(moved_out[part.name][used])
            directions.append(normals(moved_out[part.name], part.triangles)[used])
            origin.append(used)
            triangles.append(renumber[part.simple])
            labels.append(part.simple_labels)
        return tuple(np.concatenate(x) for x in (points, directions, origin, triangles, labels))


def _middle(points, triangles):
    """Middle of each triangle's quad, (T, 3); triangles are in pairs."""
    return points[triangles].mean(axis=1).reshape(-1, 2, 3).mean(axis=1).repeat(2, axis=0)


def _whole(chosen):
    """The chosen triangles and the other halves of their quads."""
    return chosen.reshape(-1, 2).any(axis=1).repeat(2)


def _is_hand(name):
    return bool({"hand", *FINGERS} & set(name.split("_")))


def _trial_turns():
    """A rough seated posture with bent fingers and an open mouth, for the simplification error."""
    turns = np.repeat(np.eye(3)[None], len(NAMES), axis=0)
    for side, sign in (("left", 1), ("right", -1)):
        turns[INDEX[f"{side}_thigh"]] = from_vector([0, np.radians(-85), 0])
        turns[INDEX[f"{side}_shank"]] = from_vector([0, np.radians(85), 0])
        turns[INDEX[f"{side}_upper_arm"]] = from_vector([np.radians(-30 * sign), 0, 0])
        turns[INDEX[f"{side}_forearm"]] = from_vector([0, np.radians(-70), 0])
        for finger in ("index", "middle", "ring", "little"):
            for k in (1, 2):
                turns[INDEX[f"{side}_{finger}_{k}"]] = from_vector([np.radians(-35 * sign), 0, 0])
    turns[INDEX["jaw"]] = from_vector([0, np.radians(18), 0])
    return turns
