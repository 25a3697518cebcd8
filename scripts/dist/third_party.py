"""Writes the licences of all code that is linked into the programs.

    python third_party.py --target x86_64-unknown-linux-gnu --out THIRD_PARTY.txt

Reads `cargo metadata`: the crates that the programs link for the target, with the C
libraries in them; crates that run only during compilation are left out.
Fails when a crate has no licence, or no allowed one.
"""

import argparse
import collections
import json
import re
import subprocess
import sys
from pathlib import Path

import ziglang
from license_expression import AND, OR, LicenseSymbol, LicenseWithExceptionSymbol, get_spdx_licensing

PROGRAMS = {"wheelarm-server", "wheelarm-cli", "wheelarm-dataset", "wheelarm-worker"}
FEATURES = "wheelarm-cli/static-hdf5,wheelarm-dataset/static-hdf5,wheelarm-worker/static-hdf5"

# Licences under which binaries may be distributed with a notice only; MPL-2.0 also
# requires a link to the source, which the list contains. EPL-2.0 is not allowed:
# Zenoh is used under Apache-2.0, its other licence.
ALLOWED = {
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "CDLA-Permissive-2.0",
    "IJG",
    "ISC",
    "MIT",
    "MIT-0",
    "MPL-2.0",
    "NCSA",
    "OFL-1.1",
    "Ubuntu-font-1.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
}
# Crates without a licence in their manifest; the licence is from their sources.
FROM_SOURCE = {"hdf5-metno-src": "BSD-3-Clause"}
# Names of licence files, in any folder of a crate.
TEXT = re.compile(r"(?i)^(licen[cs]e|copying|notice|copyright|unlicense|ofl|ufl)([-_. ].*)?$")
NOT_SHIPPED = {"tests", "test", "examples", "benches", "fuzz", "node_modules"}


def is_allowed(expression):
    """Whether a licence expression allows distribution under ALLOWED."""
    if isinstance(expression, AND):
        return all(is_allowed(part) for part in expression.args)
    if isinstance(expression, OR):
        return any(is_allowed(part) for part in expression.args)
    assert isinstance(expression, (LicenseSymbol, LicenseWithExceptionSymbol)), expression
    return expression.render() in ALLOWED


def linked_packages(metadata):
    """Packages that the programs link, sorted by name, without those of the workspace."""
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    own = set(metadata["workspace_members"])
    todo = [i for i in own if packages[i]["name"] in PROGRAMS]
    reached = set(todo)
    while todo:
        for dep in nodes[todo.pop()]["deps"]:
            package = packages[dep["pkg"]]
            kinds = [kind["kind"] for kind in dep["dep_kinds"]]
            macro = any("proc-macro" in target["kind"] for target in package["targets"])
            if None in kinds and not macro and dep["pkg"] not in reached:
                reached.add(dep["pkg"])
                todo.append(dep["pkg"])
    return sorted((packages[i] for i in reached - own), key=lambda p: (p["name"], p["version"]))


def find_texts(folder):
    """Licence texts in a folder, each with its path relative to it."""
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder)
        if not NOT_SHIPPED.intersection(inside.parts) and path.is_file() and TEXT.match(path.name):
            if path.suffix not in {".rs", ".c", ".h", ".py", ".toml", ".json"}:
                yield inside, path.read_text(encoding="utf-8", errors="replace").strip()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", required=True)
    parser.add_argument("--out", required=True, type=Path)
    args = parser.parse_args()
    command = ["cargo", "metadata", "--format-version=1", "--locked"]
    command += ["--filter-platform", args.target, "--features", FEATURES]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)

    licensing = get_spdx_licensing()
    problems, listed = [], []
    # Owners by text; texts that differ only in white space count as one.
    by_text, shown = collections.defaultdict(list), {}

    def add(text, owner):
        key = " ".join(text.split())
        shown.setdefault(key, text)
        by_text[key].append(owner)

    without = []
    for package in linked_packages(metadata):
        title = f"{package['name']} {package['version']}"
        licence = (package["license"] or FROM_SOURCE.get(package["name"], "")).replace("/", " OR ")
        if not licence:
            problems.append(f"{title} has no licence")
            continue
        if not is_allowed(licensing.parse(licence)):
            problems.append(f"{title}: {licence} is not among the allowed licences")
        source = package["repository"] or f"https://crates.io/crates/{package['name']}"
        listed.append(f"{title}  {licence}  {source}")
        texts = list(find_texts(Path(package["manifest_path"]).parent))
        for inside, text in texts:
            add(text, f"{title}: {inside}")
        if not texts:
            without.append((title, licence, ", ".join(package["authors"]) or "its authors"))
    # Linked in addition to the crates: Rust's standard library, and from Zig compiler-rt
    # and LLVM's unwinder.
    rust = subprocess.run(["rustc", "--version"], check=True, capture_output=True, text=True).stdout
    listed.append(f"standard library of {rust.strip()}  MIT OR Apache-2.0  https://github.com/rust-lang/rust")
    without.append(("standard library of Rust", "MIT OR Apache-2.0", "the Rust project contributors"))
    zig = Path(ziglang.__file__).parent
    for title, expression, path in [
        ("compiler-rt of Zig", "MIT", zig / "LICENSE"),
        ("libunwind of LLVM", "Apache-2.0 WITH LLVM-exception", zig / "lib/libunwind/LICENSE.TXT"),
    ]:
        listed.append(f"{title}  {expression}")
        if path.is_file():
            add(path.read_text().strip(), f"{title}: {path.name}")
        else:
            problems.append(f"{title}: {path} is missing")
    if problems:
        print("\n".join(["error: licences:", *problems]), file=sys.stderr)
        print("fix: remove the crate, or add the licence to ALLOWED if distribution is allowed", file=sys.stderr)
        return 1

    rule = "=" * 78
    lines = [
        "WheelArm is licensed under Apache-2.0. Its programs contain the following,",
        "each under its licence in the list; of several licences, any except EPL-2.0.",
        "The texts follow. Components under MPL-2.0 are unchanged; the list links to their",
        "source. This software is based in part on the work of the Independent JPEG Group.",
        "",
        *listed,
        "",
    ]
    if without:
        lines += ["These components contain no licence text; the licence texts are below:", ""]
        lines += [f"{title}  {licence}  copyright {who}" for title, licence, who in without]
        lines.append("")
    for key, owners in sorted(by_text.items(), key=lambda entry: entry[1][0]):
        lines += [rule, *owners, rule, shown[key], ""]
    args.out.write_text("\n".join(lines), encoding="utf-8")
    print(f"{args.out.name}: {len(listed)} parts, {len(by_text)} texts, {len(without)} without their own text")
    return 0


if __name__ == "__main__":
    sys.exit(main())
