"""Renders people in the wheelchair, and measures their share of the chair camera's image.

    look_at_people.py sheet OUT.png [--bodies A,B] [--postures A,B]   one row per body, one column per posture
    look_at_people.py guide OUT.png       the image of the guide
    look_at_people.py shares              head, knees and hands in the chair camera's image

Needs numpy and pillow.
"""

import argparse
import pathlib
import tomllib

import numpy as np
from PIL import Image

import reader
from chair import Chair
from draw import Camera, Canvas, at, draw

ROOT = pathlib.Path(__file__).resolve().parents[3]
PEOPLE = ROOT / "assets/people"
# Chair camera: position, pitch and focal length at 1280x720. [robot.toml, URDF]
CAMERA = {"eye": [0.15, 0.0, 1.75], "pitch": np.radians(52.0), "focal": 759.216, "width": 1280}
HEAD, HANDS, KNEES = 1, 2, 3
# Skin, hair and clothes of each body in images: indices in looks.toml.
LOOKS = {
    "woman_p5": (2, 0, 1), "woman_p50": (1, 2, 2), "woman_p95": (5, 0, 9), "woman_heavy": (3, 1, 6),
    "woman_young": (6, 0, 5), "man_p5": (3, 0, 4), "man_p50": (2, 1, 0), "man_p95": (1, 3, 3),
    "man_thin": (4, 0, 8), "man_60": (6, 5, 7), "man_85": (1, 6, 3), "woman_80": (2, 6, 6),
    "girl_12": (0, 4, 5), "boy_15": (5, 0, 4),
}  # fmt: skip


class Room:
    """The chair's visual meshes with the arm at home, for rendering."""

    def __init__(self):
        robot = ROOT / "assets/robots/wheelarm"
        self.chair = Chair(robot)
        values = tomllib.loads((robot / "robot.toml").read_text())
        arm = [j["name"] for j in values["joints"] if j["role"] == "arm"]
        colors = self.chair.colors()
        self.meshes = [
            (points, triangles, np.array(colors[material]) ** (1 / 1.4) * 0.9 + 0.04)
            for points, triangles, material in self.chair.visuals(dict(zip(arm, values["home"])))
        ]
        self.looks = tomllib.loads((PEOPLE / "looks.toml").read_text())

    def draw_chair(self, canvas, camera, cushion):
        for points, triangles, color in self.meshes:
            draw(canvas, camera, points, triangles, np.tile(color, (len(triangles), 1)), np.zeros(len(triangles), int))
        if cushion > 0:
            _, _, _, middle, half = self.chair.solid("seat")
            low = np.array([middle[0] - half[0], -half[1], self.chair.seat_top])
            high = np.array([middle[0] + half[0], half[1], self.chair.seat_top + cushion])
            corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
            faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [1, 5, 7], [1, 7, 3]]
            draw(canvas, camera, corners, np.array(faces), np.tile([0.30, 0.30, 0.33], (len(faces), 1)), np.zeros(len(faces), int))

    def colors(self, asset, look):
        skin, hair, clothes = (self.looks[k][n] for k, n in zip(("skin", "hair", "clothes"), look))
        plain = {k: v["color"] for k, v in self.looks["material"].items() if "color" in v}
        values = {
            "skin": skin["color"], "lips": skin["lips"], "hair": hair["color"], "brows": hair["brows"], **plain,
            **{k: clothes[k] for k in ("shirt", "sleeves", "trousers", "shoes")},
        }  # fmt: skip
        if values["sleeves"] == "skin":
            values["sleeves"] = skin["color"]
        return np.array([[int(values[m][k : k + 2], 16) / 255 for k in (1, 3, 5)] for m in asset.materials])

    def draw_person(self, canvas, camera, asset, look, posture, extra={}):
        points, normals = reader.skin(asset, *reader.pose(asset, posture, extra))
        ids = parts(asset)
        draw(canvas, camera, points, asset.triangles, self.colors(asset, look)[asset.labels], ids, normals)


def parts(asset):
    """Part of each triangle for the shares: HEAD, HANDS, KNEES, or 4 for the rest."""
    main = np.array(asset.joints)[asset.weights.argmax(axis=1)]
    fingers = ("hand", "thumb", "index", "middle", "ring", "little")
    kind = np.full(len(main), 4)
    kind[np.isin(main, ["head", "jaw"])] = HEAD
    kind[[bool(set(fingers) & set(m.split("_"))) for m in main]] = HANDS
    for side in ("left", "right"):
        knee = asset.rest[asset.joints.index(f"{side}_shank")]
        near = np.isin(main, [f"{side}_thigh", f"{side}_shank"])
        kind[near & (np.abs(asset.points[:, 2] - knee[2]) < 0.09)] = KNEES
    return kind[asset.triangles].max(axis=1) * 0 + np.sort(kind[asset.triangles], axis=1)[:, 1]


