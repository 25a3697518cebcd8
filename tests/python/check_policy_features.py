"""What LeRobot gives to a policy of our export: state, action and pictures, and
nothing that a real robot does not know.

Usage: check_policy_features.py DATA_SET
"""

import importlib
import json
import sys
from importlib.metadata import version
from pathlib import Path


def function():
    """`dataset_to_policy_features`, which has moved between versions."""
    for module in ("lerobot.datasets.utils", "lerobot.datasets.feature_utils", "lerobot.utils.feature_utils"):
        try:
            return getattr(importlib.import_module(module), "dataset_to_policy_features")
        except (ImportError, AttributeError):
            continue
    raise SystemExit("lerobot has no dataset_to_policy_features")


info = json.loads((Path(sys.argv[1]) / "meta/info.json").read_text())
features = function()(info["features"])
kinds = {name: feature.type.name for name, feature in features.items()}
assert "privileged.chair_pose" in info["features"]
assert not [name for name in kinds if "privileged" in name], kinds
pictures = {name for name in info["features"] if name.startswith("observation.images.")}
assert {name for name, kind in kinds.items() if kind == "VISUAL"} == pictures and pictures, kinds
assert {name for name, kind in kinds.items() if kind == "STATE"} == {"observation.state"}, kinds
assert {name for name, kind in kinds.items() if kind == "ACTION"} == {"action"}, kinds
print(f"lerobot {version('lerobot')} takes {', '.join(sorted(kinds))}")
