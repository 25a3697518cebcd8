"""Computes the answers to the questions of labelled episodes again, from the HDF5 alone.

Reads /labels/questions of files of `wheelarm-dataset annotate`, samples --rows of them,
computes every answer from the recorded state and the recorded asset texts, and compares. The
objects of a question with cameras must have a visible box in the last image of each camera
until its time. Does not import WheelArm. Exit code 1 when an answer differs or an object is
not visible.

Usage: check_answers.py [--rows 500] [--seed 0] FILE...

Definitions. An area is the furniture with the area's own name; its frame is at the centre of the
edge of its first surface: x inwards, y to the left, z up. An object is on an area when its
origin is above the surface, from -0.02 m to 0.3 m. Left and right: at least 0.06 m, and at least
the difference in depth. In front and behind: at least 0.06 m, and more than the sideways
difference. Held: both finger tips press it with 0.5 N. Within reach: the origin is within the
outer radius of robot.toml's reach around its centre. Open: at least 0.02 m. The floor: below
0.15 m.
"""

import argparse
import json
import random
import re
import sys
import tomllib
import xml.etree.ElementTree as xml

import h5py
import numpy as np

STEP, HELD, OPEN, FLOOR = 0.06, 0.5, 0.02, 0.15


def rotate(q, v):
    """Rotates a vector by a unit quaternion x y z w."""
    u, w = np.asarray(q[:3]), q[3]
    t = 2 * np.cross(u, v)
    return np.asarray(v) + w * t + np.cross(u, t)


def multiply(a, b):
    """The rotation b, followed by the rotation a."""
    u, v = np.asarray(a[:3]), np.asarray(b[:3])
    return [*(a[3] * v + b[3] * u + np.cross(u, v)), a[3] * b[3] - u @ v]


def from_rpy(rpy):
    """Quaternion of rotations about the fixed x, y, z axes."""
    q = [0.0, 0.0, 0.0, 1.0]
    for axis, angle in enumerate(rpy):
        turn = [0.0, 0.0, 0.0, np.cos(angle / 2)]
        turn[axis] = np.sin(angle / 2)
        q = multiply(turn, q)
    return q


