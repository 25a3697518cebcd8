"""Checks that every link between the pages of a site names an existing file and anchor."""

from __future__ import annotations

import pathlib
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Anchors and links of one page."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.anchors: set[str] = set()
        self.targets: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("id", "name") and value:
                self.anchors.add(value)
            is_link = (tag, name) in (
                ("a", "href"),
                ("img", "src"),
                ("link", "href"),
                ("script", "src"),
            )
            if is_link and value:
                self.targets.append(value)


def read(path: pathlib.Path) -> Page:
    page = Page()
    page.feed(path.read_text(encoding="utf-8", errors="replace"))
    return page


def broken(site: pathlib.Path, skipped: tuple[str, ...] = ()) -> list[str]:
    """Links of a site that lead nowhere, as ``page: target``.

    Args:
        site: Folder of the site.
        skipped: Folders of the site whose own links are not checked.
    """
    site = site.resolve()
    outside = [site / folder for folder in skipped]
    pages = {
        path: read(path)
        for path in site.rglob("*.html")
        if not any(path.is_relative_to(folder) for folder in outside)
    }
    found = []
    for path, page in sorted(pages.items()):
        if path.name in ("404.html", "print.html", "toc.html"):
            continue  # their links are relative to another page
        for target in page.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            file = file / "index.html" if file.is_dir() else file
            anchor = unquote(parts.fragment)
            is_known = not anchor or file not in pages or anchor in pages[file].anchors
            if not file.is_file() or not is_known:
                found.append(f"{path.relative_to(site)}: {target}")
    return found
