"""The skeleton of a person: 48 joints made of MakeHuman's 163 bones, weights and posing.

At rest every joint has the axes of the person (x forward, y left, z up), so a joint has
a position and no rotation. A posture rotates joints; `skin` moves vertices with them by
linear blend skinning.
"""

import numpy as np

FINGERS = ["thumb", "index", "middle", "ring", "little"]


def _joints():
    """(name, parent, bones whose weights it gets, bone whose head is its position)."""
    rows = [
        ("pelvis", None, ["root", "pelvis.L", "pelvis.R"], "root"),
        ("spine_1", "pelvis", ["spine05"], "spine05"),
        ("spine_2", "spine_1", ["spine04"], "spine04"),
        ("spine_3", "spine_2", ["spine03"], "spine03"),
        ("spine_4", "spine_3", ["spine02", "breast.L", "breast.R"], "spine02"),
        ("spine_5", "spine_4", ["spine01"], "spine01"),
        ("neck_1", "spine_5", ["neck01", "neck02"], "neck01"),
        ("neck_2", "neck_1", ["neck03"], "neck03"),
        ("head", "neck_2", ["head"], "head"),
        ("jaw", "head", ["jaw"], "jaw"),
    ]
    for side, s in (("left", "L"), ("right", "R")):
        rows += [
            (f"{side}_clavicle", "spine_5", [f"clavicle.{s}", f"shoulder01.{s}"], f"clavicle.{s}"),
            (f"{side}_upper_arm", f"{side}_clavicle", [f"upperarm01.{s}"], f"upperarm01.{s}"),
            (
                f"{side}_upper_arm_turn",
                f"{side}_upper_arm",
                [f"upperarm02.{s}"],
                f"upperarm02.{s}",
            ),
            (f"{side}_forearm", f"{side}_upper_arm_turn", [f"lowerarm01.{s}"], f"lowerarm01.{s}"),
            (f"{side}_forearm_turn", f"{side}_forearm", [f"lowerarm02.{s}"], f"lowerarm02.{s}"),
            (
                f"{side}_hand",
                f"{side}_forearm_turn",
                [f"wrist.{s}"] + [f"metacarpal{k}.{s}" for k in range(1, 5)],
                f"wrist.{s}",
            ),
        ]
        for k, finger in enumerate(FINGERS, start=1):
            near, far = f"{side}_{finger}_1", f"{side}_{finger}_2"
            rows += [
                (near, f"{side}_hand", [f"finger{k}-1.{s}"], f"finger{k}-1.{s}"),
                (far, near, [f"finger{k}-2.{s}", f"finger{k}-3.{s}"], f"finger{k}-2.{s}"),
            ]
        rows += [
            (
                f"{side}_thigh",
                "pelvis",
                [f"upperleg01.{s}", f"upperleg02.{s}"],
                f"upperleg01.{s}",
            ),
            (
                f"{side}_shank",
                f"{side}_thigh",
                [f"lowerleg01.{s}", f"lowerleg02.{s}"],
                f"lowerleg01.{s}",
            ),
            (f"{side}_foot", f"{side}_shank", [f"foot.{s}"], f"foot.{s}"),
        ]
    return rows


ROWS = _joints()
NAMES = [row[0] for row in ROWS]
INDEX = {name: k for k, name in enumerate(NAMES)}
PARENTS = [-1 if row[1] is None else INDEX[row[1]] for row in ROWS]
# Joints that hang from each joint, itself included.
BELOW = [[] for _ in NAMES]
for _k in range(len(NAMES)):
    _j = _k
    while _j >= 0:
        BELOW[_j].append(_k)
        _j = PARENTS[_j]


def weights(source):
    """Weights (N, 48) of all vertices: at most four joints each, multiples of 1/255, sum 1."""
    joint_of = {bone: k for k, row in enumerate(ROWS) for bone in row[2]}

    def joint(bone):
        while bone not in joint_of:
            bone = source.bones[bone]["parent"]
        return joint_of[bone]

    table = np.zeros((len(source.vertices), len(ROWS)))
    for bone, pairs in source.bone_weights.items():
        if bone in source.bones:
            for vertex, weight in pairs:
                table[vertex, joint(bone)] += weight
    bare = table.sum(axis=1) == 0
    table[bare, INDEX["head"]] = 1.0
    return four(table)


def four(table):
    """The four greatest weights of each row, rounded to multiples of 1/255 with sum 1."""
    table = table.copy()
    order = np.argsort(-table, axis=1, kind="stable")
    np.put_along_axis(table, order[:, 4:], 0.0, axis=1)
    table /= table.sum(axis=1, keepdims=True)
    steps = np.floor(table * 255)
    # The remainder is added to the greatest.
    steps[np.arange(len(steps)), order[:, 0]] += 255 - steps.sum(axis=1)
    return steps / 255


def places(source, vertices):
    """Positions of the joints of a shaped mesh, (48, 3) m."""
    return np.array([source.place(source.bones[row[3]]["head"], vertices) for row in ROWS])


def tip(source, vertices, bone):
    """The far end of a bone, (3,) m."""
    return source.place(source.bones[bone]["tail"], vertices)


def forward(rest, root, turns):
    """World rotations (48, 3, 3) and places (48, 3) of the joints.

    `rest`: places at rest; `root`: position of the pelvis; `turns`: rotation of each
    joint against its parent (48, 3, 3).
    """
    rotations, at = np.empty((len(rest), 3, 3)), np.empty((len(rest), 3))
    for k, parent in enumerate(PARENTS):
        if parent < 0:
            rotations[k], at[k] = turns[k], root
        else:
            rotations[k] = rotations[parent] @ turns[k]
            at[k] = at[parent] + rotations[parent] @ (rest[k] - rest[parent])
    return rotations, at


def skin(vertices, table, rest, rotations, at):
    """Vertices (N, 3) moved with the joints; `table` holds their weights (N, 48)."""
    shift = at - np.einsum("kij,kj->ki", rotations, rest)
    out = np.zeros_like(vertices)
    for k in range(len(rest)):
        of = np.nonzero(table[:, k])[0]
        if len(of):
            moved = vertices[of] @ rotations[k].T + shift[k]
            out[of] += table[of, k][:, None] * moved
    return out


def from_vector(vector):
    """Rotation matrix of a rotation vector (axis times angle, rad)."""
    vector = np.asarray(vector, float)
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 1e-12 else vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def to_vector(matrix):
    """Rotation vector of a rotation matrix."""
    cos = np.clip((np.trace(matrix) - 1) / 2, -1, 1)
    axis = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    sin = np.linalg.norm(axis) / 2
    angle = float(np.arctan2(sin, cos))
    if sin < 1e-9:
        if cos > 0:
            return np.zeros(3)
        # Half a turn: the axis is the greatest column of matrix + 1.
        columns = matrix + np.eye(3)
        column = columns[:, np.argmax(np.diag(columns))]
        return np.pi * column / np.linalg.norm(column)
    return axis / (2 * sin) * angle


def turn(axis, degrees):
    """Rotation matrix about a unit axis."""
    return from_vector(np.asarray(axis, float) * np.radians(degrees))


def between(a, b):
    """The smallest rotation from direction `a` to direction `b`."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cos = np.cross(a, b), float(a @ b)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + cos)
