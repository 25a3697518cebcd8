"""Checks a bill of materials: valid CycloneDX, and components as in the lock file.

    python check_sbom.py BOM CARGO_LOCK
"""

import json
import sys
import tomllib
from pathlib import Path

from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

text = Path(sys.argv[1]).read_text(encoding="utf-8")
if problem := JsonStrictValidator(SchemaVersion.V1_6).validate_str(text):
    sys.exit(f"error: {sys.argv[1]} is not CycloneDX 1.6: {problem}")
bom = json.loads(text)
lock = tomllib.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))
locked = {(package["name"], package["version"]) for package in lock["package"]}
components = {(one["name"], one["version"]) for one in bom["components"]}
names = {name for name, _ in components}
if strangers := components - locked:
    sys.exit(f"error: components that Cargo.lock lacks: {sorted(strangers)}")
if missing := {"wgpu", "zenoh", "rapier3d", "hdf5-metno-sys"} - names:
    sys.exit(f"error: crates of the programs that the bill lacks: {sorted(missing)}")
if unlicensed := [one["name"] for one in bom["components"] if not one.get("licenses")]:
    sys.exit(f"error: components without a license: {unlicensed}")
print(len(components), "components, valid")
