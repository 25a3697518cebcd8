"""Makes a shaped mesh from sex, age, mass and stature.

A phenotype is a product of linear weights over MakeHuman's macro targets; stature and
mass are reached by bisection over the `height` and `weight` axes. Mass beyond the
weight axis is added by targets of girth (GIRTH), again by bisection.
"""

import itertools

import numpy as np

from source import BODY_VERTICES

# Mean density of a human body, kg/m³. [source: about 985 with full and 1,070 with empty lungs]
DENSITY = 1010.0
# Targets of girth beyond the weight axis, with weights. [choice]
GIRTH = {
    "torso/measure-waist-circ-incr": 0.7,
    "stomach/stomach-pregnant-incr": 0.16,
    "stomach/stomach-tone-decr": 0.4,
    "torso/torso-scale-depth-incr": 0.30,
    "torso/torso-scale-horiz-incr": 0.12,
    "torso/measure-bust-circ-incr": 0.4,
    "torso/measure-underbust-circ-incr": 0.4,
    "arms/l-upperarm-fat-incr": 0.4,
    "arms/r-upperarm-fat-incr": 0.4,
    "arms/l-lowerarm-fat-incr": 0.3,
    "arms/r-lowerarm-fat-incr": 0.3,
    "legs/l-upperleg-fat-incr": 0.5,
    "legs/r-upperleg-fat-incr": 0.5,
    "legs/l-lowerleg-fat-incr": 0.3,
    "legs/r-lowerleg-fat-incr": 0.3,
}


def _between(value, names):
    """Linear interpolation weights of `names`, evenly spaced from 0 to 1."""
    value = min(max(value, 0.0), 1.0) * (len(names) - 1)
    low = min(int(value), len(names) - 2)
    part = value - low
    return {n: w for n, w in ((names[low], 1 - part), (names[low + 1], part)) if w > 1e-6}


def make_body(source, wanted, weight, height, girth=0.0):
    """Vertices (N, 3) in the rest pose for a phenotype.

    `wanted`: sex ("female" or "male"), age (0 baby, 1/3 child, 2/3 young, 1 old), muscle
    (0 to 1), ancestry (weights of african, asian, caucasian), targets (further ones).
    """
    vertices = source.vertices.copy()

    def add(name, weight):
        target = source.target(name) if abs(weight) > 1e-6 else None
        if target is not None:
            vertices[target[0]] += weight * target[1]

    sex = wanted["sex"]
    ages = _between(wanted["age"], ["baby", "child", "young", "old"])
    muscles = _between(wanted.get("muscle", 0.5), ["minmuscle", "averagemuscle", "maxmuscle"])
    weights = _between(weight, ["minweight", "averageweight", "maxweight"])
    heights = {"minheight": 1 - height, "maxheight": height}
    proportions = {"idealproportions": 0.5, "uncommonproportions": 0.5}
    ancestry = wanted.get("ancestry", {"african": 1, "asian": 1, "caucasian": 1})
    total = sum(ancestry.values())
    for age, of_age in ages.items():
        for name, part in sorted(ancestry.items()):
            add(f"macrodetails/{name}-{sex}-{age}", of_age * part / total)
        for (muscle, of_muscle), (mass, of_mass) in itertools.product(
            muscles.items(), weights.items()
        ):
            part = of_age * of_muscle * of_mass
            kind = f"{sex}-{age}-{muscle}-{mass}"
            add(f"macrodetails/universal-{kind}", part)
            for name, of_height in heights.items():
                add(f"macrodetails/height/{kind}-{name}", part * of_height)
            for name, of_shape in proportions.items():
                add(f"macrodetails/proportions/{kind}-{name}", part * of_shape)
            if sex == "female":
                add(f"breast/{kind}-averagecup-averagefirmness", part)
    for name, part in sorted(wanted.get("targets", {}).items()):
        if source.target(name) is None:
            raise SystemExit(f"no shape target {name} in the wheel; use a name of its mpfb2/targets folder")
        add(name, part)
    if girth:
        for name, part in sorted(GIRTH.items()):
            if source.target(name) is None:
                raise SystemExit(f"no shape target {name} in the wheel; use a name of its mpfb2/targets folder")
            add(name, girth * part)
    return vertices


def stature(vertices):
    """Sole to crown, m."""
    return float(np.ptp(vertices[:BODY_VERTICES, 2]))


def volume_moments(vertices, triangles):
    """Volume (m³), centroid (3) and inertia about it for unit density (3, 3) of a closed mesh."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    det = np.einsum("ij,ij->i", a, np.cross(b, c))
    volume = det.sum() / 6
    centroid = (det[:, None] * (a + b + c)).sum(axis=0) / 24 / volume
    a, b, c = a - centroid, b - centroid, c - centroid
    total = a + b + c
    outer = sum(p[:, :, None] * p[:, None, :] for p in (a, b, c, total))
    second = (det[:, None, None] * outer).sum(axis=0) / 120
    return float(volume), centroid, np.eye(3) * np.trace(second) - second


def fit(source, wanted):
    """Vertices whose stature (m) and mass (kg, by volume) are those of `wanted`, and the axes found."""
    body = source.triangles("body")

    def mass(vertices):
        return DENSITY * abs(volume_moments(vertices, body)[0])

    weight, height, girth = 0.5, 0.5, 0.0
    for _ in range(4):
        height = _bisect(
            -0.6, 1.8, lambda h: stature(make_body(source, wanted, weight, h, girth)), wanted["stature"]
        )
        weight = _bisect(
            0.0, 1.0, lambda w: mass(make_body(source, wanted, w, height)), wanted["mass"]
        )
        girth = 0.0
        if weight > 0.999:
            girth = _bisect(
                0.0, 3.0, lambda g: mass(make_body(source, wanted, weight, height, g)), wanted["mass"]
            )
    vertices = make_body(source, wanted, weight, height, girth)
    return vertices, {
        "height": height,
        "weight": weight,
        "girth": girth,
        "stature": stature(vertices),
        "mass": mass(vertices),
    }


def _bisect(low, high, value, wanted):
    for _ in range(13):
        middle = (low + high) / 2
        if value(middle) < wanted:
            low = middle
        else:
            high = middle
    return (low + high) / 2
