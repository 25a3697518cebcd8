"""What training may not use: homes, objects, words, looks and seeds that are kept for tests.

The file `assets/splits/worlds/worlds-1.toml` lists them and is frozen by a hash, as
`wheelarm_policy::worlds` and `wheelarm_policy::frozen` read it."""

import hashlib
import json
import os
from pathlib import Path

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    tomllib = None

SHIPPED = "splits/worlds/worlds-1.toml"
STRIDE = 1_000_000  # a later attempt at an episode has its seed plus this
#: Seeds of published results, first and one after the last, by purpose.
CLAIMS = {"policy-claim": [(500, 700)], "operator-claim": [(9000, 9200)]}


class WorldsError(ValueError):
    """A file that cannot be used; the text states the fix."""


def find():
    """Path of the file in the assets."""
    root = os.environ.get("WHEELARM_ASSETS") or Path(__file__).resolve().parents[3] / "assets"
    return Path(root) / SHIPPED


def read(path=None):
    """The content of the file.

    Raises WorldsError when it is missing, or was changed."""
    path = Path(path or find())
    if tomllib is None:
        raise WorldsError("reading what is kept for tests needs Python 3.11 or newer: train with one")
    try:
        worlds = tomllib.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise WorldsError(f"cannot read {path}: {error}; name the file with --worlds, or set WHEELARM_ASSETS") from None
    content = {key: value for key, value in worlds.items() if key != "frozen"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    hashed = hashlib.sha256(text.encode()).hexdigest()[:16]
    if worlds.get("frozen") != hashed:
        raise WorldsError(f"{path} was frozen as {worlds.get('frozen')}, and its content now has {hashed}: undo the change")
    return worlds


def held_out_part(worlds, used, seed):
    """What of an episode is kept for tests, in words; None when training may use all of it. `used`
    is the value `world` of its metadata, None in exports of earlier versions."""
    used = used or {}
    held = worlds["held_out"]
    if part := held_out_home(held, used.get("home", ""), used.get("style", "")):
        return part
    for name in used.get("objects", ()):
        if kind_of(name) & set(held["objects"]):
            return f"the object {name!r}"
    for name in used.get("categories", ()):
        if name in held["categories"]:
            return f"an object of the category {name!r}"
    if used.get("sentences") not in (None, "", worlds["train"]["sentences"]):
        return f"a sentence of the split {used['sentences']!r}"
    look = used.get("appearance_seed")
    if look is not None and purpose(look) == held["looks"]:
        return f"the visual randomization of seed {look}"
    if found := purpose(seed):
        return f"the seed {seed}, which is for {found},"
    return None


def held_out_home(held, scene, style):
    plan, own, seed = ([*scene.rsplit("-", 2), "", ""])[:3]
    if not seed.isdigit():
        plan, own = scene, style
    if plan in held["plans"]:
        return f"the home {scene!r} of the plan {plan!r}"
    if own in held["styles"]:
        return f"the home {scene!r} of the style {own!r}"
    return f"the home {scene!r}" if scene in held["homes"] else None


def kind_of(name):
    """Possible kinds of an object: its name up to `-`, and that without a number."""
    kind = name.split("-")[0]
    plain, _, number = kind.rpartition("_")
    return {kind, plain} if number.isdigit() else {kind}


def purpose(seed):
    """Purpose of a seed of published results; None for another."""
    first = seed % STRIDE
    found = (name for name, rows in CLAIMS.items() if any(low <= first < high for low, high in rows))
    return next(found, None)


def check(worlds, files):
    """Rejects episodes that no training may use.

    Raises WorldsError with the episode and the fix."""
    for file in files:
        if part := held_out_part(worlds, file.about.get("world"), file.about["seed"]):
            raise WorldsError(
                f"{file.path}: {part} is kept for tests ({Path(SHIPPED).stem}, {worlds['frozen']}), and this is training: "
                'leave out this episode, or train on episodes of a plan with purpose = "train"'
            )
