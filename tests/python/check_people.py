"""Checks assets/people: meshes, skeletons, masses, postures in the chair, capsules.

Usage: check_people.py [ASSETS]      (numpy only; ASSETS: the folder `assets`)
"""

import pathlib
import re
import sys
import tomllib

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "assets/tools/people"))

import reader  # noqa: E402
from chair import Chair, depth  # noqa: E402

# Required people: stature, m, and mass, kg. [published anthropometry, rounded]
REQUIRED = {
    "woman_p5": (1.52, 50),
    "woman_p50": (1.63, 64),
    "man_p50": (1.755, 77),
    "man_p95": (1.87, 106),
    "woman_80": (1.55, 58),
    "girl_12": (1.50, 42),
}
TRIANGLES = 6000
BYTES = 6_000_000
# Largest depth of a vertex in the chair, m: hands and forearms; the body in the upholstery of
# seat and back (2.5 and 1.2 cm are intended, corners are deeper); other parts.
HANDS, UPHOLSTERY, ELSEWHERE = 0.010, 0.045, 0.022
# Joint ranges of healthy adults, degrees. [textbook values, rounded up]
ELBOW, KNEE, HIP, WRIST, FOREARM, FINGER = 150, 130, 115, 45, 95, 100
HEAD = {"yaw": 60, "pitch": (-45, 75), "roll": 35}
LIMB = "arm|hand|thumb|index|middle|ring|little"
PARTS = [
    "head", "face", "neck", "shoulders", "chest", "waist", "belly", "pelvis",
    *(f"{s}_{p}" for s in ("left", "right") for p in
      ("upper_arm", "forearm", "hand", "index", "little", "thumb", "hip", "thigh", "shank", "foot")),
]  # fmt: skip
MATERIALS = {"skin", "lips", "mouth", "hair", "shirt", "sleeves", "trousers", "shoes", "eye_white", "iris"}
LANDMARKS = {"mouth", "upper_lip", "lower_lip", "nose", "chin", "left_eye", "right_eye", "left_hand", "right_hand", "lap"}  # fmt: skip


def angle(a, b):
    cos = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(cos, -1, 1))))


def rpy(matrix):
    """Roll, pitch and yaw of Rz(yaw) Ry(pitch) Rx(roll), degrees."""
    return np.degrees(
        [
            np.arctan2(matrix[2, 1], matrix[2, 2]),
            np.arcsin(np.clip(-matrix[2, 0], -1, 1)),
            np.arctan2(matrix[1, 0], matrix[0, 0]),
        ]
    )


