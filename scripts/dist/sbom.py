"""Writes a software bill of materials of the programs: CycloneDX 1.6, JSON.

    python sbom.py --target x86_64-unknown-linux-gnu --version 0.1.0 --out wheelarm.cdx.json

The components are the crates that the programs link for the target, as in THIRD_PARTY.txt,
with their licenses, checksums of `Cargo.lock` and dependencies. The time is
SOURCE_DATE_EPOCH, so equal sources give equal bytes.
"""

import argparse
import datetime
import json
import os
import subprocess
import tomllib
import uuid
from pathlib import Path

from third_party import FEATURES, FROM_SOURCE, linked_packages

#: Namespace of serial numbers: equal components give an equal number.
NAMESPACE = uuid.uuid5(uuid.NAMESPACE_URL, "https://cyclonedx.org/wheelarm")


def purl(package):
    """Package URL of a crate."""
    return f"pkg:cargo/{package['name']}@{package['version']}"


def component(package, checksums):
    """A crate as a CycloneDX component."""
    found = {
        "type": "library",
        "bom-ref": purl(package),
        "name": package["name"],
        "version": package["version"],
        "purl": purl(package),
    }
    license_ = (package["license"] or FROM_SOURCE.get(package["name"], "")).replace("/", " OR ")
    if license_:
        found["licenses"] = [{"expression": license_}]
    checksum = checksums.get((package["name"], package["version"]))
    if checksum:
        found["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    if package["repository"]:
        found["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
    return found


def bill(metadata, lock, version, epoch):
    """The bill of materials of the programs of a workspace."""
    checksums = {(p["name"], p["version"]): p.get("checksum") for p in lock["package"]}
    packages = linked_packages(metadata)
    components = [component(package, checksums) for package in packages]
    by_id = {package["id"]: purl(package) for package in packages}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    edges = [
        {"ref": ref, "dependsOn": sorted({by_id[d] for d in nodes[i]["dependencies"] if d in by_id})}
        for i, ref in by_id.items()
    ]
    root = f"pkg:generic/wheelarm@{version}"
    time = datetime.datetime.fromtimestamp(epoch, datetime.timezone.utc)
    serial = uuid.uuid5(NAMESPACE, json.dumps([version, components, edges], sort_keys=True))
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{serial}",
        "version": 1,
        "metadata": {
            "timestamp": time.strftime("%Y-%m-%dT%H:%M:%SZ"),
            "component": {
                "type": "application",
                "bom-ref": root,
                "name": "wheelarm",
                "version": version,
                "licenses": [{"license": {"id": "Apache-2.0"}}],
            },
        },
        "components": components,
        "dependencies": [{"ref": root, "dependsOn": sorted(by_id.values())}, *edges],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", required=True)
    parser.add_argument("--version", required=True)
    parser.add_argument("--out", required=True, type=Path)
    args = parser.parse_args()
    command = ["cargo", "metadata", "--format-version=1", "--locked"]
    command += ["--filter-platform", args.target, "--features", FEATURES]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    lock = tomllib.loads(Path("Cargo.lock").read_text(encoding="utf-8"))
    written = bill(metadata, lock, args.version, int(os.environ.get("SOURCE_DATE_EPOCH", "0")))
    args.out.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")
    print(f"{args.out.name}: {len(written['components'])} components")


if __name__ == "__main__":
    main()
