"""Compares the joint signals of episode files with each other and with Pinocchio (PyPI `pin`),
which uses only the URDF in the file.

Usage: check_signals.py FILE...

- The integral of the velocities (trapezoids) equals the change of position: for every moving
  joint the slope is 1.000 +- 0.005; for the wheels and for joints 2, 3 and 5 the lag is below
  1 ms. Fingers start and stop within a sample, and the other joints move little: their lag is
  only printed.
- The efforts of the arm equal the torques of recursive Newton-Euler, with the chair's motion and
  the mass in the hand. Velocities and accelerations are derivatives of the recorded positions
  (Savitzky-Golay). Samples within 0.1 s of a contact of the robot other than a grasp are
  excluded.
- The first sample has an effort.
Exit code 1 when a file fails a check.
"""

import json
import sys
import tomllib

import h5py
import numpy as np
import pinocchio as pin

ARM = [f"joint_{i}" for i in range(1, 7)]
RMS = [0.3, 0.3, 0.3, 0.1, 0.1, 0.1]
SLOPE, LAG = 0.005, 1e-3
LAGGING = ["joint_2", "joint_3", "joint_5"]
# Samples on both sides of a derivative's sample, and order of the fit.
REACH, ORDER = 3, 3
AROUND = 0.1
problems = []


def derivatives(values, dt):
    """First and second derivative along axis 0; NaN at the ends."""
    steps = np.arange(-REACH, REACH + 1) * dt
    fit = np.linalg.pinv(np.vander(steps, ORDER + 1, increasing=True))
    out = []
    for row, factor in ((fit[1], 1.0), (fit[2], 2.0)):
        result = np.full(values.shape, np.nan)
        windows = np.lib.stride_tricks.sliding_window_view(values, 2 * REACH + 1, axis=0)
        result[REACH:-REACH] = factor * (windows @ row)
        out.append(result)
    return out


def motion(file, names, q, v, dt):
    """Velocity against position, for every joint that moves."""
    judged = set()
    way = np.diff(q, axis=0)
    velocity_way = (v[1:] + v[:-1]) / 2 * dt
    for j, name in enumerate(names):
        moving = np.abs(way[:, j]) > 0.05 * dt
        rate = v[1:, j] - v[:-1, j]
        # With a jerk between two samples the integral is unknown: such rows are excluded, in
        # which the rule of four points differs from the trapezoid by more than a quarter of
        # the effect of a lag of 1 ms.
        around = np.pad(v[:, j], 1, mode="edge")
        four = (13 * (v[1:, j] + v[:-1, j]) - around[:-3] - around[3:]) / 24 * dt
        known = np.abs(four - velocity_way[:, j]) <= LAG * np.abs(rate) / 4 + 1e-6
        moving &= known
        if moving.sum() < 60:
            continue
        # way = slope * velocity_way + lag * rate: a lagging velocity is that of an earlier
        # time.
        columns = np.stack([velocity_way[:, j][moving], rate[moving]], axis=1)
        (slope, lag), *_ = np.linalg.lstsq(columns, way[:, j][moving], rcond=None)
        left = np.abs(np.cumsum(way[:, j] - velocity_way[:, j])).max() * 1e3
        print(
            f"  {name:38} slope {slope:.4f}  lag {lag * 1e3:+.2f} ms in {moving.sum()} steps,"
            f" largest error {left:.2f} mrad"
        )
        judged.add(name)
        late = abs(lag) > LAG and ("wheel" in name or name in LAGGING)
        if abs(slope - 1) > SLOPE or late:
            problems.append(f"{file}: {name}: slope {slope:.4f}, lag {lag * 1e3:.2f} ms")
    if not judged & set(LAGGING):
        problems.append(f"{file}: none of {', '.join(LAGGING)} moves enough to be judged")


def touching(f, links):
    """The held object at each sample (a name, or None), and which samples have a contact of the
    robot other than a grasp."""
    held, other = [], []
    for text in f["streams/contact/pairs"][()]:
        pairs = json.loads(text)
        with_robot = [p for p in pairs if p[0] in links or p[1] in links]
        objects = {name for pair in with_robot for name in pair if name not in links}
        fingers = {name for pair in with_robot for name in pair if name in links}
        grasp = len(objects) == 1 and len(fingers) >= 2 and all("finger_tip" in n for n in fingers)
        object_name = next(iter(objects)) if grasp else None
        free = all(object_name not in pair or pair in with_robot for pair in pairs)
        held.append(object_name if free else None)
        other.append(bool(with_robot) and not (grasp and free))
    return held, np.array(other)


