"""Writes the notes of a release from the changelog and the files in the folder.

    python notes.py --version 0.1.0 --changelog CHANGELOG.md --dist dist

The notes are the section of the version, and a table of files with size and SHA-256.
"""

import argparse
import hashlib
import re
import sys
from pathlib import Path

#: Use of a file by the end of its name.
USES = {
    "manylinux_2_28_x86_64.whl": "`pip install` on Linux: programs, assets and Python client",
    "linux_x86_64.whl": "programs of this host, for tests only",
    "-py3-none-any.whl": "`pip install`: Python client, or a plugin of LeRobot",
    "_amd64.deb": "`sudo apt install ./FILE` on Debian and Ubuntu",
    ".tar.gz": "programs and assets, to unpack anywhere",
    ".oci.tar": "container image: `podman load -i FILE`",
    ".def": "recipe of an Apptainer image",
    ".crate": "Rust: contract and client SDK",
    ".cdx.json": "bill of materials (CycloneDX)",
    "THIRD_PARTY.txt": "licenses of linked code",
}
#: Files that this program and `dist.sh` write afterwards.
OWN = {"RELEASE_NOTES.md", "SHA256SUMS"}


def section(changelog, version):
    """The text below the heading of a version.

    Raises:
        SystemExit: when there is none.
    """
    found = re.search(rf"^## {re.escape(version)}\b.*?\n(.*?)(?=^## |\Z)", changelog, re.M | re.S)
    if not found or not found[1].strip():
        sys.exit(f"error: CHANGELOG.md has no section `## {version}`; rename `## Unreleased`")
    return found[1].strip()


def use(name):
    """Use of a file.

    Raises:
        SystemExit: when its kind is unknown.
    """
    for ending, words in USES.items():
        if name.endswith(ending):
            return words
    sys.exit(f"error: {name} is not a file of a release; remove it, or name its use in {__file__}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--version", required=True)
    parser.add_argument("--changelog", required=True, type=Path)
    parser.add_argument("--dist", required=True, type=Path)
    args = parser.parse_args()
    changes = section(args.changelog.read_text(encoding="utf-8"), args.version)
    # Links of the changelog begin at the root of the repository.
    changes = re.sub(r"\[([^\]]*)\]\((?!https?:)[^)]*\)", r"\1", changes)
    rows = []
    for file in sorted(args.dist.iterdir()):
        if file.name not in OWN:
            digest = hashlib.sha256(file.read_bytes()).hexdigest()
            size = file.stat().st_size / 1e6
            rows.append(f"| `{file.name}` | {use(file.name)} | {size:.1f} MB | `{digest}` |")
    lines = [
        f"# WheelArm {args.version}",
        "",
        "`sha256sum -c SHA256SUMS` checks the files; `install.md` in the archive says how to install.",
        "",
        "| file | use | size | SHA-256 |",
        "|---|---|---|---|",
        *rows,
        "",
        changes,
        "",
    ]
    out = args.dist / "RELEASE_NOTES.md"
    out.write_text("\n".join(lines), encoding="utf-8")
    print(f"{out.name}: {len(rows)} files")


if __name__ == "__main__":
    main()
