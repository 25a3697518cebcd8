"""Executes a notebook and converts it to a page with its output."""

from __future__ import annotations

import base64
import json
import pathlib
import re
import subprocess
import sys

ESCAPES = re.compile(r"\x1b\[[0-9;]*m")


def executed(path: pathlib.Path, folder: pathlib.Path) -> dict:
    """The notebook after an execution in a new kernel.

    Raises:
        SystemExit: when a cell fails.
    """
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "nbconvert",
            "--to",
            "notebook",
            "--execute",
            "--log-level=ERROR",
            "--ExecutePreprocessor.startup_timeout=300",
            "--output-dir",
            str(folder),
            str(path),
        ],
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        raise SystemExit(f"{path} failed:\n{ESCAPES.sub('', done.stderr)[-3000:]}")
    out = folder / path.name
    notebook = json.loads(out.read_text(encoding="utf-8"))
    out.unlink()
    return notebook


def outputs(cell: dict, stem: str, folder: pathlib.Path, count: int) -> list[str]:
    """Outputs of a cell as Markdown; images become files in `folder`."""
    out: list[str] = []
    for i, output in enumerate(cell.get("outputs", [])):
        data = output.get("data", {})
        text = "".join(output.get("text", data.get("text/plain", "")))
        if "image/png" in data:
            name = f"{stem}-{count}-{i}.png"
            (folder / name).write_bytes(base64.b64decode(data["image/png"]))
            out += [f"![Output of the cell]({name})", ""]
        elif text:
            out += ["```text", ESCAPES.sub("", text).rstrip(), "```", ""]
    return out


def write(path: pathlib.Path, folder: pathlib.Path) -> pathlib.Path:
    """Executes a notebook and writes its page.

    Returns:
        The page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lines: list[str] = []
    for count, cell in enumerate(executed(path, folder)["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            lines += [source, ""]
        else:
            lines += ["```python", source, "```", "", *outputs(cell, path.stem, folder, count)]
    page = folder / f"{path.stem}.md"
    page.write_text("\n".join(lines), encoding="utf-8")
    return page
