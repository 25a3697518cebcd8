"""Seats a body in the wheelchair: pelvis on the seat, feet on the plate, hands as in the posture.

All positions are in the frame `wheelchair_root`: on the floor under the rear axle, x
forward, y left, z up. Legs and arms are two-bone chains with closed solutions. The
direction of the elbow and the height of the hand are searched, so that the arm does not
penetrate the chair or the body and the hand touches its support.
"""

from dataclasses import dataclass, field

import numpy as np

import rig
from chair import depth
from rig import FINGERS, INDEX, NAMES, between, turn

# Compression of body and upholstery together, m. [choice]
SINK_SEAT, SINK_BACK = 0.025, 0.012
# Thickest cushion that raises a long-legged person, m. [choice]
CUSHION = 0.03
# Where the toes may end: the plate's front end is 0.7925. [derived from the URDF]
TOES = 0.785
# Pitch of the trunk from the pelvis to the head, degrees forward: upright and stooped.
TRUNK = ["pelvis", "spine_1", "spine_2", "spine_3", "spine_4", "spine_5", "neck_1", "neck_2", "head"]
UPRIGHT = np.array([-12.0, -12, -11, -10, -9, -7, 0, 2, 4])
STOOPED = np.array([-16.0, -13, -8, 1, 10, 18, 28, 28, 13])
# Share of lean and turn of each of TRUNK, and share of the head motion.
LEAN = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.0, 1.0, 1.0])
HEAD = np.array([0.0, 0, 0, 0, 0, 0, 0.35, 0.7, 1.0])
# Fingers: bend of near and far joint, degrees.
RELAXED, FLAT, GRIP = (16, 22), (8, 10), (38, 50)
CELL = 0.006


@dataclass
class Person:
    """A dressed body at rest: mesh, vertex weights, joints, and posture parameters."""

    points: np.ndarray
    normals: np.ndarray
    weights: np.ndarray
    triangles: np.ndarray
    labels: np.ndarray
    rest: np.ndarray
    finger_ends: dict
    stoop: float
    # Part of a posture's lean forward that the belly lets it do.
    lean: float
    sole: float
    main: np.ndarray = field(init=False)

    def __post_init__(self):
        self.main = self.weights.argmax(axis=1)


@dataclass
class Pose:
    rotations: np.ndarray
    at: np.ndarray
    facts: dict

    def turns(self):
        """Rotation vectors (48, 3) of the joints against their parents, rad."""
        out = []
        for k, parent in enumerate(rig.PARENTS):
            own = self.rotations[k]
            out.append(rig.to_vector(own if parent < 0 else self.rotations[parent].T @ own))
        return np.array(out)


def _among(person, *names):
    return np.isin(person.main, [INDEX[n] for n in names])


def seat(person, chair, cushion, spec):
    """Pose of trunk, head and legs, with facts about the legs; arms as at rest."""
    pitch = (1 - person.stoop) * UPRIGHT + person.stoop * STOOPED
    pitch = pitch + LEAN * spec.get("lean_forward", 0.0) * person.lean + HEAD * spec.get("head_down", 0.0)
    roll = -LEAN * spec.get("lean_left", 0.0) - HEAD * spec.get("head_tilt_left", 0.0)
    yaw = LEAN * spec.get("turn_left", 0.0) + HEAD * spec.get("head_left", 0.0)
    world = {
        name: turn([0, 0, 1], y) @ turn([0, 1, 0], p) @ turn([1, 0, 0], r)
        for name, p, r, y in zip(TRUNK, pitch, roll, yaw)
    }
    # Shoulders are slightly lower than with raised arms.
    for side, sign in (("left", 1), ("right", -1)):
        world[f"{side}_clavicle"] = world["spine_5"] @ turn([1, 0, 0], -5 * sign)
    rest = person.rest
    thigh = np.linalg.norm(rest[INDEX["left_shank"]] - rest[INDEX["left_thigh"]])
    shank = np.linalg.norm(rest[INDEX["left_foot"]] - rest[INDEX["left_shank"]])
    ankle = rest[INDEX["left_foot"]][2] - person.sole
    upright = dict(world)
    for name, p in zip(TRUNK, (1 - person.stoop) * UPRIGHT + person.stoop * STOOPED):
        upright[name] = turn([0, 1, 0], p)
    tilt, lower, offset = 0.0, 6.0, np.zeros(3)
    bottom = _among(person, "pelvis", "left_thigh", "right_thigh")
    back = _among(person, *TRUNK[:6])
    for _ in range(8):
        # The position of the pelvis is found upright: leaning does not move it.
        rotations, at = _bodily(person, {**upright, **_legs(person, tilt, lower)}, np.zeros(3))
        points = rig.skin(person.points, person.weights, rest, rotations, at)
        lowest = np.percentile(points[bottom, 2], 1.5)
        near = back & (points[:, 2] > lowest + 0.12) & (points[:, 2] < lowest + 0.55)
        rear = np.percentile(points[near, 0], 0.7)
        offset = np.array(
            [chair.back - SINK_BACK - rear, 0.0, chair.seat_top + cushion - SINK_SEAT - lowest]
        )
        hip = at[INDEX["left_thigh"]] + offset
        need = hip[2] - chair.plate_top - ankle
        toes = points[_among(person, "left_foot", "right_foot"), 0].max() + offset[0]
        lower += np.degrees((TOES - toes) / shank) if toes > TOES else 0.0
        lower = min(max(lower, -13.0), 12.0)
        sine = (shank * np.cos(np.radians(lower)) - need) / thigh
        tilt = np.degrees(np.arcsin(np.clip(sine, -0.9, 0.9)))
        tilt = min(max(tilt, -9.0), 20.0)
    rotations, at = _bodily(person, {**world, **_legs(person, tilt, lower)}, offset)
    facts = {"thigh_tilt": tilt, "shank_tilt": lower, "hip": at[INDEX["left_thigh"]], "thigh": thigh}
    return Pose(rotations, at, facts)


