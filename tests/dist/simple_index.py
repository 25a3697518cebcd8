"""Writes a package index (PEP 503) of the wheels in a folder.

    python simple_index.py DIST OUT
"""

import hashlib
import html
import re
import shutil
import sys
from collections import defaultdict
from pathlib import Path

dist, out = Path(sys.argv[1]), Path(sys.argv[2])
projects = defaultdict(list)
for wheel in sorted(dist.glob("*.whl")):
    project = re.sub(r"[-_.]+", "-", wheel.name.split("-")[0]).lower()
    projects[project].append(wheel)
if not projects:
    sys.exit(f"error: {dist} has no wheel; run: make release")
files = out / "files"
files.mkdir(parents=True)


def page(folder, links):
    """Writes a page of links."""
    folder.mkdir(parents=True, exist_ok=True)
    anchors = [f'<a href="{html.escape(target)}">{html.escape(name)}</a><br>' for name, target in links]
    text = "\n".join(["<!DOCTYPE html><html><body>", *anchors, "</body></html>"])
    (folder / "index.html").write_text(text, encoding="utf-8")


for project, wheels in projects.items():
    links = []
    for wheel in wheels:
        shutil.copy2(wheel, files)
        digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
        links.append((wheel.name, f"../../files/{wheel.name}#sha256={digest}"))
    page(out / "simple" / project, links)
page(out / "simple", [(project, f"{project}/") for project in projects])
print(", ".join(f"{project}: {len(wheels)}" for project, wheels in projects.items()))