class Episode:
    """Data of a file for the answers."""

    def __init__(self, path):
        self.file = h5py.File(path)
        text = lambda name: [t.decode() for t in self.file[name][:]]
        self.assets = dict(zip(text("initial_state/assets/path"), text("initial_state/assets/text")))
        pose = self.file["streams/object_pose/pose"]
        self.objects = list(pose.attrs["names"])
        self.poses, self.ticks = pose[:], self.file["streams/object_pose/tick"][:]
        scene = next(t for p, t in self.assets.items() if p.startswith("scenes/"))
        self.furniture = tomllib.loads(scene)["furniture"]
        robot = next(p for p in self.assets if p.endswith("/robot.toml"))
        self.robot = tomllib.loads(self.assets[robot])
        self.urdf = xml.fromstring(next(t for p, t in self.assets.items() if p.endswith(".urdf")))
        self.areas = self.read_areas()
        self.tips = self.read_tips()
        self.mount = self.read_mount()

    def read_areas(self):
        areas = {}
        for one in self.furniture:
            if one.get("area") != one["name"] or not one.get("surfaces"):
                continue
            surface = one["surfaces"][0]
            yaw = np.radians(one.get("yaw_deg", 0.0))
            x, y, z = surface["edge"]
            edge = np.array(one["at"]) + [
                np.cos(yaw) * x - np.sin(yaw) * y,
                np.sin(yaw) * x + np.cos(yaw) * y,
                z,
            ]
            inwards = yaw + np.radians(surface.get("inwards_deg", 0.0))
            areas[one["name"]] = (edge, inwards, surface["depth"], surface["width"])
        return areas

    def read_tips(self):
        roles = {j["name"] for j in self.robot["joints"] if j["role"].startswith("finger_tip")}
        joints = [j for j in self.urdf.findall("joint") if j.get("name") in roles]
        return [j.find("child").get("link") for j in joints]

    def read_mount(self):
        """Pose of the arm's base in the chair, along the fixed joints of the URDF."""
        above = {j.find("child").get("link"): j for j in self.urdf.findall("joint")}
        chair = next(f["link"] for f in self.robot["frames"] if f.get("role") == "chair")
        link, at, q = self.robot["arm_base_link"], np.zeros(3), [0.0, 0.0, 0.0, 1.0]
        while link != chair:
            joint = above[link]
            origin = joint.find("origin")
            numbers = lambda key: [float(x) for x in (origin.get(key, "0 0 0") if origin is not None else "0 0 0").split()]
            turn = from_rpy(numbers("rpy"))
            at, q = np.array(numbers("xyz")) + rotate(turn, at), multiply(turn, q)
            link = joint.find("parent").get("link")
        return at, q

    def row(self, stream, tick):
        """Index of the newest sample of a stream at a tick."""
        ticks = self.file[f"streams/{stream}/tick"][:]
        return max(int(np.searchsorted(ticks, tick, side="right")) - 1, 0)

    def in_area_frame(self, area, at):
        edge, inwards, _, _ = self.areas[area]
        x, y, z = np.asarray(at) - edge
        c, s = np.cos(inwards), np.sin(inwards)
        return np.array([c * x + s * y, c * y - s * x, z])

    def find_area(self, at):
        for name, (_, _, depth, width) in self.areas.items():
            x, y, z = self.in_area_frame(name, at)
            if 0 <= x <= depth and abs(y) <= width / 2 and -0.02 <= z <= 0.3:
                return name
        return None

    def find_hidden(self, cameras, tick, names):
        """The first of these objects that is not visible in the last image of a camera."""
        stamp = self.file["streams/object_pose/stamp_nanos"][int(np.searchsorted(self.ticks, tick))]
        for camera in cameras:
            taken = self.file[f"streams/camera/{camera}/stamp_nanos"][:]
            image = int(np.searchsorted(taken, stamp, side="right")) - 1
            boxes = self.file[f"labels/boxes/{camera}/visible"]
            for name in names:
                if image < 0 or np.isnan(boxes[image, self.objects.index(name)]).any():
                    return f"{name} in {camera}"
        return None

    def find_held(self, tick):
        row = self.row("contact", tick)
        pairs = json.loads(self.file["streams/contact/pairs"][row])
        force = np.linalg.norm(self.file["streams/contact/force"][row], axis=-1)
        for name in self.objects:
            pressed = [
                sum(force[k] for k, pair in enumerate(pairs) if set(pair) == {tip, name})
                for tip in self.tips
            ]
            if pressed and min(pressed) >= HELD:
                return name
        return None

    def position(self, name, tick):
        row = int(np.searchsorted(self.ticks, tick))
        assert self.ticks[row] == tick, f"no object pose at tick {tick}"
        return self.poses[row, self.objects.index(name)]

    def location(self, name, tick):
        if self.find_held(tick) == name:
            return "hand"
        at = self.position(name, tick)[:3]
        return self.find_area(at) or ("floor" if at[2] < FLOOR else "elsewhere")

    def answer(self, kind, tick, arguments):
        return getattr(self, f"answer_{kind}")(tick, **arguments)

    def answer_where(self, tick, object):
        return self.location(object, tick)

    def answer_count(self, tick, category, area):
        def kind(name):
            text = self.assets.get(f"objects/{re.sub('_[0-9]+$', '', name)}.toml", "")
            return tomllib.loads(text).get("category", "")

        return sum(kind(n) == category and self.location(n, tick) == area for n in self.objects)

    def answer_side(self, tick, object, side):
        own = self.location(object, tick)
        if own not in self.areas:
            return None
        here = self.in_area_frame(own, self.position(object, tick)[:3])
        found = []
        for name in self.objects:
            if name == object or self.location(name, tick) != own:
                continue
            deep, left, _ = self.in_area_frame(own, self.position(name, tick)[:3]) - here
            holds = {
                "left": left >= STEP and left >= abs(deep),
                "right": -left >= STEP and -left >= abs(deep),
                "front": -deep >= STEP and -deep > abs(left),
                "behind": deep >= STEP and deep > abs(left),
            }
            if holds[side]:
                found.append(name)
        return sorted(found)

    def answer_reach(self, tick, object):
        frames = self.file["streams/pose/pose"]
        names = list(frames.attrs["names"])
        name = next(f["name"] for f in self.robot["frames"] if f.get("role") == "chair")
        chair = frames[self.row("pose", tick), names.index(name)]
        at, q = self.mount
        base = chair[:3] + rotate(chair[3:], at)
        centre = base + rotate(multiply(chair[3:], q), self.robot["reach"]["centre"])
        far = np.linalg.norm(self.position(object, tick)[:3] - centre)
        return bool(far <= self.robot["reach"]["outer_radius"])

    def answer_held(self, tick):
        return self.find_held(tick)

    def answer_open(self, tick, slide):
        joints = self.file["streams/furniture_joint/position"]
        names = list(joints.attrs["names"])
        value = joints[self.row("furniture_joint", tick), names.index(f"{slide}_joint")]
        return bool(value >= OPEN)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+")
    parser.add_argument("--rows", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    rows = []
    for path in args.files:
        episode = Episode(path)
        group = episode.file["labels/questions"]
        kinds = [k for k in group.attrs["kinds"]]
        text = lambda name: [t.decode() for t in group[name][:]]
        columns = zip(group["kind"][:], group["tick"][:], text("question"), text("arguments"), text("value"), text("cameras"))
        rows += [(episode, kinds[k], int(t), q, json.loads(a), json.loads(v), c.split()) for k, t, q, a, v, c in columns]
    chosen = random.Random(args.seed).sample(rows, min(args.rows, len(rows)))
    wrong, memory, counts = 0, 0, {}
    for episode, kind, tick, question, arguments, value, cameras in chosen:
        counts[kind] = counts.get(kind, 0) + 1
        found = episode.answer(kind, tick, arguments)
        if found != value:
            wrong += 1
            print(f"{episode.file.filename} tick {tick}: {question} {value}, computed {found}")
        memory += not cameras
        answered = value if kind == "side" else [value] if kind == "held" and value else []
        names = [name for name in [arguments.get("object"), *answered] if name]
        hidden = episode.find_hidden(cameras, tick, names)
        if hidden:
            wrong += 1
            print(f"{episode.file.filename} tick {tick}: {question} is about {hidden}, which is not visible")
    print(f"{len(chosen)} of {len(rows)} rows computed again, {wrong} wrong, {memory} from memory;", ", ".join(f"{k} {n}" for k, n in sorted(counts.items())))
    if wrong or not chosen:
        sys.exit(1)


if __name__ == "__main__":
    main()