def cushion_for(person, chair):
    """Thickness of the cushion, m in steps of 5 mm, that keeps the thighs nearly level."""
    facts = seat(person, chair, 0.0, {}).facts
    excess = facts["thigh"] * (np.sin(np.radians(facts["thigh_tilt"])) - np.sin(np.radians(7.0)))
    return round(min(max(excess, 0.0), CUSHION) / 0.005) * 0.005


def _legs(person, tilt, lower):
    """World rotations of the legs for pitches of thigh (up) and shank (foot forward), degrees."""
    rest, out = person.rest, {}
    for side, sign in (("left", 1), ("right", -1)):
        hip, knee, foot = (rest[INDEX[f"{side}_{j}"]] for j in ("thigh", "shank", "foot"))
        along = turn([0, 0, 1], 4.0 * sign) @ turn([0, 1, 0], -tilt) @ np.array([1.0, 0, 0])
        outward = turn([0, 0, 1], 7.0 * sign)
        thigh = outward @ between(knee - hip, outward.T @ along)
        down = np.array([np.sin(np.radians(lower)), -0.09 * sign, -np.cos(np.radians(lower))])
        out[f"{side}_thigh"] = thigh
        out[f"{side}_shank"] = between(thigh @ (foot - knee), down) @ thigh
        out[f"{side}_foot"] = turn([0, 0, 1], 6.0 * sign)
    return out


def _bodily(person, world, offset):
    """Rotations and positions of all joints; joints that are not in `world` follow their parents."""
    count = len(NAMES)
    rotations, at = np.empty((count, 3, 3)), np.empty((count, 3))
    for k, parent in enumerate(rig.PARENTS):
        if parent < 0:
            rotations[k] = world[NAMES[k]]
            at[k] = person.rest[k] + offset
        else:
            rotations[k] = world.get(NAMES[k], rotations[parent])
            at[k] = at[parent] + rotations[parent] @ (person.rest[k] - person.rest[parent])
    return rotations, at


