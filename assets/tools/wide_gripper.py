#!/usr/bin/env python3
"""Writes assets/robots/wheelarm_wide: chair and arm of assets/robots/wheelarm with another
gripper, of 0.14 m stroke and 60 N.

    python3 assets/tools/wide_gripper.py           writes the folder
    python3 assets/tools/wide_gripper.py --check   fails when the folder is out of date

Run it again after a change of this file or of assets/robots/wheelarm, and commit what it
writes. The gripper is authored here, of plain solids; its license is that of the project,
Apache-2.0. Units: m, kg, rad, s, N, N·m.
"""

import math
import re
import sys
from pathlib import Path

ROBOTS = Path(__file__).resolve().parents[1] / "robots"
SOURCE, OUT = ROBOTS / "wheelarm", ROBOTS / "wheelarm_wide"
NOTE = "Written by assets/tools/wide_gripper.py for WheelArm; license: Apache-2.0."

# Parallelogram of the left finger, in the frame of the hand: x to the left, z along the hand.
PIN = (0.040, 0.050)  # axis of the knuckle
CRANK = (0.060, 0.060)  # from the axis of the knuckle to that of the finger tip, open
INNER = (-0.020, 0.006)  # from the axis of the finger tip to the pin of the inner knuckle
PAD_FACE = 0.030  # from the axis of the finger tip inwards to the face of the pad
PAD = (0.008, 0.026, 0.048)  # size of the pad
PAD_Z = 0.034  # from the axis of the finger tip to the middle of the pad
CLOSED, UPPER = 0.898, 0.9  # commanded and mechanical end of the knuckle, rad
SPEED, EFFORT = 0.5, 20.0  # of the knuckle, rad/s and N·m
STROKE = 2.0 * (PIN[0] + CRANK[0] - PAD_FACE)
LEAN = math.atan2(*CRANK)  # of the crank from the hand's direction, about y

# Solids in the frames of their links: size along x, y and z, middle, turn about y.
HEAD = ((0.110, 0.032, 0.045), (0.0, 0.0, 0.0625), 0.0)
ROUND = (0.0375, 0.040)  # radius and height of the round part at the wrist
BAR = ((0.014, 0.026, math.hypot(*CRANK)), (CRANK[0] / 2, 0.0, CRANK[1] / 2), LEAN)
ROD = ((0.010, 0.034, math.hypot(*CRANK)), (-CRANK[0] / 2, 0.0, -CRANK[1] / 2), LEAN)
HOLDER = ((0.012, 0.026, 0.052), (-0.016, 0.0, 0.032), 0.0)
PIVOT = ((0.030, 0.024, 0.018), (-0.010, 0.0, 0.003), 0.0)
PAD_BOX = (PAD, (PAD[0] / 2 - PAD_FACE, 0.0, PAD_Z), 0.0)
MASS = {"round": 0.45, "head": 0.30, "bar": 0.060, "rod": 0.030, "tip": 0.055}


def text(*values):
    return " ".join(f"{value:.9g}" for value in values)


def box_inertia(mass, size):
    x, y, z = (edge * edge * mass / 12.0 for edge in size)
    return [y + z, x + z, x + y]


def inertial(mass, middle, moments, turn=0.0):
    """Mass element of a solid with these moments about its own axes, turned about y."""
    sin, cos = math.sin(turn), math.cos(turn)
    ixx = moments[0] * cos * cos + moments[2] * sin * sin
    izz = moments[0] * sin * sin + moments[2] * cos * cos
    ixz = (moments[2] - moments[0]) * sin * cos + 0.0  # not -0
    return f"""    <inertial>
      <origin xyz="{text(*middle)}"/>
      <mass value="{text(mass)}"/>
      <inertia ixx="{text(ixx)}" iyy="{text(moments[1])}" izz="{text(izz)}" ixy="0" ixz="{text(ixz)}" iyz="0"/>
    </inertial>
"""


