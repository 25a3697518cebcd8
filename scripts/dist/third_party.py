"""Writes the licences of everything that is linked into the programs.

    python third_party.py --target x86_64-unknown-linux-gnu --out THIRD_PARTY.txt

Goes by `cargo metadata`: the crates that the three programs link for the target,
C libraries in them included; what runs only while they are compiled is left out.
Fails where a crate names no licence, or none that is allowed.
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

# Licences under which we may pass binaries on with notice alone; of what is
# under MPL-2.0 the source must be named too, which the list does. EPL-2.0 is not
# among them: Zenoh is taken under Apache-2.0, which it offers as well.
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
# Crates whose manifest names no licence, read in their sources.
READ = {"hdf5-metno-src": "BSD-3-Clause"}
# Files that hold a licence, wherever they lie in a crate.
TEXT = re.compile(r"(?i)^(licen[cs]e|copying|notice|copyright|unlicense|ofl|ufl)([-_. ].*)?$")
NOT_SHIPPED = {"tests", "test", "examples", "benches", "fuzz", "node_modules"}


def allowed(expression):
    """Whether one of the choices of a licence expression is allowed."""
    if isinstance(expression, AND):
        return all(allowed(part) for part in expression.args)
    if isinstance(expression, OR):
        return any(allowed(part) for part in expression.args)
    assert isinstance(expression, (LicenseSymbol, LicenseWithExceptionSymbol)), expression
    return expression.render() in ALLOWED


def linked(metadata):
    """Packages that the programs link, by id, without those of the workspace."""
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    own = set(metadata["workspace_members"])
    todo = [i for i in own if packages[i]["name"] in PROGRAMS]
    seen = set(todo)
    while todo:
        for dep in nodes[todo.pop()]["deps"]:
            package = packages[dep["pkg"]]
            kinds = [kind["kind"] for kind in dep["dep_kinds"]]
            macro = any("proc-macro" in target["kind"] for target in package["targets"])
            if None in kinds and not macro and dep["pkg"] not in seen:
                seen.add(dep["pkg"])
                todo.append(dep["pkg"])
    return sorted((packages[i] for i in seen - own), key=lambda p: (p["name"], p["version"]))


def texts_below(folder):
    """Licence texts in a folder, each with its path below it."""
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
    asked = ["cargo", "metadata", "--format-version=1", "--locked"]
    asked += ["--filter-platform", args.target, "--features", FEATURES]
    metadata = json.loads(subprocess.run(asked, check=True, capture_output=True).stdout)

    licensing = get_spdx_licensing()
    problems, listed = [], []
    # Owners by text; texts that differ in white space alone are one.
    by_text, shown = collections.defaultdict(list), {}

    def add(text, owner):
        key = " ".join(text.split())
        shown.setdefault(key, text)
        by_text[key].append(owner)

    without = []
    for package in linked(metadata):
        title = f"{package['name']} {package['version']}"
        told = (package["license"] or READ.get(package["name"], "")).replace("/", " OR ")
        if not told:
            problems.append(f"{title} names no licence")
            continue
        if not allowed(licensing.parse(told)):
            problems.append(f"{title}: {told} is not among the licences that are allowed")
        source = package["repository"] or f"https://crates.io/crates/{package['name']}"
        listed.append(f"{title}  {told}  {source}")
        texts = list(texts_below(Path(package["manifest_path"]).parent))
        for inside, text in texts:
            add(text, f"{title}: {inside}")
        if not texts:
            without.append((title, told, ", ".join(package["authors"]) or "its authors"))
    # Linked in beside the crates: Rust's standard library; of Zig's folder its
    # helpers for arithmetic and LLVM's unwinder.
    rust = subprocess.run(["rustc", "--version"], check=True, capture_output=True, text=True).stdout
    listed.append(f"standard library of {rust.strip()}  MIT OR Apache-2.0  https://github.com/rust-lang/rust")
    without.append(("standard library of Rust", "MIT OR Apache-2.0", "the Rust project contributors"))
    zig = Path(ziglang.__file__).parent
    for title, licence, path in [
        ("compiler-rt of Zig", "MIT", zig / "LICENSE"),
        ("libunwind of LLVM", "Apache-2.0 WITH LLVM-exception", zig / "lib/libunwind/LICENSE.TXT"),
    ]:
        listed.append(f"{title}  {licence}")
        if path.is_file():
            add(path.read_text().strip(), f"{title}: {path.name}")
        else:
            problems.append(f"{title}: {path} is missing")
    if problems:
        print("\n".join(["error: licences:", *problems]), file=sys.stderr)
        print("cure: leave the crate out, or add the licence to ALLOWED if it may be shipped", file=sys.stderr)
        return 1

    rule = "=" * 78
    lines = [
        "WheelArm is licensed under Apache-2.0. Its programs contain the following,",
        "each under the licence that it names; where it offers a choice, any of those",
        "that are not EPL-2.0. The texts follow. What is under MPL-2.0 is unchanged; its",
        "source lies where the line of the list says. This software is based in part on",
        "the work of the Independent JPEG Group.",
        "",
        *listed,
        "",
    ]
    if without:
        lines += ["These carry no text of their own; the texts of the licences stand below:", ""]
        lines += [f"{title}  {told}  copyright {who}" for title, told, who in without]
        lines.append("")
    for key, owners in sorted(by_text.items(), key=lambda entry: entry[1][0]):
        lines += [rule, *owners, rule, shown[key], ""]
    args.out.write_text("\n".join(lines), encoding="utf-8")
    print(f"{args.out.name}: {len(listed)} parts, {len(by_text)} texts, {len(without)} without a text of their own")
    return 0


if __name__ == "__main__":
    sys.exit(main())
