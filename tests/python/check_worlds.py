"""Checks that training in Python refuses what is kept for tests, as `wheelarm-learn` does.

Usage: check_worlds.py [folder of client/learn/python]
"""

import pathlib
import sys
import tempfile
from types import SimpleNamespace

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "client/learn/python"))

import worlds  # noqa: E402

KNOWN = {"home": "studio-nordic-3", "style": "", "objects": ["mustard", "phone-black", "can_2"], "categories": ["phone"],
         "sentences": "train", "appearance_seed": 10_000}


def refusal(seed=10_000, **changes):
    file = SimpleNamespace(path="one.safetensors", about={"seed": seed, "world": {**KNOWN, **changes}})
    try:
        worlds.check(SHIPPED, [file])
    except worlds.WorldsError as error:
        assert "one.safetensors" in str(error) and SHIPPED["frozen"] in str(error), error
        return str(error)
    return ""


SHIPPED = worlds.read(ROOT / "assets" / worlds.SHIPPED)
assert refusal() == "" and refusal(seed=7) == "" and refusal(style="modern") == ""
for changes, word in [
    ({"home": "loft-nordic-3"}, "loft"), ({"home": "studio-modern-3"}, "modern"),
    ({"home": "studio", "style": "modern"}, "modern"), ({"home": "loft", "style": "nordic"}, "loft"),
    ({"objects": ["vase-white"]}, "vase-white"), ({"objects": ["potato_2"]}, "potato_2"), ({"categories": ["clock"]}, "clock"),
    ({"sentences": "held_out"}, "held_out"), ({"sentences": "any"}, "any"), ({"appearance_seed": 503}, "503"),
    ({"seed": 500}, "500"), ({"seed": 9000}, "operator-claim"), ({"seed": 1_000_699}, "1000699"),
]:
    assert word in refusal(**changes), (changes, refusal(**changes))
worlds.check(SHIPPED, [SimpleNamespace(path="old.safetensors", about={"seed": 10_000})])
with tempfile.TemporaryDirectory() as folder:
    changed = pathlib.Path(folder) / "worlds.toml"
    changed.write_text((ROOT / "assets" / worlds.SHIPPED).read_text().replace('"loft"', '"attic"'))
    for path, word in [(changed, "undo the change"), (changed.with_name("none.toml"), "--worlds")]:
        try:
            worlds.read(path)
        except worlds.WorldsError as error:
            assert word in str(error), error
        else:
            raise AssertionError(path)
print(f"training refuses {len(SHIPPED['held_out']['homes'])} homes, {len(SHIPPED['held_out']['objects'])} kinds of objects, "
      f"{len(SHIPPED['held_out']['categories'])} categories, held-out sentences and seeds of results")