def hand_inertial():
    """Round part and head together, by the parallel axis theorem."""
    radius, height = ROUND
    parts = [
        (MASS["round"], height / 2, [(3 * radius**2 + height**2) / 12.0] * 2 + [radius**2 / 2]),
        (MASS["head"], HEAD[1][2], [i / MASS["head"] for i in box_inertia(MASS["head"], HEAD[0])]),
    ]
    mass = sum(part[0] for part in parts)
    z = sum(part[0] * part[1] for part in parts) / mass
    moments = [0.0, 0.0, 0.0]
    for own, at, shares in parts:
        for axis in range(3):
            moments[axis] += own * (shares[axis] + ((at - z) ** 2 if axis < 2 else 0.0))
    return inertial(mass, (0.0, 0.0, z), moments)


def mirrored(solid, side):
    size, (x, y, z), turn = solid
    return size, (side * x, y, z), side * turn


def collision(name, solid):
    size, middle, turn = solid
    rpy = f' rpy="{text(0, turn, 0)}"' if turn else ""
    return f"""    <collision name="{name}">
      <origin xyz="{text(*middle)}"{rpy}/>
      <geometry><box size="{text(*size)}"/></geometry>
    </collision>
"""


def visual(mesh, side, material="gripper_body"):
    """A mesh of the left side; half a turn about z makes it that of the right side."""
    rpy = "" if side > 0 else f' rpy="0 0 {math.pi!r}"'
    return f"""    <visual name="{mesh}">
      <origin xyz="0 0 0"{rpy}/>
      <geometry><mesh filename="meshes/{mesh}.obj"/></geometry>
      <material name="{material}"/>
    </visual>
"""


def joint(name, parent, child, origin, sign, mimic=None):
    """A joint about -y that opens at 0; `sign` is that of its closed position."""
    lower, upper = (0.0, UPPER) if sign > 0 else (-UPPER, 0.0)
    follows = f'    <mimic joint="{mimic}" multiplier="{sign}"/>\n' if mimic else ""
    return f"""  <joint name="{name}" type="revolute">
    <parent link="{parent}"/>
    <child link="{child}"/>
    <origin xyz="{text(*origin)}"/>
    <axis xyz="0 -1 0"/>
    <limit lower="{text(lower)}" upper="{text(upper)}" velocity="{text(SPEED)}" effort="{text(EFFORT)}"/>
{follows}  </joint>
"""


def finger(name, side):
    master = "wide_left_knuckle_joint"
    size, middle, turn = mirrored(BAR, side)
    knuckle = f"""  <link name="wide_{name}_knuckle_link">
{inertial(MASS["bar"], middle, box_inertia(MASS["bar"], size), turn)}{collision("crank", mirrored(BAR, side))}{visual("crank", side)}  </link>
"""
    pad = mirrored(PAD_BOX, side)
    tip = f"""  <link name="wide_{name}_finger_tip_link">
{inertial(MASS["tip"], (side * -0.020, 0.0, 0.030), box_inertia(MASS["tip"], (0.020, 0.026, 0.060)))}{collision("pad", pad)}{collision("holder", mirrored(HOLDER, side))}{collision("pivot", mirrored(PIVOT, side))}{visual("tip", side)}    <visual name="pad">
      <origin xyz="{text(*pad[1])}"/>
      <geometry><box size="{text(*pad[0])}"/></geometry>
      <material name="gripper_pad"/>
    </visual>
  </link>
"""
    size, middle, turn = mirrored(ROD, side)
    inner = f"""  <link name="wide_{name}_inner_knuckle_link">
{inertial(MASS["rod"], middle, box_inertia(MASS["rod"], size), turn)}{collision("rod", mirrored(ROD, side))}{visual("rod", side)}  </link>
"""
    hand, at = "wide_hand_link", (side * PIN[0], 0.0, PIN[1])
    links = [f"wide_{name}_{part}_link" for part in ("knuckle", "finger_tip", "inner_knuckle")]
    knuckle += joint(
        f"wide_{name}_knuckle_joint", hand, links[0], at, side, None if side > 0 else master
    )
    tip += joint(
        f"wide_{name}_finger_tip_joint",
        links[0],
        links[1],
        (side * CRANK[0], 0.0, CRANK[1]),
        -side,
        master,
    )
    inner += joint(
        f"wide_{name}_inner_knuckle_joint",
        links[1],
        links[2],
        (side * INNER[0], 0.0, INNER[1]),
        side,
        master,
    )
    return knuckle + tip + inner