class Support:
    """Height map over x and y of the surfaces for a hand, and depth of points in the body."""

    def __init__(self, points, triangles, chair, legs_top):
        self.low = np.array([-0.2, -0.4])
        shape = (int(1.0 / CELL), int(0.8 / CELL))
        self.body = np.full(shape, -1.0)
        self._splat(self.body, points, triangles)
        # Foremost x of the belly between the middles of the thighs.
        middle = np.abs(self.low[1] + CELL * (np.arange(shape[1]) + 0.5)) < 0.12
        high = np.nonzero((self.body[:, middle] > legs_top).any(axis=1))[0]
        self.belly = self.low[0] + CELL * (high.max() + 1) if len(high) else 0.0
        self.top = self.body.copy()
        for name, kind, rotation, at, half in chair:
            if kind != "box" or not ("armrest" in name or name == "joystick") or "strut" in name:
                continue
            u, v = np.meshgrid(np.linspace(-1, 1, 120), np.linspace(-1, 1, 24))
            local = np.stack([u * half[0], v * half[1], np.full_like(u, half[2])], axis=-1)
            spots = local.reshape(-1, 3) @ rotation.T + at
            self._points(self.top, spots)

    def _splat(self, grid, points, triangles):
        corners = points[triangles]
        edge = np.sqrt(
            max(((corners[:, i] - corners[:, i - 1]) ** 2).sum(axis=1).max() for i in range(3))
        )
        steps = int(np.ceil(edge / CELL)) + 1
        for i in range(steps + 1):
            for j in range(steps + 1 - i):
                w = np.array([i, j, steps - i - j]) / steps
                self._points(grid, np.einsum("k,tkj->tj", w, corners))

    def _points(self, grid, points):
        i, j = self._cells(points)
        np.maximum.at(grid, (i, j), points[:, 2])

    def _cells(self, points):
        cell = np.floor((points[:, :2] - self.low) / CELL).astype(int)
        cell = np.clip(cell, 0, np.array(self.body.shape) - 1)
        return cell[:, 0], cell[:, 1]

    def gap(self, points):
        """Height of points over the surface below them, m; negative inside."""
        return points[:, 2] - self.top[self._cells(points)]

    def inside(self, points):
        """Depth of points in the body, m: down from its upper side, or sideways to its outside."""
        deep = self.body[self._cells(points)] - points[:, 2]
        out = np.maximum(deep, 0.0)
        todo = np.nonzero(out > 0.004)[0]
        if len(todo):
            reach = out[todo]
            for radius in (0.012, 0.024, 0.036, 0.05):
                for k in range(8):
                    shift = radius * np.array([np.cos(k * np.pi / 4), np.sin(k * np.pi / 4), 0])
                    moved = points[todo] + shift
                    free = self.body[self._cells(moved)] < moved[:, 2]
                    reach = np.where(free, np.minimum(reach, radius), reach)
            out[todo] = reach
        return out


def make_pose(person, chair, cushion, spec, before=()):
    """The complete posture: a Pose with facts about its fit.

    `before`: poses of the same person; the arms of one with the same trunk and hands are reused.
    """
    pose = seat(person, chair, cushion, spec)
    solids = chair.raised(cushion)
    key = tuple(spec.get(k, 0) for k in ("lean_forward", "lean_left", "turn_left", "left", "right"))
    alike = next((p for p in before if p.facts["key"] == key), None)
    if alike:
        for k, name in enumerate(NAMES):
            if _of_arm(name):
                pose.rotations[k], pose.at[k] = alike.rotations[k], alike.at[k]
        pose.facts.update(alike.facts)
        return pose
    for side, sign in (("left", 1), ("right", -1)):
        pose = _search(person, pose, chair, solids, side, sign, spec[side])
    pose.facts["key"] = key
    return pose


def _search(person, pose, chair, solids, side, sign, place):
    """The pose with the best fit of one arm; the right arm avoids the left."""
    arm = [INDEX[n] for n in NAMES if n.startswith(side) and _of_arm(n)]
    both = [INDEX[n] for n in NAMES if _of_arm(n)]
    points = rig.skin(person.points, person.weights, person.rest, pose.rotations, pose.at)
    legs = _among(person, "left_thigh", "right_thigh")
    ahead = legs & (points[:, 0] > pose.facts["hip"][0] + 0.5 * pose.facts["thigh"])
    legs_top = points[ahead, 2].max() + 0.035
    # The chest overhangs the lap: a hand is below it.
    above = [INDEX[n] for n in ("spine_4", "spine_5", "neck_1", "neck_2", "head", "jaw")]
    clear = ~np.isin(person.main, (arm if side == "right" else both) + above)
    faces = person.triangles[clear[person.triangles].all(axis=1)]
    faces = faces[points[faces][:, :, 2].mean(axis=1) < pose.facts["hip"][2] + 0.23]
    support = Support(points, faces, solids, legs_top)
    moving = np.nonzero(np.isin(person.main, arm))[0]

    def evaluate(swivel, lift):
        trial = _arm(person, pose, support, chair, side, sign, place, swivel, lift)
        cost, found = _judge(person, trial, support, solids, side, moving, swivel)
        return cost, swivel, lift, trial, found

    best = None
    for swivel in (5, 15, 25, 35, 45, 55, 65, 75):
        for lift in np.arange(-0.03, 0.13, 0.0125):
            found = evaluate(swivel, lift)
            if best is None or found[0] < best[0]:
                best = found
    _, swivel, lift, _, _ = best
    for fine in lift + np.array([-0.009, -0.006, -0.003, 0.003, 0.006, 0.009]):
        found = evaluate(swivel, fine)
        if found[0] < best[0]:
            best = found
    cost, swivel, lift, pose, found = best
    pose.facts[side] = {**found, "swivel": swivel, "lift": float(lift), "cost": cost}
    return pose