def chair_view(room, asset, look, posture, width, height, pitch=CAMERA["pitch"]):
    camera = Camera(CAMERA["eye"], [np.cos(pitch), 0, -np.sin(pitch)], CAMERA["focal"] * width / CAMERA["width"])
    canvas = Canvas(width, height)
    room.draw_chair(canvas, camera, asset.facts["cushion"])
    room.draw_person(canvas, camera, asset, look, posture)
    return canvas


def view(room, asset, look, posture, eye, target, focal, width, height, extra={}):
    camera = Camera(eye, at(eye, target), focal)
    canvas = Canvas(width, height)
    room.draw_chair(canvas, camera, asset.facts["cushion"])
    room.draw_person(canvas, camera, asset, look, posture, extra)
    return canvas.bytes()


def bodies():
    return sorted(p.parent.name for p in PEOPLE.glob("*/person.toml"))


def shares(room, chosen):
    """Prints each part's share of the image, %, and how many images show knees or hands."""
    width, height = 320, 180
    total, shown, worst = 0, 0, {}
    names = None
    for name in chosen:
        asset = reader.load(PEOPLE / name)
        if names is None:
            names = list(asset.postures)
            print("head % / knees % / hands % of the image; postures:", ", ".join(names))
        cells = []
        for posture in names:
            ids = chair_view(room, asset, LOOKS[name], posture, width, height).id
            head, hands, knees = (100 * (ids == k).mean() for k in (HEAD, HANDS, KNEES))
            cells.append(f"{head:.1f}/{knees:.1f}/{hands:.1f}")
            worst[posture] = max(worst.get(posture, 0), head)
            total += 1
            shown += knees > 0.1 or hands > 0.1
        print(f"{name:12}", " ".join(f"{c:>12}" for c in cells), flush=True)
    print("greatest head share:", ", ".join(f"{k} {v:.1f}" for k, v in worst.items()))
    print(f"knees or hands visible in {shown} of {total} images")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["sheet", "guide", "shares", "faces"])
    parser.add_argument("out", nargs="?")
    parser.add_argument("--bodies", type=lambda s: s.split(","))
    parser.add_argument("--postures", type=lambda s: s.split(","))
    parser.add_argument("--eye", type=lambda s: [float(v) for v in s.split(",")], default=[2.0, -1.2, 1.55])
    parser.add_argument("--size", type=int, default=300)
    arguments = parser.parse_args()
    room = Room()
    if arguments.what == "shares":
        return shares(room, arguments.bodies or bodies())
    if not arguments.out:
        raise SystemExit(f"{arguments.what} needs an output file, e.g. people.png")
    names = arguments.bodies or bodies()
    assets = {n: reader.load(PEOPLE / n) for n in names}
    postures = arguments.postures or list(next(iter(assets.values())).postures)
    size, rows = arguments.size, []
    if arguments.what == "sheet":
        for name, asset in assets.items():
            rows.append(np.hstack([view(room, asset, LOOKS[name], p, arguments.eye, [0.27, 0.02, 0.80], size * 1.75, size, int(size * 1.12)) for p in postures]))
    elif arguments.what == "faces":
        for name, asset in assets.items():
            row = []
            for open_by in (0.0, asset.facts["jaw_open"] if "jaw_open" in asset.facts else asset.facts["head_motion"]["jaw_open"]):
                extra = {"jaw": reader.rotation([0, open_by, 0])}
                rotations, places = reader.pose(asset, "hands_in_lap", extra)
                head = places[asset.joints.index("head")] + [0.02, 0, 0.03]
                row.append(view(room, asset, LOOKS[name], "hands_in_lap", head + [0.9, -0.35, 0.05], head, size * 3.0, size, size, extra))
            rows.append(np.hstack(row))
        rows = [np.hstack(rows[k : k + 4] + [np.full_like(rows[0], 255)] * (4 - len(rows[k : k + 4]))) for k in range(0, len(rows), 4)]
    else:
        order = [n for n in LOOKS if n in assets]
        cells = [
            view(room, assets[n], LOOKS[n], postures[k % len(postures)], [2.0, -1.2, 1.55], [0.27, 0.02, 0.80], 480, 270, 300)
            for k, n in enumerate(order)
        ]
        for n, posture in (("man_p50", "hands_in_lap"), ("woman_p50", "hand_on_joystick"), ("girl_12", "looking_left"), ("man_p95", "hands_on_thighs")):
            cells.append(chair_view(room, assets[n], LOOKS[n], posture, 472, 266).bytes())
        rows = [np.hstack(cells[0:7]), np.hstack(cells[7:14])]
        last = np.hstack(cells[14:])
        last = np.hstack([last, np.full((last.shape[0], max(rows[0].shape[1] - last.shape[1], 0), 3), 255, np.uint8)])
        rows.append(last[:, : rows[0].shape[1]])
    image = Image.fromarray(np.vstack(rows))
    image.save(arguments.out, optimize=True)


if __name__ == "__main__":
    main()
