"""Python reference: signatures and docstrings of the package, read from the source."""

from __future__ import annotations

import ast
import pathlib
import re

#: Modules of the package that a user imports, in the order of the page.
MODULES = (
    "client",
    "local",
    "lockstep",
    "commander",
    "streams",
    "frame",
    "env",
    "vector",
    "packs",
    "rows",
    "policy",
    "lerobot_policy",
    "errors",
)


def signature(node: ast.FunctionDef | ast.AsyncFunctionDef) -> str:
    """``name(arguments) -> result`` without `self`."""
    arguments = ast.unparse(node.args)
    arguments = re.sub(r"^(self|cls)(, )?", "", arguments)
    result = f" -> {ast.unparse(node.returns)}" if node.returns is not None else ""
    return f"{node.name}({arguments}){result}"


def is_public(name: str) -> bool:
    return not name.startswith("_")


def body(docstring: str | None) -> list[str]:
    """A docstring as Markdown. Tables and indented blocks keep their layout."""
    out, block = [], False
    for line in (docstring or "").splitlines():
        fixed = line.startswith(("    ", "====")) or (block and bool(line.strip()))
        if fixed and not block:
            out += ["", "```text"]
        if block and not fixed:
            out.append("```")
        block = fixed
        out.append(line if fixed else line.replace("``", "`"))
    if block:
        out.append("```")
    return [*out, ""]


def function(
    node: ast.FunctionDef | ast.AsyncFunctionDef, level: str, owner: str = ""
) -> list[str]:
    name = f"{owner}{node.name}"
    decorators = {ast.unparse(one) for one in node.decorator_list}
    code = node.name if "property" in decorators else signature(node)
    return [f"{level} {name}", "", "```python", code, "```", "", *body(ast.get_docstring(node))]


def module(path: pathlib.Path, name: str) -> list[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    out = [f"# {name}", "", *body(ast.get_docstring(tree))]
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and is_public(node.name):
            out += function(node, "##")
        if isinstance(node, ast.ClassDef) and is_public(node.name):
            bases = ", ".join(ast.unparse(base) for base in node.bases)
            out += [f"## {node.name}", "", f"`class {node.name}({bases})`", ""]
            out += body(ast.get_docstring(node))
            for inner in node.body:
                known = isinstance(inner, ast.FunctionDef) and ast.get_docstring(inner)
                if known and is_public(inner.name):
                    out += function(inner, "###", f"{node.name}.")
    return out


def write(package: pathlib.Path, folder: pathlib.Path) -> pathlib.Path:
    """Writes a page per module and an index.

    Returns:
        The index.
    """
    folder.mkdir(parents=True)
    rows = []
    for name in MODULES:
        path = package / f"{name}.py"
        doc = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        first = " ".join(doc.split("\n\n")[0].split()).replace("|", "&#124;")
        rows.append(f"| [wheelarm.{name}]({name}.md) | {first} |")
        (folder / f"{name}.md").write_text(
            "\n".join(module(path, f"wheelarm.{name}")), encoding="utf-8"
        )
    doc = ast.get_docstring(ast.parse((package / "__init__.py").read_text(encoding="utf-8")))
    index = folder / "index.md"
    text = ["# Python API", "", *body(doc), "| module | content |", "|---|---|", *rows, ""]
    text += ["`wheelarm.v1` has the messages of the [protocol](../protocol/index.md).", ""]
    index.write_text("\n".join(text), encoding="utf-8")
    return index