def _of_arm(name):
    return any(w in name for w in ("arm", "hand", *FINGERS))


def _judge(person, pose, support, solids, side, moving, swivel):
    """Cost of an arm's pose, and its parts: in the chair, in the body, gap to the support, wrist bend."""
    points = rig.skin(
        person.points[moving], person.weights[moving], person.rest, pose.rotations, pose.at
    )
    main = person.main[moving]
    hand = np.isin(main, [INDEX[n] for n in NAMES if n.startswith(side) and _is_hand(n)])
    fore = hand | np.isin(main, [INDEX[f"{side}_forearm"], INDEX[f"{side}_forearm_turn"]])
    chair = max(float(depth(s, points).max()) for s in solids)
    body = support.inside(points[fore])
    fingers = float(body.max()) if len(body) else 0.0
    gap = float(support.gap(points[hand]).min())
    wrist = pose.facts[f"{side}_wrist"]
    cost = 40 * max(chair - 0.004, 0) + 40 * max(fingers - 0.006, 0) + 8 * abs(gap + 0.003)
    cost += 0.0015 * abs(swivel - 25) + 0.02 * max(wrist - 30, 0)
    return cost, {"in_chair": chair, "in_body": fingers, "gap": gap, "wrist": wrist}


def _is_hand(name):
    return any(w in name for w in ("hand", *FINGERS))


