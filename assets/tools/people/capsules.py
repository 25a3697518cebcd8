"""Capsules around the parts of a body, fitted to its seated, dressed mesh."""

import numpy as np

from rig import FINGERS, INDEX

# How much more a vertex outside its capsule counts than one inside. [choice]
OUTSIDE = 6.0


def rows():
    """(part, its joint, joints whose vertices it is fitted to, selection of the vertices)."""
    out = [
        ("head", "head", ["head"], "upper"),
        ("face", "head", ["head", "jaw"], "lower"),
        ("neck", "neck_1", ["neck_1", "neck_2"], "all"),
        ("shoulders", "spine_5", ["spine_5", "left_clavicle", "right_clavicle"], "across"),
        ("chest", "spine_4", ["spine_4"], "across"),
        ("waist", "spine_3", ["spine_3"], "across"),
        ("belly", "spine_2", ["spine_1", "spine_2"], "across"),
        ("pelvis", "pelvis", ["pelvis"], "across"),
    ]
    for side in ("left", "right"):
        fingers = [f"{side}_{f}_{k}" for f in FINGERS[1:] for k in (1, 2)]
        out += [
            (f"{side}_upper_arm", f"{side}_upper_arm", [f"{side}_upper_arm", f"{side}_upper_arm_turn"], "all"),
            (f"{side}_forearm", f"{side}_forearm", [f"{side}_forearm", f"{side}_forearm_turn"], "all"),
            (f"{side}_hand", f"{side}_hand", [f"{side}_hand"], "all"),
            (f"{side}_index", f"{side}_index_1", [f for f in fingers if "index" in f or "middle" in f], "all"),
            (f"{side}_little", f"{side}_little_1", [f for f in fingers if "ring" in f or "little" in f], "all"),
            (f"{side}_thumb", f"{side}_thumb_1", [f"{side}_thumb_1", f"{side}_thumb_2"], "all"),
            (f"{side}_hip", f"{side}_thigh", [f"{side}_thigh"], "near"),
            (f"{side}_thigh", f"{side}_thigh", [f"{side}_thigh"], "far"),
            (f"{side}_shank", f"{side}_shank", [f"{side}_shank"], "all"),
            (f"{side}_foot", f"{side}_foot", [f"{side}_foot"], "all"),
        ]
    return out


def distance(points, a, b, radius):
    """Distance (N,) of points from the surface of a capsule, m; negative inside."""
    along = b - a
    t = np.clip((points - a) @ along / max(along @ along, 1e-12), 0, 1)
    return np.linalg.norm(points - a - t[:, None] * along, axis=1) - radius


def fit_capsule(points, across=False):
    """Ends and radius of a capsule near points (N, 3); `across`: parallel to y, symmetric."""
    if across:
        points = np.concatenate([points, points * [1, -1, 1]])
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    axis = np.array([0.0, 1.0, 0.0]) if across else axes[0]
    s = (points - middle) @ axis
    radius = np.median(np.linalg.norm(points - middle - s[:, None] * axis, axis=1))
    half = max((s.max() - s.min()) / 2 - radius, 0.005)
    middle = middle + axis * (s.max() + s.min()) / 2
    a, b = middle - axis * half, middle + axis * half
    damping = 1e-3
    cost = None
    for _ in range(60):
        along = b - a
        t = np.clip((points - a) @ along / max(along @ along, 1e-12), 0, 1)
        away = points - a - t[:, None] * along
        far = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        residual = far - radius
        weight = np.where(residual > 0, OUTSIDE, 1.0)
        now = float((weight * residual**2).sum())
        cost = now if cost is None else cost
        n = away / far[:, None]
        jacobian = np.concatenate([-(1 - t)[:, None] * n, -t[:, None] * n, -np.ones((len(t), 1))], axis=1)
        left = jacobian.T @ (jacobian * weight[:, None]) + damping * len(t) * np.eye(7)
        step = -np.linalg.solve(left, jacobian.T @ (weight * residual))
        a, b, radius = a + step[:3], b + step[3:6], max(radius + step[6], 0.004)
    if across:
        x, z = (a[0] + b[0]) / 2, (a[2] + b[2]) / 2
        half = max(abs(a[1] - b[1]) / 2, 0.005)
        a, b = np.array([x, -half, z]), np.array([x, half, z])
    return a, b, radius


def body_capsules(points, main, pose):
    """[(part, joint, a, b, radius)]: ends in the joint's frame, m, of a seated body (N, 3)."""
    out = []
    for part, joint, joints, selection in rows():
        own = points[np.isin(main, [INDEX[j] for j in joints])]
        k = INDEX[joint]
        rotation, at = pose.rotations[k], pose.at[k]
        local = (own - at) @ rotation
        if selection in ("upper", "lower"):
            split = np.percentile(local[:, 2], 45)
            local = local[local[:, 2] > split] if selection == "upper" else local[local[:, 2] < split + 0.02]
        if selection in ("near", "far"):
            # Down the thigh at rest is -z.
            split = local[:, 2].min() * 0.48
            local = local[local[:, 2] > split] if selection == "near" else local[local[:, 2] < split + 0.02]
        across = selection == "across" or part in ("head", "face", "neck")
        a, b, radius = fit_capsule(local, across)
        out.append((part, joint, a, b, radius))
    return out


def cover(points, capsules, rotations, at):
    """Distance (N,) of each vertex of a posed mesh from the nearest capsule's surface, m."""
    nearest = np.full(len(points), np.inf)
    for _, joint, a, b, radius in capsules:
        k = INDEX[joint]
        here = at[k] + rotations[k] @ a, at[k] + rotations[k] @ b
        nearest = np.minimum(nearest, distance(points, *here, radius))
    return nearest
