#!/usr/bin/env python3
"""Writes the meshes of `assets/kinds.toml`: OBJ with MTL, label images, and convex parts.

    python3 assets/tools/object_meshes.py OUT [--import WHEELARM] [KIND …]

With --import, the objects of each pack are imported into assets/packs by this program, as
`make assets` does; else one line of JSON for each object has its name, pack, and the options of
`wheelarm object import`. Metres, z up; equal tables give equal bytes.
"""

import argparse
import concurrent.futures
import json
import math
import os
import pathlib
import struct
import subprocess
import sys
import tomllib
import zlib

ASSETS = pathlib.Path(__file__).resolve().parent.parent
SIDES = 32
# Sectors of the wall of a hollow part that is not round as a whole.
SECTORS = 12
# Columns of 5 x 7 characters, the lowest bit on top.
FONT = dict(zip("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", (
    "7E1111117E 7F49494936 3E41414122 7F4141221C 7F49494941 7F09090901 3E4149497A 7F0808087F "
    "00417F4100 2040413F01 7F08142241 7F40404040 7F020C027F 7F0408107F 3E4141413E 7F09090906 "
    "3E4151215E 7F09192946 4649494931 01017F0101 3F4040403F 1F2040201F 3F4038403F 6314081463 "
    "0708700807 6151494543 3E5149453E 00427F4000 4261514946 2141454B31 1814127F10 2745454539 "
    "3C4A494930 0171090503 3649494936 064949291E").split(), strict=True))


class Mesh:
    """Triangles of one material each, and convex groups of points for collision."""

    def __init__(self):
        self.faces = []  # material, three points, three texture coordinates or None
        self.hulls = []

    def polygon(self, material, points, uvs=None):
        """A convex polygon, counter-clockwise from outside."""
        for k in range(1, len(points) - 1):
            pick = (0, k, k + 1)
            self.faces.append((material, [points[i] for i in pick], uvs and [uvs[i] for i in pick]))

    def swept(self, material, rings, closed_ends=True):
        """Quads between closed rings of equal length, and flat ends."""
        count = len(rings[0])
        for low, high in zip(rings, rings[1:]):
            for j in range(count):
                k = (j + 1) % count
                self.polygon(material, [low[j], low[k], high[k], high[j]])
        if closed_ends:
            self.polygon(material, rings[0][::-1])
            self.polygon(material, rings[-1])


def circle(radius, z, sides=SIDES):
    turn = [math.tau * j / sides for j in range(sides)]
    return [(radius * math.cos(t), radius * math.sin(t), z) for t in turn]


def lathe(mesh, part, colour):
    """Revolves a profile of [radius, z] from the bottom to the top of the axis. `hollow`: it goes
    over the rim and down to the inner floor."""
    profile = [tuple(p) for p in part["lathe"]]
    band = None
    if part.get("label"):
        # The middle of the longest upright piece.
        lengths = [b[1] - a[1] if abs(a[0] - b[0]) < 1e-4 else 0 for a, b in zip(profile, profile[1:])]
        longest = lengths.index(max(lengths))
        (radius, low), (_, high) = profile[longest], profile[longest + 1]
        edge = 0.12 * (high - low)
        profile[longest + 1:longest + 1] = [(radius, low + edge), (radius, high - edge)]
        band = longest + 1
    rings = [circle(r, z) for r, z in profile]
    count = len(rings[0])
    if profile[0][0] > 0:
        mesh.polygon(colour, rings[0][::-1])
    if profile[-1][0] > 0:
        mesh.polygon(colour, rings[-1])
    for i, (low, high) in enumerate(zip(rings, rings[1:])):
        for j in range(count):
            k = (j + 1) % count
            if i == band:
                around = (profile[i][0] * math.tau) / (profile[i + 1][1] - profile[i][1])
                times = max(1, round(around))
                u, w = times * j / count, times * (j + 1) / count
                mesh.polygon("label", [low[j], low[k], high[k], high[j]], [(u, 0), (w, 0), (w, 1), (u, 1)])
                continue
            points = [low[j], low[k], high[k], high[j]]
            points = [p for n, p in enumerate(points) if p not in points[:n]]
            if len(points) > 2:
                mesh.polygon(colour, points)
    turn = [math.tau * s / SECTORS for s in range(SECTORS + 1)]
    if part.get("hollow"):
        rim = max(range(len(profile)), key=lambda i: profile[i][1])
        outer, inner = profile[:rim + 1], profile[rim + 1:]
        floor = inner[-1][1]
        at = lambda r, z, t: (r * math.cos(t), r * math.sin(t), z)
        for a, b in zip(turn, turn[1:]):
            wall = [p for p in outer + inner if p[0] > 0.3 * max(r for r, _ in outer)]
            mesh.hulls.append([at(r, z, t) for r, z in wall for t in (a, (a + b) / 2, b)])
        base = [p for p in outer if p[1] <= floor + 1e-6] + [(inner[0][0], floor)]
        mesh.hulls.append([at(r, z, t) for r, z in base for t in turn[:-1]])
    else:
        for a, b in zip(profile, profile[1:]):
            if b[1] - a[1] > 6e-4:
                mesh.hulls.append([p for r, z in (a, b) for p in circle(max(r, 5e-4), z, 12)])


