"""Measures the error of aligned poses against the true poses.

align.py [TASK]

Records an episode with cameras at 240 Hz, four images per pose sample. Every image
has the camera pose of its rendering: the chair camera gives the pose of the chair,
and together with the wrist camera the pose of the hand in base_link. The file is
aligned and the rows between samples are compared. The fixed mount poses (camera on
chair, camera in hand, base_link on chair) are fitted to the rows at sample times.
Exit code 1 when a goal is missed.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
RELEASE = ROOT / "target" / "release"
GOAL_MM, GOAL_DEG = 0.1, 0.01


def run(*command):
    environment = dict(os.environ, WHEELARM_ASSETS=str(ROOT / "assets"))
    done = subprocess.run([str(c) for c in command], env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{command[:4]} failed: {done.stderr or done.stdout}")


def multiply(a, b):
    vector = a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + np.cross(a[..., :3], b[..., :3])
    return np.concatenate([vector, a[..., 3:] * b[..., 3:] - (a[..., :3] * b[..., :3]).sum(-1, keepdims=True)], -1)


def conjugate(q):
    return q * [-1, -1, -1, 1]


def rotate(q, v):
    t = 2 * np.cross(q[..., :3], v)
    return v + q[..., 3:] * t + np.cross(q[..., :3], t)


def rotation_vector(q):
    """Rotation vector of a unit quaternion."""
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    return q[..., :3] * np.where(sine < 1e-12, 2, 2 * np.arctan2(sine, q[..., 3:]) / np.maximum(sine, 1e-300))


def compose(a, b):
    return np.concatenate([a[..., :3] + rotate(a[..., 3:], b[..., :3]), multiply(a[..., 3:], b[..., 3:])], -1)


def inverse(a):
    back = conjugate(a[..., 3:])
    return np.concatenate([-rotate(back, a[..., :3]), back], -1)


def find_mounts(camera, hand):
    """The constant A and B in camera = A hand B."""
    one = rotation_vector(multiply(camera[:, 3:], conjugate(camera[0, 3:])))
    other = rotation_vector(multiply(hand[:, 3:], conjugate(hand[0, 3:])))
    u, _, vt = np.linalg.svd(other.T @ one)
    turn = vt.T @ np.diag([1, 1, np.linalg.det(vt.T @ u.T)]) @ u.T
    # Quaternion of a matrix as an eigenvector (Bar-Itzhack 2000).
    (a, b, c), (d, e, f), (g, h, i) = turn
    matrix = np.array([[a - e - i, b + d, c + g, h - f], [b + d, e - a - i, f + h, c - g],
                       [c + g, f + h, i - a - e, d - b], [h - f, c - g, d - b, a + e + i]])
    first = np.linalg.eigh(matrix)[1][:, -1]
    # camera = place + first hand + (first hand) offset, linear in both.
    turns = multiply(np.broadcast_to(first, hand[:, 3:].shape), hand[:, 3:])
    columns = [np.broadcast_to(v, (len(hand), 3)) for v in np.eye(3)] + [rotate(turns, np.broadcast_to(v, (len(hand), 3))) for v in np.eye(3)]
    right = camera[:, :3] - rotate(np.broadcast_to(first, hand[:, 3:].shape), hand[:, :3])
    found = np.linalg.lstsq(np.stack([c.ravel() for c in columns], 1), right.ravel(), rcond=None)[0]
    last = multiply(conjugate(turns[0]), camera[0, 3:])
    return np.concatenate([found[:3], first]), np.concatenate([found[3:], last])


def pose_errors(found, truth):
    place = 1e3 * np.linalg.norm(found[:, :3] - truth[:, :3], axis=1)
    return place, np.degrees(np.linalg.norm(rotation_vector(multiply(conjugate(found[:, 3:]), truth[:, 3:])), axis=1))


def compare(path):
    with h5py.File(path) as file:
        streams = file["streams"]
        poses, age = streams["pose/pose"][...], streams["pose/age_nanos"][...]
        names = list(streams["pose/pose"].attrs["names"])
        whole = streams["pose/valid"][...].astype(bool)
        for camera in ("wheelchair", "gen3"):
            whole &= streams[f"camera/{camera}/stamp_nanos"][...] == file["stamp_nanos"][...]
        cameras = {c: streams[f"camera/{c}/pose"][...][whole] for c in ("wheelchair", "gen3")}
    poses, age = poses[whole], age[whole]
    on, off = age == 0, age > 0
    chair, hand = poses[:, names.index("wheelchair")], poses[:, names.index("end_effector")]
    on_chair = compose(inverse(chair[on][0]), cameras["wheelchair"][on][0])
    true_chair = compose(cameras["wheelchair"], inverse(on_chair))
    wrist_camera = compose(inverse(true_chair), cameras["gen3"])
    base, in_hand = find_mounts(wrist_camera[on], hand[on])
    true_hand = compose(compose(inverse(base), wrist_camera), inverse(in_hand))
    floor = max(e.max() for e in pose_errors(hand[on], true_hand[on]))
    assert floor < 1e-6, f"fitting the mounts failed: the error at sample times is {floor}, limit 1e-6"
    return off.sum(), pose_errors(chair[off], true_chair[off]), pose_errors(hand[off], true_hand[off])


def main():
    task = sys.argv[1] if len(sys.argv) > 1 else "pick_bowl"
    fine = True
    with tempfile.TemporaryDirectory(prefix="wheelarm_align_") as folder:
        folder = Path(folder)
        run(RELEASE / "wheelarm", "demo", "--task", task, "--seed", 50, "--rate", 240, "--width", 64, "--height", 48,
            "--no-sheet", "--out", folder / "raw")
        for curve in ("linear", "hermite"):
            out = folder / curve
            run(RELEASE / "wheelarm-dataset", "align", "--no-pictures", "--interpolation", curve, folder / "raw", "--out", out)
            count, *both = compare(next(out.iterdir()))
            for name, (place, turn) in zip(("chair in house", "hand in base_link"), both):
                met = place.max() <= GOAL_MM and turn.max() <= GOAL_DEG
                fine &= met or curve == "linear"
                print(f"{task}, {curve:<7} {name:<17} {count} rows between samples: worst {place.max():.4f} mm, {turn.max():.5f} deg;"
                      f" mean {place.mean():.5f} mm, {turn.mean():.6f} deg; goal {GOAL_MM} mm, {GOAL_DEG} deg: {'met' if met else 'missed'}")
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
