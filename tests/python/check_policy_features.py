"""Checks the features that LeRobot gives to a policy trained on our export: state, action and
images, without privileged values.

Usage: check_policy_features.py DATA_SET
"""

import importlib
import json
import sys
from importlib.metadata import version
from pathlib import Path


def find_function():
    """`dataset_to_policy_features`, whose module depends on the version."""
    for module in ("lerobot.datasets.utils", "lerobot.datasets.feature_utils", "lerobot.utils.feature_utils"):
        try:
            return getattr(importlib.import_module(module), "dataset_to_policy_features")
        except (ImportError, AttributeError):
            continue
    raise SystemExit("lerobot lacks dataset_to_policy_features: install 0.4.4 or 0.6.1")


info = json.loads((Path(sys.argv[1]) / "meta/info.json").read_text())
features = find_function()(info["features"])
kinds = {name: feature.type.name for name, feature in features.items()}
assert "privileged.chair_pose" in info["features"]
assert not [name for name in kinds if "privileged" in name], kinds
images = {name for name in info["features"] if name.startswith("observation.images.")}
assert {name for name, kind in kinds.items() if kind == "VISUAL"} == images and images, kinds
assert {name for name, kind in kinds.items() if kind == "STATE"} == {"observation.state"}, kinds
assert {name for name, kind in kinds.items() if kind == "ACTION"} == {"action"}, kinds
print(f"lerobot {version('lerobot')} uses {', '.join(sorted(kinds))}")