def volume(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def closed(points, triangles):
    """The mesh with every hole closed by a fan."""
    edges = {}
    for face in triangles:
        for k in range(3):
            edges[(int(face[k]), int(face[(k + 1) % 3]))] = True
    onward = {b: a for a, b in edges if (b, a) not in edges}
    points, triangles = list(points), list(triangles)
    while onward:
        start, ring = next(iter(onward)), []
        at = start
        while at in onward:
            ring.append(at)
            at = onward.pop(at)
        assert at == start, "the rim of the clothes is not closed"
        points.append(np.mean([points[k] for k in ring], axis=0))
        triangles += [[ring[k - 1], ring[k], len(points) - 1] for k in range(len(ring))]
    return np.array(points), np.array(triangles)


def samples(points, triangles):
    """Points on triangles; for small triangles at most about 1 cm apart."""
    corner, steps = points[triangles], 6
    return np.concatenate(
        [
            np.einsum("k,tkj->tj", np.array([i, j, steps - i - j]) / steps, corner)
            for i in range(steps + 1)
            for j in range(steps + 1 - i)
        ]
    )


def check_mesh(name, asset):
    count = len(asset.points)
    assert len(asset.triangles) <= TRIANGLES, f"{name}: {len(asset.triangles)} triangles"
    assert asset.triangles.max() < count and len(np.unique(asset.triangles)) == count, name
    assert MATERIALS <= set(asset.materials), (name, asset.materials)
    assert np.abs(asset.weights.sum(axis=1) - 1).max() < 1e-9, f"{name}: weights"
    assert ((asset.weights > 0).sum(axis=1) <= 4).all(), name
    assert asset.joints == asset.facts["joints"], f"{name}: joints of mesh and person.toml differ"
    assert asset.parents[0] == -1 and asset.parents.count(-1) == 1, f"{name}: one root"
    assert np.abs(asset.inverse_bind + asset.rest).max() < 1e-5, f"{name}: inverse bind"
    still = {"root": asset.rest[0], "joints": {}}
    points, _ = reader.skin(asset, *reader.pose(asset, still))
    assert np.abs(points - asset.points).max() < 1e-5, f"{name}: skinning at rest moves the mesh"
    lengths = np.linalg.norm(asset.normals, axis=1)
    assert np.abs(lengths - 1).max() < 1e-4, f"{name}: normals"
    corner = asset.points[asset.triangles]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert (np.linalg.norm(face, axis=1) > 1e-10).all(), f"{name}: a triangle without area"
    outward = np.einsum("ij,ij->i", face, asset.normals[asset.triangles].sum(axis=1)) > 0
    assert outward.mean() > 0.97, f"{name}: {outward.mean():.2f} of the triangles face outwards"
    # The names of left and right match the positions.
    for joint, at in zip(asset.joints, asset.rest):
        side = 1 if joint.startswith("left") else -1 if joint.startswith("right") else 0
        assert side * at[1] > 0.005 if side else abs(at[1]) < 0.006, (name, joint, at)


def check_size(name, asset):
    facts = asset.facts
    if name in REQUIRED:
        stature, mass = REQUIRED[name]
        assert abs(facts["stature"] - stature) < 0.01, (name, facts["stature"])
        assert abs(facts["mass"] / mass - 1) < 0.02, (name, facts["mass"])
    shoes = np.ptp(asset.points[:, 2]) - facts["stature"]
    assert 0 < shoes < 0.05, f"{name}: shoes and hair add {shoes:.3f} m to the stature"
    # Clothes enclose the body without head and hands (about a tenth), plus their own volume.
    worn = [asset.materials.index(m) for m in ("shirt", "sleeves", "trousers", "shoes")]
    clothes = closed(asset.points, asset.triangles[np.isin(asset.labels, worn)])
    shown = 1010 * volume(*clothes) / facts["mass"]
    assert 0.93 < shown < 1.22, f"{name}: the volume of the clothes has {shown:.2f} of the mass"
    box, head = facts["head_box"], asset.rest[asset.joints.index("head")]
    main = np.array(asset.joints)[asset.weights.argmax(axis=1)]
    inside = np.abs(asset.points[np.isin(main, ["head", "jaw"])] - head - box["at"])
    assert (inside <= np.array(box["size"]) / 2 + 1e-3).all(), f"{name}: head box"
    assert 0.16 < box["size"][2] < 0.32, (name, box)


def check_mouth(name, asset):
    """The jaw opens the mouth, and moves only the lower half of the face."""
    motion = asset.facts["head_motion"]
    turn = {"jaw": reader.rotation([0, motion["jaw_open"], 0])}
    still = {"root": asset.rest[0], "joints": {}}
    points, _ = reader.skin(asset, *reader.pose(asset, still, turn))
    moved = np.linalg.norm(points - asset.points, axis=1)
    head = asset.rest[asset.joints.index("head")]
    mark = asset.facts["landmark"]
    assert 0.02 < motion["mouth_gap"] < 0.05, (name, motion["mouth_gap"])
    assert set(mark) == LANDMARKS, name
    upper = head + mark["upper_lip"]["at"]
    assert moved[asset.points[:, 2] > upper[2] + 0.03].max() < 0.012, f"{name}: the jaw moves the upper half of the face"
    assert moved.max() > 0.02, f"{name}: the mouth stays closed"
    for lip in ("upper_lip", "lower_lip", "nose", "chin"):
        joint = asset.rest[asset.joints.index(mark[lip]["joint"])]
        gap = np.linalg.norm(asset.points - joint - mark[lip]["at"], axis=1).min()
        assert gap < 0.008, f"{name}: {lip} is {gap * 1e3:.0f} mm from the mesh"
    assert abs(sum(motion["shares"]) - 1) < 1e-9


def check_limits(name, asset, posture, rotations, at):
    def place(joint):
        return at[asset.joints.index(joint)]

    def own(joint):
        return rotations[asset.joints.index(joint)]

    for side, sign in (("left", 1), ("right", -1)):
        shoulder, elbow, wrist, knuckle = (
            place(f"{side}_{j}") for j in ("upper_arm", "forearm", "hand", "middle_1")
        )
        hip, knee, foot = (place(f"{side}_{j}") for j in ("thigh", "shank", "foot"))
        # At rest the hand is aligned with the forearm within a few degrees.
        found = {
            "elbow": (angle(elbow - shoulder, wrist - elbow), ELBOW),
            "wrist": (angle(wrist - elbow, knuckle - wrist), WRIST),
            "knee": (angle(knee - hip, foot - knee), KNEE),
        }
        trunk = own("spine_3") @ [0, 0, -1.0]
        found["hip"] = (angle(trunk, knee - hip), HIP)
        axis = (wrist - elbow) / np.linalg.norm(wrist - elbow)
        turn = own(f"{side}_hand") @ own(f"{side}_forearm").T
        vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        found["forearm"] = (
            abs(np.degrees(2 * np.arctan2(vector @ axis / 2, (1 + np.trace(turn)) / 2))),
            FOREARM,
        )
        stored = asset.postures[posture]["joints"]
        for joint in asset.joints:
            if joint.startswith(side) and re.search("thumb|index|middle|ring|little", joint):
                bend = np.degrees(np.linalg.norm(stored.get(joint, [0.0])))
                found[joint] = (bend, FINGER)
        for what, (value, most) in found.items():
            assert value <= most, f"{name}, {posture}: {side} {what} {value:.0f} degrees"
        assert elbow[2] < shoulder[2], f"{name}, {posture}: {side} elbow above the shoulder"
        # Hands are on their own side, or in the middle of the lap.
        assert sign * wrist[1] > 0.02, f"{name}, {posture}: {side} wrist at {wrist}"
    head = own("spine_5").T @ own("head")
    roll, pitch, yaw = rpy(head)
    low, high = HEAD["pitch"]
    assert abs(yaw) <= HEAD["yaw"] and abs(roll) <= HEAD["roll"] and low <= pitch <= high, (
        f"{name}, {posture}: head at roll {roll:.0f}, pitch {pitch:.0f}, yaw {yaw:.0f} degrees"
    )


def upper_side(solid):
    """Points on the upper side of a box."""
    _, _, rotation, at, half = solid
    u, v = np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 9))
    local = np.stack([u * half[0], v * half[1], np.full_like(u, half[2])], axis=-1)
    return local.reshape(-1, 3) @ rotation.T + at