def extruded(mesh, colour, outline, low, high, label):
    """A convex outline in x and y, counter-clockwise, from height `low` to `high`."""
    rings = [[(x, y, z) for x, y in outline] for z in (low, high)]
    count = len(outline)
    for j in range(count):
        k = (j + 1) % count
        (x, y), (u, v) = outline[j], outline[k]
        length = math.hypot(u - x, v - y)
        shown = label == "sides" and length > 0.012 or label == "front" and length > 0.012 and abs(u - x) > 0.9 * length
        uvs = [(0, 0), (1, 0), (1, 1), (0, 1)] if shown else None
        mesh.polygon("label" if shown else colour, [rings[0][j], rings[0][k], rings[1][k], rings[1][j]], uvs)
    mesh.polygon(colour, rings[0][::-1])
    xs, ys = [x for x, _ in outline], [y for _, y in outline]
    wide, deep = max(xs) - min(xs), max(ys) - min(ys)
    uvs = [((x - min(xs)) / wide, (y - min(ys)) / deep) for x, y in outline]
    mesh.polygon("label" if label == "top" else colour, rings[1], uvs if label == "top" else None)
    mesh.hulls.append(rings[0] + rings[1])


def beveled(x, y, bevel):
    x, y = x / 2, y / 2
    if bevel <= 0:
        return [(-x, -y), (x, -y), (x, y), (-x, y)]
    b = bevel
    return [(-x + b, -y), (x - b, -y), (x, -y + b), (x, y - b), (x - b, y), (-x + b, y), (-x, y - b), (-x, -y + b)]


def made(part):
    """The mesh of a part about its own origin: the middle of its base, or of a rod and a ball."""
    mesh, colour = Mesh(), part.get("color", "body")
    label = part.get("label")
    if "lathe" in part:
        lathe(mesh, part, colour)
    elif "box" in part:
        x, y, z = part["box"]
        extruded(mesh, colour, beveled(x, y, part.get("bevel", 0)), 0, z, label)
    elif "prism" in part:
        outline, length = part["prism"]
        extruded(mesh, colour, [tuple(p) for p in outline], 0, length, label)
    elif "rod" in part:
        radius, length = part["rod"]
        sides = part.get("sides", 12)
        # Flat below and above.
        outline = [(radius * math.cos(math.tau * (j + 0.5) / sides), radius * math.sin(math.tau * (j + 0.5) / sides))
                   for j in range(sides)]
        extruded(mesh, colour, outline, -length / 2, length / 2, None)
    elif "ball" in part:
        radii = part["ball"]
        steps = 10
        half = [(math.sin(math.pi * i / steps), -math.cos(math.pi * i / steps)) for i in range(1, steps)]
        rings = [[(radii[0] * x, radii[1] * y, radii[2] * z) for x, y, _ in circle(r, 0, 20)] for r, z in half]
        mesh.swept(colour, rings)
        mesh.hulls.append([p for ring in rings for p in ring[::2]])
    elif "tube" in part:
        tube(mesh, colour, part["tube"], part["radius"])
    else:
        raise SystemExit(f"a part without a shape: {part}; give lathe, box, prism, rod, ball or tube")
    return mesh


