"""Protocol reference: queries, topics, messages and enums, from the comments of the .proto
files."""

from __future__ import annotations

import importlib.util
import pathlib
from types import ModuleType

ROOT = pathlib.Path(__file__).resolve().parents[2]


def contract() -> ModuleType:
    """The module that generates the Python package from the contract."""
    path = ROOT / "client/python/scripts/make_contract.py"
    spec = importlib.util.spec_from_file_location("make_contract", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def cell(text: str) -> str:
    """A comment as a cell of a table."""
    text = " ".join(text.split())
    for mark, code in (
        ("&", "&amp;"),
        ("<", "&lt;"),
        (">", "&gt;"),
        ("|", "&#124;"),
        ("{", "&#123;"),
    ):
        text = text.replace(mark, code)
    return text


class Reference:
    """Pages of the contract."""

    def __init__(self) -> None:
        self.make = contract()
        decoded = self.make.with_options(self.make.compile_protos())
        self.files = self.make.contract_files(decoded)
        self.comments = {
            f"{file.name}:{'.'.join(map(str, location.path))}": location.leading_comments
            for file in self.files
            for location in file.source_code_info.location
        }
        #: Page of every message and enum.
        self.pages = {
            kind.name: pathlib.Path(file.name).stem
            for file in self.files
            for kind in (*file.message_type, *file.enum_type)
        }

    def comment(self, file, path: str) -> str:
        text = cell(self.comments.get(f"{file.name}:{path}", ""))
        if not text:
            raise SystemExit(f"{file.name} has an element without a comment (path {path}): add one")
        return text

    def link(self, name: str) -> str:
        return f"[{name}]({self.pages[name]}.md#{name.lower()})"

    def kind(self, field) -> str:
        """Type of a field, with a link where the contract defines it."""
        numbers = type(field).DESCRIPTOR.fields_by_name["type"].enum_type.values_by_number
        if field.type_name.startswith(".wheelarm.v1."):
            name = self.link(field.type_name.rsplit(".", 1)[1])
        elif field.type_name:
            name = f"`{field.type_name.lstrip('.')}`"
        else:
            name = f"`{numbers[field.type].name.removeprefix('TYPE_').lower()}`"
        prefix = "repeated " if field.label == 3 else "optional " if field.proto3_optional else ""
        return prefix + name

    def message(self, file, message, path: str) -> list[str]:
        out = [f"### {message.name}", "", self.comment(file, path), ""]
        if message.field:
            out += ["| no. | field | type | content |", "|---|---|---|---|"]
        for i, field in enumerate(message.field):
            text = self.comment(file, f"{path}.2.{i}")
            if field.HasField("oneof_index") and not field.proto3_optional:
                text += f" One of `{message.oneof_decl[field.oneof_index].name}`."
            out.append(f"| {field.number} | `{field.name}` | {self.kind(field)} | {text} |")
        return [*out, ""]

    def enum(self, file, enum, path: str) -> list[str]:
        out = [
            f"### {enum.name}",
            "",
            self.comment(file, path),
            "",
            "| no. | value | meaning |",
            "|---|---|---|",
        ]
        for i, value in enumerate(enum.value):
            out.append(
                f"| {value.number} | `{value.name}` | {self.comment(file, f'{path}.2.{i}')} |"
            )
        return [*out, ""]

    def page(self, file) -> str:
        name = pathlib.Path(file.name).stem
        head = cell(self.syntax_comment(file))
        out = [f"# {name}.proto", "", head, ""]
        if file.message_type:
            out += ["## Messages", ""]
        for i, message in enumerate(file.message_type):
            out += self.message(file, message, f"4.{i}")
        if file.enum_type:
            out += ["## Enums", ""]
        for i, enum in enumerate(file.enum_type):
            out += self.enum(file, enum, f"5.{i}")
        return "\n".join(out)

    def syntax_comment(self, file) -> str:
        """The comment at the head of a file, before `syntax`."""
        return self.comments.get(f"{file.name}:12", "")

    def queries(self) -> list[str]:
        out = ["| query | request | reply | content |", "|---|---|---|---|"]
        for file in self.files:
            for s, service in enumerate(file.service):
                for i, rpc in enumerate(service.method):
                    request, reply = (
                        kind.rsplit(".", 1)[1] for kind in (rpc.input_type, rpc.output_type)
                    )
                    text = self.comment(file, f"6.{s}.2.{i}")
                    if rpc.options.idempotency_level == 1:
                        text += " Changes nothing."
                    name = self.make.to_snake(rpc.name)
                    out.append(
                        f"| `query/{name}` | {self.link(request)} | {self.link(reply)} | {text} |"
                    )
        return out

    def topics(self) -> list[str]:
        tables: dict[str, list] = {}
        exec(self.make.tables(self.make.compile_protos()), tables)
        out = ["| key | message | rate | units | frame | publisher |", "|---|---|---|---|---|---|"]
        for _, key, message, rate, unit, frame, publisher in tables["TOPICS"]:
            out.append(
                f"| `{key}` | {self.link(message)} | {rate} | {cell(unit)} | {cell(frame)} | {publisher} |"
            )
        return out


def write(folder: pathlib.Path) -> pathlib.Path:
    """Writes a page per file of the contract and an index.

    Returns:
        The index.
    """
    folder.mkdir(parents=True)
    reference = Reference()
    for file in reference.files:
        path = folder / f"{pathlib.Path(file.name).stem}.md"
        path.write_text(reference.page(file), encoding="utf-8")
    index = folder / "index.md"
    rules = (
        "[The rules of the contract](../../proto/index.md) describe keys, evolution and lock-step."
    )
    text = ["# Protocol", "", rules, "", "## Queries", "", *reference.queries(), ""]
    text += ["## Topics", "", "Keys are below `wheelarm/{sim}/`.", "", *reference.topics(), ""]
    index.write_text("\n".join(text), encoding="utf-8")
    return index
