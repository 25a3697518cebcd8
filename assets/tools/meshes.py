#!/usr/bin/env python3
"""Writes the meshes of objects that are not made of simple shapes, to assets/meshes.

    python3 assets/tools/meshes.py

Metres, z up; a leaf is one metre long and scaled where it is used. After a change run it
again and commit its output. All shapes are defined here; none is a scan.
"""

import math
from pathlib import Path

OUT = Path(__file__).resolve().parents[1] / "meshes"


class Mesh:
    def __init__(self):
        self.vertices, self.faces = [], []

    def add(self, x, y, z):
        self.vertices.append((x, y, z))
        return len(self.vertices)

    def strip(self, first, second):
        """Two triangles between each pair of neighbors of two rows, wound first to second."""
        for a, b, c, d in zip(first, first[1:], second[1:], second):
            self.faces += [(a, b, c), (a, c, d)]

    def write(self, name):
        lines = ["# Written by assets/tools/meshes.py for WheelArm; license: Apache-2.0. Metres, z up."]
        lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in self.vertices]
        lines += ["f {} {} {}".format(*face) for face in self.faces if len(set(face)) == 3]
        (OUT / name).write_text("\n".join(lines) + "\n")
        print(f"{name:20} {len(self.vertices):5} vertices {len(self.faces):5} triangles")


def leaf():
    """A leaf along x from -0.5 to 0.5: pointed, folded along its rib, bent down at the tip."""
    mesh, steps = Mesh(), 6
    rows = []
    for i in range(steps + 1):
        s = i / steps
        half = 0.165 * math.sin(math.pi * s ** 0.8) + (0.012 if i < steps else 0.0)
        bend = 0.10 - 0.55 * (s - 0.38) ** 2
        rows.append([(s - 0.5, side * half, bend + 0.22 * abs(side) * half) for side in (-1, 0, 1)])
    for thick, flip in ((0.008, False), (0.0, True)):
        points = [[mesh.add(x, y, z + (thick if j == 1 else 0.0)) for j, (x, y, z) in enumerate(row)]
                  for row in rows]
        for row, following in zip(points, points[1:]):
            if flip:
                mesh.strip(following, row)
            else:
                mesh.strip(row, following)
    mesh.faces = [(a, c, b) for a, b, c in mesh.faces]
    mesh.write("leaf.obj")


def blade():
    """A knife's blade along x, flat in z, with its edge towards +y and a point at the spine."""
    mesh, steps = Mesh(), 14
    rows = []
    for i in range(steps + 1):
        s = i / steps
        x = 0.052 + 0.186 * s
        spine = -0.0150 + 0.004 * max(0.0, s - 0.75) ** 2 / 0.0625
        belly = 0.0190 if s < 0.45 else 0.0190 - 0.0300 * ((s - 0.45) / 0.55) ** 2.2
        edge = max(belly, spine)
        bevel = spine + 0.62 * (edge - spine)
        thick = 0.0011 * (1.0 - 0.6 * s)
        rows.append((x, spine, bevel, edge, thick))
    top, bottom = [], []
    for x, spine, bevel, edge, thick in rows:
        z = 0.011
        sharp = mesh.add(x, edge, z)
        top.append([mesh.add(x, spine, z + thick), mesh.add(x, bevel, z + thick), sharp])
        bottom.append([sharp, mesh.add(x, bevel, z - thick), mesh.add(x, spine, z - thick)])
    for side in (top, bottom):
        for row, following in zip(side, side[1:]):
            mesh.strip(following, row)
    for (a, *_), (*_, b), (c, *_), (*_, d) in zip(top, bottom, top[1:], bottom[1:]):
        mesh.faces += [(a, c, b), (b, c, d)]
    heel = [top[0][0], top[0][1], top[0][2], bottom[0][1], bottom[0][2]]
    mesh.faces += [(heel[0], heel[i + 1], heel[i]) for i in (1, 2, 3)]
    mesh.write("knife_blade.obj")


def loft(name, sections, around=40, power=4.0):
    """Rings of superellipses (half x, half y, z, shift of x and y), closed at both ends."""
    mesh, rings = Mesh(), []
    for half_x, half_y, z, off_x, off_y, squareness in sections:
        ring = []
        for k in range(around):
            angle = 2.0 * math.pi * k / around
            c, s = math.cos(angle), math.sin(angle)
            exponent = 2.0 / (2.0 + (power - 2.0) * squareness)
            x = off_x + half_x * math.copysign(abs(c) ** exponent, c)
            y = off_y + half_y * math.copysign(abs(s) ** exponent, s)
            ring.append(mesh.add(x, y, z))
        rings.append(ring + ring[:1])
    for low, high in zip(rings, rings[1:]):
        mesh.strip(low, high)
    for ring, z, up in ((rings[0], sections[0][2], False), (rings[-1], sections[-1][2], True)):
        middle = mesh.add(sections[0][3], sections[0][4], z)
        for a, b in zip(ring, ring[1:]):
            mesh.faces.append((middle, a, b) if up else (middle, b, a))
    return mesh, name


def mustard():
    """The body of a squeeze bottle: foot, waist, shoulders that narrow to the neck."""
    sections = []
    for z, share in ((0.0, 0.90), (0.003, 0.97), (0.010, 1.0), (0.055, 0.985), (0.080, 0.98),
                     (0.112, 0.99), (0.122, 1.0), (0.130, 0.985), (0.138, 0.93), (0.145, 0.82),
                     (0.151, 0.66), (0.156, 0.48), (0.160, 0.34)):
        neck = max(0.0, (z - 0.130) / 0.030)
        half_x = 0.048 * share * (1 - neck) + 0.0165 * neck
        half_y = min(0.029 * share, 0.029) * (1 - neck) + 0.0165 * neck
        sections.append((half_x, half_y, z, 0.0, 0.0, 1.0 - neck))
    mesh, name = loft("mustard_body.obj", sections)
    mesh.write(name)


def handle():
    """A knife's handle along x with a belly and a pommel, lofted along z and turned."""
    sections = []
    for x, half_y, half_z, off_y in ((-0.060, 0.0095, 0.0085, 0.003), (-0.057, 0.0125, 0.0105, 0.003),
                                     (-0.048, 0.0138, 0.011, 0.001), (-0.025, 0.0118, 0.0105, -0.001),
                                     (0.000, 0.0132, 0.011, 0.0), (0.030, 0.0120, 0.0105, -0.001),
                                     (0.050, 0.0128, 0.010, -0.001), (0.056, 0.0125, 0.0090, -0.001)):
        sections.append((half_z, half_y, x, 0.0, off_y, 0.5))
    mesh, name = loft("knife_handle.obj", sections, around=24)
    # The loft's axis becomes x, its x becomes z.
    mesh.vertices = [(z, y, 0.011 + x) for x, y, z in mesh.vertices]
    mesh.faces = [(a, c, b) for a, b, c in mesh.faces]
    mesh.write(name)


if __name__ == "__main__":
    OUT.mkdir(parents=True, exist_ok=True)
    leaf()
    blade()
    mustard()
    handle()