def urdf():
    source = (SOURCE / "wheelarm.urdf").read_text()
    head, mark = source.index("<robot "), source.index("  <!-- ===== Gripper")
    kept = source[head:mark].replace('name="wheelarm"', 'name="wheelarm_wide"')
    kept = kept.replace('filename="meshes/', 'filename="../wheelarm/meshes/')
    radius, height = ROUND
    return f"""<?xml version="1.0"?>
<!-- {NOTE}
     Chair and arm are those of ../wheelarm/wheelarm.urdf; its header names their sources.
     The gripper is authored by this project: plain solids of uniform density. -->
{kept}  <!-- ===== Gripper: pad faces are the planes x = -{PAD_FACE} (left) and x = {PAD_FACE} (right) of the tips. ===== -->
  <link name="wide_hand_link">
{hand_inertial()}    <collision name="body">
      <origin xyz="{text(0, 0, height / 2)}"/>
      <geometry><cylinder radius="{text(radius)}" length="{text(height)}"/></geometry>
    </collision>
{collision("head", HEAD)}{visual("hand", 1)}  </link>
  <joint name="wide_hand_joint" type="fixed">
    <parent link="end_effector_link"/>
    <child link="wide_hand_link"/>
    <origin xyz="0 0 0"/>
  </joint>
{finger("left", 1)}{finger("right", -1)}</robot>
"""


GRIPPER = f"""[gripper]
# Largest commanded distance between the pads, m. [design: assets/tools/wide_gripper.py]
stroke = {STROKE:.9g}
# Greatest knuckle angle that is commanded: 0.9 mm between the pads, rad. [design]
closed = {CLOSED}
# Knuckle speed, rad/s. [choice]
speed = {SPEED}
# Knuckle acceleration, rad/s². [choice: full speed within 0.1 s]
acceleration = 5.0
# Gains of each knuckle, N·m/rad and N·m·s/rad. [choice: the usual force is reached 0.01 rad
# behind the target; damped as the gripper of wheelarm, by the armature]
stiffness = 300.0
damping = 4.6
# Viscous friction of each knuckle, N·m·s/rad. [choice]
viscous_friction = 0.1
# Inertia of the motor at each knuckle and of the linkage at each finger tip, kg·m². [choice]
knuckle_armature = 0.008
tip_armature = 0.0015
# Upper bound of the travel of any point of a finger per knuckle angle, m/rad. [choice: 1.8
# times the crank's length]
finger_lever = 0.15
# Force cap at each pad, N: default and greatest. [choice: a gentle gripper]
force = 40.0
max_force = 60.0
# Balls for planning: middle x, y, z and radius, m. [fitted to the collision shapes]
# Wrist, camera and palm, in the end effector's frame.
hand_balls = [
  [0.0, 0.0, -0.165, 0.037],
  [0.0, 0.0, -0.11, 0.0385],
  [0.0, 0.0, -0.06, 0.0395],
  [0.0, 0.0, -0.02, 0.0395],
  [0.0, 0.056, -0.012, 0.022],
  [0.032, 0.056, -0.012, 0.020],
  [-0.032, 0.056, -0.012, 0.020],
  [0.0, 0.0, 0.02, 0.0385],
  [0.0, 0.0, 0.063, 0.026],
  [0.022, 0.0, 0.063, 0.026],
  [-0.022, 0.0, 0.063, 0.026],
  [0.038, 0.0, 0.063, 0.024],
  [-0.038, 0.0, 0.063, 0.024],
]
# The left crank, from the knuckle's axis, at angle 0.
crank_balls = [
  [0.015, 0.0, 0.015, 0.014],
  [0.030, 0.0, 0.030, 0.014],
  [0.045, 0.0, 0.045, 0.014],
  [0.060, 0.0, 0.060, 0.014],
]
# The left finger tip, from its axis.
tip_balls = [
  [-0.0195, 0.0, 0.012, 0.0125],
  [-0.0195, 0.0, 0.027, 0.0125],
  [-0.0195, 0.0, 0.040, 0.0125],
  [-0.022, -0.006, 0.050, 0.009],
  [-0.022, 0.006, 0.050, 0.009],
]

# Space that the hand needs with open fingers on its way to an object, about the grasp
# point, m. The sampling of a scene leaves each object such a way. [choice: gripper with
# camera and wrist, and some room]
[gripper.corridor]
# Half widths of the open fingers, and of palm and wrist with the camera.
fingers = 0.115
wrist = 0.058
# The tips extend this far beyond, the fingers this far back, the wrist ends here.
tip = 0.045
palm = 0.125
back = 0.48
# Half heights of fingers and palm.
fingers_height = 0.02
palm_height = 0.042
# From above, the wrist extends down to this height above.
above = 0.12

"""

