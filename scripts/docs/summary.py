"""Table of contents of the site: the guides in the order of `docs/README.md`, then results,
decisions, generated references and the remaining pages."""

from __future__ import annotations

import pathlib
import re

LINK = re.compile(r"\]\(([^)#\s]+\.md)(?:#[^)]*)?\)")
#: Indexes with pages of their own below docs.
INDEXES = ("docs/results", "docs/decisions")


def title(page: pathlib.Path) -> str:
    """The first heading of a page."""
    for line in page.read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            return line[2:].strip().replace("`", "")
    raise SystemExit(f"{page} has no heading: begin the page with `# TITLE`")


def linked(page: pathlib.Path, text: str) -> list[pathlib.Path]:
    """Pages that a text of `page` links to, in order, each once."""
    found = [(page.parent / target).resolve() for target in LINK.findall(text)]
    return list(dict.fromkeys(path for path in found if path.is_file()))


def groups(index: pathlib.Path) -> list[tuple[str, list[pathlib.Path]]]:
    """Headings of an index, and the pages below each."""
    parts = re.split(r"^## (.+)$", index.read_text(encoding="utf-8"), flags=re.M)
    return [
        (heading.strip(), linked(index, text))
        for heading, text in zip(parts[1::2], parts[2::2], strict=True)
    ]


def contents(source: pathlib.Path, reference: list[pathlib.Path]) -> str:
    """The text of SUMMARY.md.

    Args:
        source: Folder of the staged pages.
        reference: Generated pages; a page with the name ``index.md`` is followed by its folder.
    """
    source = source.resolve()
    placed: set[pathlib.Path] = set()
    lines = ["# Summary", ""]

    def add(page: pathlib.Path, depth: int = 0) -> None:
        if page in placed:
            return
        placed.add(page)
        lines.append(f"{'  ' * depth}- [{title(page)}]({page.relative_to(source).as_posix()})")

    add(source / "index.md")
    add(source / "docs/index.md")
    indexes = [source / folder / "index.md" for folder in INDEXES]
    for heading, pages in groups(source / "docs/index.md"):
        guides = [
            page for page in pages if page not in indexes and page.is_relative_to(source / "docs")
        ]
        if guides:
            lines += ["", f"# {heading}", ""]
            for page in guides:
                add(page)
    lines += ["", "# Background", ""]
    for index in indexes:
        add(index)
        for page in linked(index, index.read_text(encoding="utf-8")):
            if page.parent == index.parent:
                add(page, depth=1)
    lines += ["", "# Reference", ""]
    for page in reference:
        add(page)
        if page.name == "index.md":
            for inner in sorted(page.parent.glob("*.md")):
                add(inner, depth=1)
    inside = sorted(page for page in source.rglob("*.md") if page.name != "SUMMARY.md")
    missing = [
        page for page in inside if page.is_relative_to(source / "docs") and page not in placed
    ]
    if missing:
        names = ", ".join(str(page.relative_to(source)) for page in missing)
        raise SystemExit(f"no index below docs links to {names}: add a row to docs/README.md")
    lines += ["", "# Project", ""]
    for page in inside:
        add(page)
    return "\n".join(lines) + "\n"