def tube(mesh, colour, path, radius):
    """A tube in the plane of x and z along a path of [x, z]."""
    rings, last = [], len(path) - 1
    for i, (x, z) in enumerate(path):
        (ax, az), (bx, bz) = path[max(i - 1, 0)], path[min(i + 1, last)]
        length = math.hypot(bx - ax, bz - az)
        dx, dz = (bx - ax) / length, (bz - az) / length
        ring = []
        for j in range(8):
            s, c = math.sin(math.tau * j / 8), math.cos(math.tau * j / 8)
            # y, and the direction across the path within the plane: a right-handed ring.
            ring.append((x - dz * s * radius, c * radius, z + dx * s * radius))
        rings.append(ring)
    mesh.swept(colour, rings)
    mesh.hulls.extend(a + b for a, b in zip(rings, rings[1:]))


AXES = {
    "z": lambda p: p,
    # The outline's x and y become y and z.
    "x": lambda p: (p[2], p[0], p[1]),
    # They become x and z.
    "y": lambda p: (p[0], -p[2], p[1]),
}


def placed(part):
    mesh = made(part)
    axis = AXES[part.get("axis", "z")]
    at = part.get("at", [0, 0, 0])
    turn = math.radians(part.get("yaw_deg", 0))
    sin, cos = math.sin(turn), math.cos(turn)

    def move(point):
        x, y, z = axis(point)
        return (x * cos - y * sin + at[0], x * sin + y * cos + at[1], z + at[2])
    mesh.faces = [(m, [move(p) for p in points], uvs) for m, points, uvs in mesh.faces]
    mesh.hulls = [[move(p) for p in hull] for hull in mesh.hulls]
    return mesh


def png(pixels, side):
    rows = b"".join(b"\0" + bytes(c for pixel in row for c in pixel) for row in pixels)
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    head = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


def rgb(text):
    return tuple(int(text[i:i + 2], 16) for i in (1, 3, 5))