NAMES = {
    "robotiq_85_base_link": "wide_hand_link",
    "left_inner_knuckle_finger_tip_joint": "wide_left_inner_knuckle_joint",
    "right_inner_knuckle_finger_tip_joint": "wide_right_inner_knuckle_joint",
    "robotiq_85_": "wide_",
}


def only(pattern, new, text):
    """Replaces the only match, so that a change of the source is noticed."""
    found, count = re.subn(pattern, lambda _: new, text, flags=re.DOTALL | re.MULTILINE)
    if count != 1:
        raise SystemExit(f"cannot write the robot: {count} matches of {pattern!r} in robot.toml")
    return found


def settings():
    toml = (SOURCE / "robot.toml").read_text()
    toml = only(
        r"\A.*?^name = \"wheelarm\"\nurdf = \"wheelarm.urdf\"\n",
        f"""# {NOTE}
# Chair and arm with the numbers of ../wheelarm/robot.toml, and a wider, weaker gripper.
# Units: m, kg, rad, s, N, N·m unless a name says otherwise.
# Origins in brackets: [source], [derived], [measured here], [guess].

name = "wheelarm_wide"
urdf = "wheelarm_wide.urdf"
""",
        toml,
    )
    toml = only(
        r"^# \[source: tool_frame of ros_kortex, 0.120\]\ntool_length = 0.120\n",
        "# [choice: 0.02 before the middle of the pads around an object of 0.06, as in wheelarm]\n"
        "tool_length = 0.148\n",
        toml,
    )
    # Measured with the other gripper.
    toml = only(r"^# Other positions of the arm in which.*?^\]\n", "", toml)
    toml = only(r"^# The arm beside the seat.*?(?=^\[reach\])", "", toml)
    toml = only(
        r"^# With the hand, .*?footprint = .*?\n",
        "# With the hand, 0.22 m before and 0.09 m beside the rest. [derived: wheelarm and the\n"
        "# difference of the open grippers]\n"
        "top = 1.50\n"
        "footprint = [-0.193, 1.013, -0.280, 0.505]\n",
        toml,
    )
    toml = only(
        r"^# From base_link to an object.*?furthest = 0.88\n",
        "# From base_link to an object within reach, on the floor plan, m. [derived: wheelarm and the\n"
        "# difference of the tool lengths]\n"
        "nearest = 0.45\n"
        "furthest = 0.90\n",
        toml,
    )
    toml = only(r"^\[gripper\]\n.*?(?=^# Where a person sits)", GRIPPER, toml)
    for old, new in NAMES.items():
        toml = toml.replace(old, new)
    return toml