def _arm(person, pose, support, chair, side, sign, place, swivel, lift):
    """The pose with one arm's wrist over its place, elbow rotated outwards by `swivel` degrees."""
    rest, rotations, at = person.rest, pose.rotations.copy(), pose.at.copy()

    def joint(name):
        return INDEX[f"{side}_{name}"]

    shoulder = at[joint("upper_arm")]
    upper = rest[joint("forearm")] - rest[joint("upper_arm")]
    fore = rest[joint("hand")] - rest[joint("forearm")]
    a, b = np.linalg.norm(upper), np.linalg.norm(fore)
    knee = at[joint("shank")]
    palm = np.linalg.norm(rest[joint("middle_1")] - rest[joint("hand")])
    slope = np.sin(np.radians(pose.facts["thigh_tilt"]))
    reach = 0.93 * (a + b)
    if place == "lap":
        x = min(max(knee[0] - 0.23, support.belly + 0.015), knee[0] - 0.13)
        wrist = np.array([x, sign * 0.125, 0.0])
        fingers, bend = np.array([1.0, -0.45 * sign, slope]), RELAXED
        palm_side = np.array([0.0, 0.25 * sign, 1.0])
    elif place == "thigh":
        hip = at[joint("thigh")]
        wrist = hip + 0.52 * (knee - hip)
        wrist[0] = min(max(wrist[0], support.belly + 0.005), knee[0] - 0.12)
        fingers, bend = np.array([1.0, -0.12 * sign, slope]), FLAT
        palm_side = np.array([0.0, 0.1 * sign, 1.0])
    elif place == "armrest":
        wrist = np.array([min(0.30, shoulder[0] + 0.12 + 0.9 * b), sign * 0.252, 0.0])
        fingers, bend = np.array([1.0, -0.08 * sign, -0.03]), RELAXED
        palm_side = np.array([0.0, 0.0, 1.0])
    elif place == "joystick":
        lower, upper_end = chair.joystick
        stick = (lower + upper_end) / 2
        wrist = np.array([stick[0] - palm - 0.004, stick[1] - 0.004, 0.0])
        fingers, bend = np.array([1.0, 0.04, -0.10]), GRIP
        palm_side = np.array([0.0, 0.0, 1.0])
    else:
        raise SystemExit(f"unknown hand place {place}; use lap, thigh, armrest or joystick")
    # Shorter arms do not reach as far forward.
    flat = wrist[:2] - shoulder[:2]
    drop = max(shoulder[2] - 0.76, 0.0)
    most = np.sqrt(max(reach**2 - drop**2, 0.01))
    if np.linalg.norm(flat) > most:
        wrist[0] = shoulder[0] + np.sqrt(max(most**2 - flat[1] ** 2, 0.0))
    hand = wrist + 0.8 * palm * fingers / np.linalg.norm(fingers)
    i, j = support._cells(hand[None])
    under = max(support.top[i[0] - 2 : i[0] + 3, j[0] - 2 : j[0] + 3].max(), 0.6)
    if place == "joystick":
        under = chair.joystick[1][2] - 0.03
    wrist[2] = under + 0.03 + lift
    toward = wrist - shoulder
    distance = np.linalg.norm(toward)
    toward /= distance
    distance = min(distance, 0.985 * (a + b))
    along = (a * a - b * b + distance**2) / (2 * distance)
    aside = np.sqrt(max(a * a - along**2, 0.0))
    down = np.array([-0.25, 0.0, -1.0])
    down -= toward * (toward @ down)
    down /= np.linalg.norm(down)
    out = np.cross(toward, down)
    out *= np.sign(out[1]) * sign
    angle = np.radians(swivel)
    elbow = shoulder + along * toward + aside * (np.cos(angle) * down + np.sin(angle) * out)
    wrist = shoulder + distance * toward
    # Upper arm: its own axis and the elbow's hinge; half of its turn is above the elbow.
    hinge_rest, hinge = np.cross(upper, fore), np.cross(elbow - shoulder, wrist - elbow)
    full = _frame(elbow - shoulder, hinge) @ _frame(upper, hinge_rest).T
    parent = rotations[joint("clavicle")]
    swing = between(parent @ upper, elbow - shoulder) @ parent
    axis = (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
    twist = _twist(full @ swing.T, axis)
    rotations[joint("upper_arm")] = rig.from_vector(axis * twist * 0.5) @ swing
    rotations[joint("upper_arm_turn")] = full
    forearm = _frame(wrist - elbow, hinge) @ _frame(fore, hinge_rest).T
    rotations[joint("forearm")] = forearm
    # Hand: fingers and back of the hand as wanted; the forearm does part of the turn.
    knuckles = rest[joint("middle_1")] - rest[joint("hand")]
    back = sign * np.cross(
        rest[joint("index_1")] - rest[joint("hand")], rest[joint("little_1")] - rest[joint("hand")]
    )
    fore_axis = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    # The fingers deviate from the forearm by at most 38 degrees.
    fingers = fingers / np.linalg.norm(fingers)
    fingers = _limit(fore_axis, fingers, 38.0)
    hand = _frame(fingers, _level(palm_side, fingers)) @ _frame(knuckles, _level(back, knuckles)).T
    turned = _twist(hand @ forearm.T, fore_axis)
    rotations[joint("forearm_turn")] = rig.from_vector(fore_axis * turned * 0.6) @ forearm
    rotations[joint("hand")] = hand
    for finger in FINGERS:
        near, far = joint(f"{finger}_1"), joint(f"{finger}_2")
        for k, degrees, end in (
            (near, bend[0], rest[far]),
            (far, bend[1], person.finger_ends[f"{side}_{finger}"]),
        ):
            direction = end - rest[k]
            curl = np.cross(back, direction)
            curl /= np.linalg.norm(curl)
            if finger == "thumb":
                degrees *= 0.45
            rotations[k] = rotations[rig.PARENTS[k]] @ turn(curl, degrees)
    for name in NAMES:
        k = INDEX[name]
        if name.startswith(side) and _of_arm(name):
            p = rig.PARENTS[k]
            at[k] = at[p] + rotations[p] @ (rest[k] - rest[p])
    facts = dict(pose.facts)
    facts[f"{side}_wrist"] = float(np.degrees(np.arccos(np.clip(fore_axis @ fingers, -1, 1))))
    facts[f"{side}_forearm_turn"] = float(np.degrees(turned))
    facts[f"{side}_elbow"] = float(
        np.degrees(np.arccos(np.clip(axis @ fore_axis, -1, 1)))
    )
    facts[f"{side}_upper_arm_turn"] = float(np.degrees(twist))
    return Pose(rotations, at, facts)


def _level(up, along):
    along = along / np.linalg.norm(along)
    return up - along * (up @ along)


def _frame(along, up):
    """Right-handed axes: `along`, and `up` orthogonal to it."""
    along = along / np.linalg.norm(along)
    up = _level(up, along)
    up = up / np.linalg.norm(up)
    return np.stack([along, up, np.cross(along, up)], axis=1)


def _twist(matrix, axis):
    """Angle of a rotation about an axis, rad, -pi to pi."""
    v = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    angle = 2 * np.arctan2(v @ axis / 2, (1 + np.trace(matrix)) / 2 + 1e-9)
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _limit(axis, wanted, degrees):
    """`wanted`, or the nearest direction within `degrees` of `axis`."""
    angle = np.degrees(np.arccos(np.clip(axis @ wanted, -1, 1)))
    if angle <= degrees:
        return wanted
    normal = np.cross(axis, wanted)
    normal /= np.linalg.norm(normal)
    return turn(normal, degrees) @ axis
