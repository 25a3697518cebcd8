"""The wheelchair as solids, read from its URDF, to keep a seated person out of them."""

import pathlib
import xml.etree.ElementTree as xml

import numpy as np

from rig import turn

# Links with solids near the person; all are fixed or rotate about their own axis.
LINKS = ["wheelchair_root", "front_left_wheel", "front_right_wheel", "arm_mount_link", "base_link"]


def _rpy(text):
    roll, pitch, yaw = (np.degrees(float(w)) for w in (text or "0 0 0").split())
    return turn([0, 0, 1], yaw) @ turn([0, 1, 0], pitch) @ turn([1, 0, 0], roll)


def _pose(element):
    origin = element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    xyz = np.array([float(w) for w in origin.get("xyz", "0 0 0").split()])
    return _rpy(origin.get("rpy")), xyz


class Chair:
    """Boxes and cylinders in `wheelchair_root`, with names, and visual meshes."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.urdf = xml.parse(self.folder / "wheelarm.urdf").getroot()
        self.links = self._links({})
        self.solids = []
        for name in LINKS:
            rotation, at = self.links[name]
            for solid in self._link(name).findall("collision"):
                local, xyz = _pose(solid)
                shape = solid.find("geometry")[0]
                if shape.tag == "box":
                    half = np.array([float(w) for w in shape.get("size").split()]) / 2
                else:
                    radius, length = float(shape.get("radius")), float(shape.get("length"))
                    half = np.array([radius, radius, length / 2])
                self.solids.append(
                    (f"{name}/{solid.get('name')}", shape.tag, rotation @ local, at + rotation @ xyz, half)
                )
        lower, upper = self._bounds("meshes/chair_joystick.obj")
        self.joystick = (lower, upper)
        self.solids.append(
            ("joystick", "box", np.eye(3), (lower + upper) / 2, (upper - lower) / 2)
        )
        self.seat_top = self.top("seat")
        self.plate_top = self.top("floor_plate")
        _, _, _, at, half = self.solid("backrest")
        self.back = at[0] + half[0]

    def _link(self, name):
        return next(link for link in self.urdf.findall("link") if link.get("name") == name)

    def _links(self, angles):
        """World pose of every link, joints at `angles` (rad) by name, default 0."""
        poses = {"wheelchair_root": (np.eye(3), np.zeros(3))}
        joints = list(self.urdf.findall("joint"))
        while joints:
            rest = []
            for joint in joints:
                parent = joint.find("parent").get("link")
                if parent not in poses:
                    rest.append(joint)
                    continue
                rotation, at = poses[parent]
                local, xyz = _pose(joint)
                angle = angles.get(joint.get("name"), 0.0)
                axis = joint.find("axis")
                if angle and axis is not None:
                    direction = np.array([float(w) for w in axis.get("xyz").split()])
                    local = local @ turn(direction, np.degrees(angle))
                poses[joint.find("child").get("link")] = (rotation @ local, at + rotation @ xyz)
            if len(rest) == len(joints):
                raise ValueError("URDF has joints that are not connected to wheelchair_root")
            joints = rest
        return poses

    def solid(self, name):
        return next(s for s in self.solids if s[0].split("/")[-1] == name)

    def top(self, name):
        _, _, _, at, half = self.solid(name)
        return float(at[2] + half[2])

    def raised(self, cushion):
        """The solids with a cushion on the seat, m thick."""
        out = []
        for name, kind, rotation, at, half in self.solids:
            if name.endswith("/seat"):
                at = at + [0, 0, cushion / 2]
                half = half + [0, 0, cushion / 2]
            out.append((name, kind, rotation, at, half))
        return out

    def _bounds(self, file):
        points, _ = load_obj(self.folder / file)
        return points.min(axis=0), points.max(axis=0)

    def visuals(self, angles):
        """(points in wheelchair_root, triangles, material name) of every visual mesh."""
        poses = self._links(angles)
        for link in self.urdf.findall("link"):
            rotation, at = poses[link.get("name")]
            for visual in link.findall("visual"):
                mesh = visual.find("geometry").find("mesh")
                if mesh is None:
                    continue
                local, xyz = _pose(visual)
                points, triangles = load_obj(self.folder / mesh.get("filename"))
                points = (points @ local.T + xyz) @ rotation.T + at
                yield points, triangles, visual.find("material").get("name")

    def colors(self):
        return {
            m.get("name"): [float(w) for w in m.find("color").get("rgba").split()][:3]
            for m in self.urdf.findall("material")
        }


def load_obj(path):
    points, triangles = [], []
    for line in open(path):
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            index = [int(w.split("/")[0]) - 1 for w in words[1:]]
            triangles += [[index[0], index[k], index[k + 1]] for k in range(1, len(index) - 1)]
    return np.array(points), np.array(triangles)


def depth(solid, points):
    """Depth of points (N, 3) in a solid, m; 0 outside."""
    _, kind, rotation, at, half = solid
    local = (points - at) @ rotation
    if kind == "box":
        inside = (half - np.abs(local)).min(axis=1)
    else:
        inside = np.minimum(
            half[0] - np.hypot(local[:, 0], local[:, 1]), half[2] - np.abs(local[:, 2])
        )
    return np.maximum(inside, 0.0)