class Mesh:
    """Convex solids with flat faces."""

    def __init__(self):
        self.vertices, self.faces = [], []

    def rings(self, rings):
        """Skin between closed rings of equally many points, and flat ends."""
        rows = []
        for ring in rings:
            first = len(self.vertices) + 1
            self.vertices += ring
            rows.append(list(range(first, first + len(ring))))
        for low, high in zip(rows, rows[1:]):
            for i, (a, b) in enumerate(zip(low, low[1:] + low[:1])):
                c, d = high[(i + 1) % len(high)], high[i]
                self.faces += [(a, b, c), (a, c, d)]
        for row, flip in ((rows[0], True), (rows[-1], False)):
            for b, c in zip(row[1:], row[2:]):
                self.faces.append((row[0], c, b) if flip else (row[0], b, c))

    def box(self, solid):
        (sx, sy, sz), (x, y, z), turn = solid
        sin, cos = math.sin(turn), math.cos(turn)
        ring = [(-1, -1), (1, -1), (1, 1), (-1, 1)]

        def corner(i, j, k):
            u, w = i * sx / 2, k * sz / 2
            return (x + u * cos + w * sin, y + j * sy / 2, z - u * sin + w * cos)

        self.rings([[corner(i, j, k) for i, j in ring] for k in (-1, 1)])

    def cylinder(self, start, axis, radius, sides=24):
        """From a point along `axis`, which is y or z by a length."""
        turns = [2.0 * math.pi * i / sides for i in range(sides)]
        circle = [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
        x, y, z = start
        if axis[0] == "z":
            rows = [[(x + u, y + v, z + h) for u, v in circle] for h in (0.0, axis[1])]
        else:
            rows = [[(x + v, y + h, z + u) for u, v in circle] for h in (0.0, axis[1])]
        self.rings(rows)

    def pin(self, x, z, radius, width):
        self.cylinder((x, -width / 2, z), ("y", width), radius)

    def text(self):
        """The mesh as OBJ."""
        lines = [f"# {NOTE} Metres, z up."]
        lines += ["v {:.5f} {:.5f} {:.5f}".format(*vertex) for vertex in self.vertices]
        lines += ["f {} {} {}".format(*face) for face in self.faces]
        return "\n".join(lines) + "\n"


def meshes():
    """Texts of the mesh files, by name."""
    hand, crank, rod, tip = Mesh(), Mesh(), Mesh(), Mesh()
    hand.cylinder((0.0, 0.0, 0.0), ("z", ROUND[1]), ROUND[0])
    hand.box(HEAD)
    crank.box(BAR)
    crank.pin(0.0, 0.0, 0.009, BAR[0][1])
    crank.pin(*CRANK, 0.009, BAR[0][1])
    rod.box(ROD)
    rod.pin(0.0, 0.0, 0.006, ROD[0][1])
    rod.pin(-CRANK[0], -CRANK[1], 0.006, ROD[0][1])
    tip.box(HOLDER)
    tip.box(PIVOT)
    made = {"hand": hand, "crank": crank, "rod": rod, "tip": tip}
    return {f"{name}.obj": mesh.text() for name, mesh in made.items()}


def files():
    """Texts of all files, by path below the folder of the robot."""
    written = {"wheelarm_wide.urdf": urdf(), "robot.toml": settings()}
    written |= {f"meshes/{name}": mesh for name, mesh in meshes().items()}
    return written


def outdated(written):
    """Paths whose file differs from its text, is missing, or is not written here."""
    found = {str(path.relative_to(OUT)) for path in OUT.rglob("*") if path.is_file()}
    # Written by assets/tools/reach_map.rs.
    found -= {"reach.bin"}
    both = found & written.keys()
    different = {path for path in both if (OUT / path).read_text() != written[path]}
    return sorted(different | (found ^ written.keys()))


def main():
    written = files()
    if "--check" in sys.argv[1:]:
        if old := outdated(written):
            raise SystemExit(
                f"{OUT} is out of date: {', '.join(old)}; run python3 assets/tools/wide_gripper.py"
            )
        return
    for path, content in written.items():
        (OUT / path).parent.mkdir(parents=True, exist_ok=True)
        (OUT / path).write_text(content)
    print(f"{OUT}: stroke {STROKE:.3f} m, closed at {CLOSED} rad")


if __name__ == "__main__":
    main()