def check_seat(name, asset, posture, chair, points, spec, worst):
    main = np.array(asset.joints)[asset.weights.argmax(axis=1)]
    arms = np.array([bool(re.search("forearm|hand|thumb|index|middle|ring|little", m)) for m in main])
    for solid in chair.raised(asset.facts["cushion"]):
        soft = solid[0].split("/")[-1] in ("seat", "backrest")
        for what, of in (("arms", arms), ("body", ~arms)):
            most = HANDS if what == "arms" else UPHOLSTERY if soft else ELSEWHERE
            found = float(depth(solid, points[of]).max())
            key = (what, "upholstery" if soft else "hard")
            worst[key] = max(worst.get(key, 0), found)
            assert found <= most, f"{name}, {posture}: {what} {found * 1e3:.0f} mm in {solid[0]}"
    boards = np.concatenate([upper_side(s) for s in chair.solids if s[0] == "joystick" or s[0].endswith("armrest")])
    feet = points[[m.endswith("foot") for m in main]]
    gap = feet[:, 2].min() - chair.plate_top
    assert -0.012 < gap < 0.015, f"{name}, {posture}: soles {gap * 1e3:.0f} mm over the plate"
    assert feet[:, 0].max() < 0.81 and np.abs(feet[:, 1]).max() < 0.21, f"{name}, {posture}: feet"
    pelvis = points[main == "pelvis"]
    assert abs(pelvis[:, 1].mean()) < 0.01, f"{name}, {posture}: not in the middle of the seat"
    # Hands touch the surface of their posture.
    for side, sign in (("left", 1), ("right", -1)):
        hand = points[[m.startswith(side) and bool(re.search("hand|thumb|index|middle|ring|little", m)) for m in main]]
        middle = hand.mean(axis=0)
        where = spec[side]
        if where == "armrest":
            assert 0.18 < sign * middle[1] < 0.32 and 0.1 < middle[0] < 0.5, (name, posture, side, middle)
        elif where == "joystick":
            low, high = chair.joystick
            near = np.linalg.norm(hand - [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2]], axis=1)
            assert near.min() < 0.02, f"{name}, {posture}: hand {near.min() * 1e3:.0f} mm from the stick"
        else:
            assert -0.02 < sign * middle[1] < 0.22, (name, posture, side, middle)
            thigh = points[main == f"{side}_thigh"][:, 2].max()
            high = hand[:, 2].min() - thigh
            assert high < 0.06, f"{name}, {posture}: {side} hand {high * 1e3:.0f} mm over the thighs"
        other = ~np.array([bool(re.search(f"{side}.*({LIMB})", m)) for m in main])
        faces = asset.triangles[other[asset.triangles].all(axis=1)]
        near = np.abs(points[faces].mean(axis=1) - middle).max(axis=1) < 0.25
        ground = np.concatenate([samples(points, faces[near]), boards])
        forearm = points[[m.startswith(f"{side}_forearm") for m in main]]

        def off(what):
            return 1e3 * min(np.linalg.norm(ground - p, axis=1).min() for p in what)

        # A forearm on the armrest may raise the hand slightly.
        assert off(hand) < 12 or off(forearm) < 5 and off(hand) < 25, (
            f"{name}, {posture}: {side} hand {off(hand):.0f} mm, forearm {off(forearm):.0f} mm from the surface"
        )


