"""Modules import each other in one direction, also for types alone."""

from __future__ import annotations

import ast
import pathlib

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]
#: Folder below the root, and the name of its package; empty for plain modules.
FOLDERS = {
    "client/python/src/wheelarm": "wheelarm",
    "client/learn/python": "",
    "assets/tools/people": "",
}


def imported_modules(source: str, module: str, modules: set[str]) -> set[str]:
    """The modules of `modules` that the source of `module` imports, at any place."""
    parts = module.split(".")
    found = set()
    for node in ast.walk(ast.parse(source)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = parts[: len(parts) - node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            # A name is a module, or an attribute of its parent.
            names = [".".join(filter(None, (base, alias.name))) for alias in node.names]
            names = [name if name in modules else base for name in names]
        found.update(name for name in names if name in modules and name != module)
    return found


def import_graph(folder: pathlib.Path, package: str) -> dict[str, set[str]]:
    """By module: the modules of the folder that it imports."""
    sources = {}
    for path in sorted(folder.rglob("*.py")):
        parts = [*([package] if package else []), *path.relative_to(folder).with_suffix("").parts]
        name = ".".join(parts)
        sources[name] = path.read_text()
    return {
        # `__init__` collects the modules below it, which import `wheelarm.x`, not `wheelarm`.
        name: imported_modules(source, name, set(sources))
        for name, source in sources.items()
    }


def find_cycle(graph: dict[str, set[str]]) -> list[str]:
    """The modules of a cycle, in order; empty when there is none."""
    done: set[str] = set()

    def visit(module: str, path: list[str]) -> list[str]:
        if module in path:
            return path[path.index(module) :]
        if module in done:
            return []
        for other in sorted(graph[module]):
            if cycle := visit(other, [*path, module]):
                return cycle
        done.add(module)
        return []

    for module in sorted(graph):
        if cycle := visit(module, []):
            return cycle
    return []


@pytest.mark.parametrize("folder", FOLDERS)
def test_modules_do_not_import_each_other_in_circles(folder):
    if not (ROOT / folder).is_dir():
        pytest.skip("not in a checkout")
    graph = import_graph(ROOT / folder, FOLDERS[folder])
    assert sum(map(len, graph.values())) > 3, graph
    assert find_cycle(graph) == []


def test_a_circle_for_types_alone_is_found():
    first = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .b import B\n"
    second = "def f():\n    from p import a, other\n"
    modules = {"p.a", "p.b", "p.__init__"}
    graph = {
        "p.a": imported_modules(first, "p.a", modules),
        "p.b": imported_modules(second, "p.b", modules),
    }
    assert graph == {"p.a": {"p.b"}, "p.b": {"p.a"}}
    assert find_cycle(graph) == ["p.a", "p.b"]
    assert find_cycle({"p.a": {"p.b"}, "p.b": set()}) == []