def label_image(text, ground, ink, side=64):
    """Words below each other between two bands."""
    ground, ink = rgb(ground), rgb(ink)
    pixels = [[ink if y in range(3, 8) or y in range(side - 8, side - 3) else ground for _ in range(side)]
              for y in range(side)]
    words = text.upper().split()
    # Larger characters for short words.
    size = max(1, min((side - 4) // (6 * max(map(len, words))), (side - 22) // (8 * len(words))))
    top = (side - 8 * size * len(words)) // 2
    for row, word in enumerate(words):
        left = (side - 6 * size * len(word)) // 2
        for n, character in enumerate(word):
            columns = bytes.fromhex(FONT[character])
            for x in range(5 * size):
                for y in range(7 * size):
                    if columns[x // size] >> (y // size) & 1:
                        pixels[top + 8 * size * row + y][left + 6 * size * n + x] = ink
    return png(pixels, side)


def number(value):
    text = f"{value:.6f}"
    return "0.000000" if text == "-0.000000" else text


def write(folder, kind, instance):
    """Writes the files of one object and returns its line."""
    name = f"{kind['name']}-{instance['name']}"
    scale = instance.get("scale", 1)
    scale = scale if isinstance(scale, list) else [scale] * 3
    colours = {**kind.get("colors", {}), **instance.get("colors", {})}
    text = instance.get("label", kind.get("label"))
    faces, hulls, is_round = [], [], True
    for part in kind["part"]:
        if not text and part.get("label"):
            part = {**part, "label": None}
        mesh = placed(part)
        at = part.get("at", [0, 0, 0])
        is_round &= "lathe" in part and abs(at[0]) + abs(at[1]) == 0 and part.get("axis", "z") == "z"
        faces += mesh.faces
        hulls += mesh.hulls if part.get("collide", True) else []
    sized = lambda p: [number(c * s) for c, s in zip(p, scale)]
    used = sorted({material for material, _, _ in faces})
    lines, materials = [f"mtllib {name}.mtl"], []
    for material in used:
        materials.append(f"newmtl {material}")
        if material == "label":
            ground, ink = colours.get("label", "#f4f1e6"), colours.get("ink", "#22303c")
            (folder / f"{name}.png").write_bytes(label_image(text, ground, ink))
            materials += ["Kd 1 1 1", f"map_Kd {name}.png"]
        else:
            if material not in colours:
                raise SystemExit(f"{name}: no color named {material!r}; add it to its colors")
            materials.append("Kd " + " ".join(f"{c / 255:.4f}" for c in rgb(colours[material])))
        materials.append(f"Ns {kind.get('gloss', 40)}")
    points, coordinates = {}, {}
    for material in used:
        lines.append(f"usemtl {material}")
        for _, corners, uvs in (face for face in faces if face[0] == material):
            words = []
            for k, corner in enumerate(corners):
                key = tuple(sized(corner))
                if key not in points:
                    points[key] = len(points) + 1
                    lines.append("v " + " ".join(key))
                word = str(points[key])
                if uvs:
                    uv = tuple(number(c) for c in uvs[k])
                    if uv not in coordinates:
                        coordinates[uv] = len(coordinates) + 1
                        lines.append("vt " + " ".join(uv))
                    word += f"/{coordinates[uv]}"
                words.append(word)
            lines.append("f " + " ".join(words))
    (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
    (folder / f"{name}.mtl").write_text("\n".join(materials) + "\n")
    mass = instance.get("mass", round(kind["mass"] * scale[0] * scale[1] * scale[2], 3))
    options = ["--category", kind["category"], "--name", name, "--up", "z", "--scale", "1", "--mass", str(mass),
               "--noun", kind["noun"], "--color", instance["name"], "--license", "Apache-2.0", "--author", "WheelArm"]
    if not is_round and len(hulls) > 1:
        lines, count = [], 0
        for n, hull in enumerate(hulls):
            lines.append(f"g part_{n}")
            lines += ["v " + " ".join(sized(p)) for p in hull]
            # Every point belongs to a face.
            fan = range(count + 2, count + len(hull))
            lines += [f"f {count + 1} {k} {k + 1}" for k in fan]
            count += len(hull)
        (folder / f"{name}_parts.obj").write_text("\n".join(lines) + "\n")
        options += ["--parts", str(folder / f"{name}_parts.obj")]
    if kind.get("held_out"):
        options += ["--held-out"]
    return {"name": name, "kind": kind["name"], "pack": kind["pack"], "file": str(folder / f"{name}.obj"),
            "options": options}


def imported(program, objects):
    """Imports the objects of a pack; returns the lines of the output that matter."""
    lines = []
    for made in objects:
        out = ASSETS / "packs" / made["pack"]
        command = [program, "object", "import", made["file"], *made["options"], "--assets", str(ASSETS), "--out", str(out)]
        run = subprocess.run(command, capture_output=True, text=True)
        if run.returncode != 0:
            raise SystemExit(f"{made['name']}: {run.stderr.strip()}")
        notes = [line for line in run.stdout.splitlines() if line.startswith(("note: ", "grasps: "))]
        lines.append(f"{made['name']}: " + "; ".join(line.removeprefix("note: ") for line in notes))
    return lines


def stale(objects):
    """Objects of the packs that the table does not name."""
    names = {(made["pack"], made["name"]) for made in objects}
    found = ((path.parent.parent.name, path.stem) for pack in {made["pack"] for made in objects}
             for path in (ASSETS / "packs" / pack / "objects").glob("*.toml"))
    return sorted(set(found) - names)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--import", dest="program", metavar="WHEELARM", help="program that imports the objects")
    parser.add_argument("kinds", nargs="*", help="only these kinds")
    args = parser.parse_args()
    table = tomllib.loads((ASSETS / "kinds.toml").read_text())
    args.out.mkdir(parents=True, exist_ok=True)
    known = {kind["name"] for kind in table["kind"]}
    if unknown := set(args.kinds) - known:
        raise SystemExit(f"no kind named {', '.join(sorted(unknown))}; available: {', '.join(sorted(known))}")
    objects = [write(args.out.resolve(), kind, instance) for kind in table["kind"] for instance in kind["instance"]
               if not args.kinds or kind["name"] in args.kinds]
    if not args.program:
        for made in objects:
            json.dump(made, sys.stdout)
            print()
        return
    packs = sorted({made["pack"] for made in objects})
    of_pack = [[made for made in objects if made["pack"] == pack] for pack in packs]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for lines in pool.map(lambda own: imported(args.program, own), of_pack):
            print("\n".join(lines), flush=True)
    if not args.kinds and (left := stale(objects)):
        words = ", ".join(f"{pack}/{name}" for pack, name in left)
        raise SystemExit(f"assets/kinds.toml has no longer {words}; remove their files from assets/packs")


if __name__ == "__main__":
    main()