def check_mass(name, asset, posture, points):
    stored = asset.postures[posture]
    com = np.array(stored["com"])
    assert 0.12 < com[0] < 0.34 and abs(com[1]) < 0.05 and 0.68 < com[2] < 0.95, (name, posture, com)
    xx, yy, zz, xy, xz, yz = stored["inertia"]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    main = np.linalg.eigvalsh(inertia)
    assert main[0] > 0 and main[0] + main[1] > main[2], f"{name}, {posture}: inertia {main}"
    reach = np.sqrt(np.trace(inertia) / 2 / asset.facts["mass"])
    assert 0.2 < reach < 0.4, f"{name}, {posture}: radius of gyration {reach:.2f} m"
    low, high = points.min(axis=0), points.max(axis=0)
    assert (com > low).all() and (com < high).all(), (name, posture)


def check_capsules(name, asset, posture, rotations, at, points):
    parts = [c["part"] for c in asset.facts["capsule"]]
    assert sorted(parts) == sorted(PARTS), (name, parts)
    nearest = np.full(len(points), np.inf)
    for capsule in asset.facts["capsule"]:
        k = asset.joints.index(capsule["joint"])
        a, b = (at[k] + rotations[k] @ capsule[end] for end in "ab")
        along = b - a
        t = np.clip((points - a) @ along / (along @ along), 0, 1)
        far = np.linalg.norm(points - a - t[:, None] * along, axis=1) - capsule["radius"]
        nearest = np.minimum(nearest, far)
    stated = asset.facts["capsules"]
    assert nearest.max() <= stated["margin"] + 1e-4, f"{name}, {posture}: {nearest.max():.4f} m"
    assert np.percentile(nearest, 95) <= stated["near"] + 1e-4, f"{name}, {posture}"
    assert stated["margin"] <= 0.035 and stated["near"] <= 0.012, (name, stated)
    # Capsules are not too large: half of the mesh is within 3 cm of the surface of one.
    assert np.percentile(nearest, 10) > -0.055, f"{name}, {posture}: capsules far too large"


def main(assets):
    people = assets / "people"
    folders = sorted(p.parent for p in people.glob("*/person.toml"))
    postures = tomllib.loads((people / "postures.toml").read_text())
    postures = {k: v for k, v in postures.items() if isinstance(v, dict)}
    size = sum(p.stat().st_size for p in people.rglob("*") if p.is_file())
    assert size <= BYTES, f"assets/people has {size} bytes"
    assert len(folders) >= 12 and len(postures) >= 8, (len(folders), len(postures))
    assert set(REQUIRED) <= {f.name for f in folders}
    for file in sorted(people.rglob("*.toml")):
        stored = tomllib.loads(file.read_text())
        assert stored.get("origin") and stored.get("license"), f"{file} lacks origin or license"
    chair = Chair(assets / "robots/wheelarm")
    worst, triangles = {}, 0
    for folder in folders:
        name, asset = folder.name, reader.load(folder)
        triangles = max(triangles, len(asset.triangles))
        check_mesh(name, asset)
        check_size(name, asset)
        check_mouth(name, asset)
        assert list(asset.postures) == list(postures), f"{name}: postures"
        for posture, spec in postures.items():
            rotations, at = reader.pose(asset, posture)
            points, _ = reader.skin(asset, rotations, at)
            check_limits(name, asset, posture, rotations, at)
            check_seat(name, asset, posture, chair, points, spec, worst)
            check_mass(name, asset, posture, points)
            check_capsules(name, asset, posture, rotations, at, points)
    deepest = ", ".join(f"{a} in {b} {1e3 * v:.0f} mm" for (a, b), v in sorted(worst.items()))
    print(
        f"{len(folders)} bodies, {len(postures)} postures, at most {triangles} triangles, "
        f"{size / 1e6:.1f} MB; deepest: {deepest}"
    )


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "assets")