def efforts(file, f, names, q, effort, dt):
    """Efforts of the arm against recursive Newton-Euler."""
    texts = dict(zip(f["initial_state/assets/path"].asstr()[()], f["initial_state/assets/text"].asstr()[()]))
    urdf = next(text for path, text in texts.items() if path.endswith(".urdf"))
    model = pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
    data = model.createData()
    links = {frame.name for frame in model.frames}
    hand = model.getFrameId("robotiq_85_base_link")
    frames = list(f["streams/pose/pose"].attrs["names"])
    chair = f["streams/pose/pose"][:, frames.index("wheelchair")]
    twist = f["streams/pose/twist"][:, frames.index("wheelchair")]
    turns = [pin.Quaternion(*row[[6, 3, 4, 5]]).matrix() for row in chair]
    body = np.array([np.concatenate([r.T @ t[:3], r.T @ t[3:]]) for r, t in zip(turns, twist)])
    body_rate, _ = derivatives(body, dt)
    speed, gain = derivatives(q, dt)

    objects = list(f["streams/object_pose/pose"].attrs["names"])
    poses = f["streams/object_pose/pose"][()]
    masses = {o["name"]: o.get("mass", o.get("mass_kg")) for o in json.loads(f["scenario/text"].asstr()[()])["objects"]}
    held, other = touching(f, links)
    # The force of a held drawer does not follow from a mass.
    for i, name in enumerate(held):
        if name is not None and name not in objects:
            held[i], other[i] = None, True

    def middle(name):
        """Way of an object's centre of mass and its acceleration."""
        kind = name.rstrip("0123456789").rstrip("_")
        file = texts.get(f"objects/{name}.toml") or texts[f"objects/{kind}.toml"]
        com = np.array(tomllib.loads(file)["com"])
        rows = poses[:, objects.index(name)]
        way = np.array([r[:3] + pin.Quaternion(*r[[6, 3, 4, 5]]).matrix() @ com for r in rows])
        return way, derivatives(way, dt)[1]

    middles = {name: middle(name) for name in set(held) - {None}}
    around = int(round(AROUND / dt))
    near = np.convolve(other, np.ones(2 * around + 1), "same") > 0
    changed = np.array([a != b for a, b in zip(held, held[1:])] + [False])
    near |= np.convolve(changed, np.ones(2 * around + 1), "same") > 0
    expected = np.full((len(q), len(ARM)), np.nan)
    rows = [model.joints[model.getJointId(name)].idx_v for name in ARM]
    for i in range(len(q)):
        state, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        state[:7] = chair[i]
        v[:6], a[:6] = body[i], body_rate[i]
        if i == 0:
            v[:], a[:] = 0, 0
        for j, name in enumerate(names):
            joint = model.joints[model.getJointId(name)]
            at = joint.idx_q
            state[at : at + joint.nq] = (
                q[i, j] if joint.nq == 1 else [np.cos(q[i, j]), np.sin(q[i, j])]
            )
            if i > 0:
                v[joint.idx_v], a[joint.idx_v] = speed[i, j], gain[i, j]
        torque = pin.rnea(model, data, state, v, a).copy()
        if held[i] and not np.isnan(a).any():
            way, change = middles[held[i]]
            jacobian = pin.computeFrameJacobian(model, data, state, hand, pin.LOCAL_WORLD_ALIGNED)
            pin.framesForwardKinematics(model, data, state)
            arm = way[i] - data.oMf[hand].translation
            force = masses[held[i]] * (change[i] - model.gravity.linear)
            torque += jacobian[:3].T @ force + jacobian[3:].T @ np.cross(arm, force)
        expected[i] = torque[rows]

    measured = effort[:, [names.index(name) for name in ARM]]
    error = measured - expected
    taken = ~near & ~np.isnan(error).any(axis=1)
    taken[0] = False
    holding = taken & np.array([h is not None for h in held])
    print(f"  effort: {taken.sum()} samples, {holding.sum()} of them with a held object")
    for j, name in enumerate(ARM):
        part = error[taken, j]
        rms, worst = np.sqrt((part**2).mean()), np.abs(part).max()
        first = error[0, j]
        print(f"  {name}  rms {rms:.3f}  worst {worst:.3f}  first sample {measured[0, j]:+.3f}, error {first:+.3f} N.m")
        if rms > RMS[j]:
            problems.append(f"{file}: effort of {name} has an error of {rms:.3f} N.m rms")
        if abs(first) > 0.1:
            problems.append(f"{file}: first effort of {name} has an error of {first:.3f} N.m")


def check(file):
    with h5py.File(file) as f:
        joints = f["streams/joint_state"]
        names = list(joints["position"].attrs["names"])
        q, v, effort = (joints[c][()] for c in ("position", "velocity", "effort"))
        stamps = joints["stamp_nanos"][()].astype(np.int64)
        steps = np.diff(stamps) * 1e-9
        dt = steps.mean()
        if np.abs(steps - dt).max() > 1e-6:
            problems.append(f"{file}: the timestamps are not equidistant")
            return
        print(file)
        motion(file, names, q, v, dt)
        efforts(file, f, names, q, effort, dt)


for path in sys.argv[1:]:
    check(path)
for problem in problems:
    print(problem, file=sys.stderr)
sys.exit(bool(problems))
