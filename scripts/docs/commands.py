"""Command reference: the help of every command, as the programs print it."""

from __future__ import annotations

import os
import pathlib
import re
import subprocess

#: Programs of a user, each with its commands.
PROGRAMS = ("wheelarm", "wheelarm-server")
#: A heading of the help under which commands are listed.
HEADING = re.compile(r"^[A-Z][\w ,]*:$")
COMMAND = re.compile(r"^ {2}([a-z][a-z0-9-]*)(?: {2,}|$)")


def help_of(program: pathlib.Path, words: tuple[str, ...], option: str = "--help") -> str:
    """The help of a command.

    Raises:
        SystemExit: when the program does not print one.
    """
    folder = program.parent
    path = f"{folder}{os.pathsep}{os.environ.get('PATH', '')}"
    done = subprocess.run(
        [str(program), *words, option],
        capture_output=True,
        text=True,
        env={**os.environ, "COLUMNS": "96", "NO_COLOR": "1", "PATH": path},
    )
    if done.returncode != 0:
        call = " ".join([program.name, *words, option])
        raise SystemExit(f"`{call}` failed: {done.stderr.strip()}; build the programs first")
    return done.stdout.rstrip()


def listed(text: str) -> list[str]:
    """Names of the commands that a help lists."""
    found, inside = [], False
    for line in text.splitlines():
        if HEADING.match(line.strip()) and not line.startswith("  "):
            inside = True
        elif line and not line.startswith(" "):
            inside = False
        elif inside and (match := COMMAND.match(line)) and match[1] != "help":
            found.append(match[1])
    return found


def section(program: pathlib.Path, words: tuple[str, ...]) -> list[str]:
    """A command and the commands below it, as Markdown."""
    text = help_of(program, words)
    level = "#" * min(len(words), 3) if words else "#"
    out = [f"{level} {' '.join([program.stem, *words])}", "", "```text", text, "```", ""]
    for name in listed(help_of(program, words, "-h")):
        out += section(program, (*words, name))
    return out


def write(programs: pathlib.Path, folder: pathlib.Path) -> pathlib.Path:
    """Writes a page per command and an index.

    Returns:
        The index.
    """
    folder.mkdir(parents=True)
    wheelarm = programs / PROGRAMS[0]
    rows = []
    names = listed(help_of(wheelarm, (), "-h"))
    if len(names) < 20:
        raise SystemExit(f"`wheelarm -h` lists the commands {names}: correct HEADING in {__file__}")
    # `wheelarm server` is the program wheelarm-server.
    for name in [name for name in names if f"wheelarm-{name}" not in PROGRAMS]:
        lines = section(wheelarm, (name,))
        about = next((line for line in lines[3].splitlines() if line.strip()), "")
        rows.append(f"| [wheelarm {name}]({name}.md) | {about.replace('|', chr(92) + '|')} |")
        (folder / f"{name}.md").write_text("\n".join(lines), encoding="utf-8")
    for program in PROGRAMS[1:]:
        lines = section(programs / program, ())
        about = next(line for line in lines[3].splitlines() if line.strip())
        rows.append(f"| [{program}]({program}.md) | {about} |")
        (folder / f"{program}.md").write_text("\n".join(lines), encoding="utf-8")
    index = folder / "index.md"
    top = help_of(wheelarm, ())
    table = ["| command | use |", "|---|---|", *rows]
    index.write_text(
        "\n".join(["# Commands", "", *table, "", "## All options", "", "```text", top, "```", ""]),
        encoding="utf-8",
    )
    return index
