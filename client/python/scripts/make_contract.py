#!/usr/bin/env python3
"""Makes from the .proto files what the package needs of the contract.

    python scripts/make_contract.py           writes the three files
    python scripts/make_contract.py --check   fails when they are not in date

`src/wheelarm/contract.fds` holds the descriptors (the classes are made of it when the
package is imported), `src/wheelarm/_contract.py` the tables of queries, topics and
tasks, `src/wheelarm/v1.pyi` the types for editors and type checkers, with the
contract's own comments and units. Needs `grpcio-tools`.
"""

from __future__ import annotations

import pathlib
import re
import sys
import tempfile

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from grpc_tools import protoc

PACKAGE = pathlib.Path(__file__).resolve().parents[1]
ROOT = PACKAGE.parents[1]
OUT = PACKAGE / "src" / "wheelarm"
SOURCES = "wheelarm/v1"

FieldProto = descriptor_pb2.FieldDescriptorProto
SCALARS = {
    FieldProto.TYPE_DOUBLE: "float",
    FieldProto.TYPE_FLOAT: "float",
    FieldProto.TYPE_BOOL: "bool",
    FieldProto.TYPE_STRING: "str",
    FieldProto.TYPE_BYTES: "bytes",
}


def compiled() -> descriptor_pb2.FileDescriptorSet:
    """The descriptors of every file of the contract, with comments."""
    files = sorted((ROOT / "proto" / SOURCES).glob("*.proto"))
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "all.fds"
        arguments = ["protoc", f"-I{ROOT / 'proto'}", "--include_imports"]
        arguments += ["--include_source_info", f"--descriptor_set_out={out}"]
        # Only protoc knows where its own descriptor.proto lies.
        import grpc_tools

        arguments.insert(2, f"-I{pathlib.Path(grpc_tools.__file__).parent / '_proto'}")
        if protoc.main(arguments + [str(file) for file in files]) != 0:
            raise SystemExit("the .proto files do not compile")
        return descriptor_pb2.FileDescriptorSet.FromString(out.read_bytes())


def with_options(everything: descriptor_pb2.FileDescriptorSet) -> descriptor_pb2.FileDescriptorSet:
    """The same set read by a class that knows the contract's own options."""
    pool = descriptor_pool.DescriptorPool()
    for file in everything.file:
        pool.Add(file)
    name = pool.FindMessageTypeByName("google.protobuf.FileDescriptorSet")
    return message_factory.GetMessageClass(name).FromString(everything.SerializeToString())


def ours(everything):
    """The files of the contract itself."""
    return [file for file in everything.file if file.package == "wheelarm.v1"]


def descriptors(everything: descriptor_pb2.FileDescriptorSet) -> bytes:
    """What the package loads: no comments, and no options that need an extension."""
    slim = descriptor_pb2.FileDescriptorSet()
    for file in ours(everything):
        kept = slim.file.add()
        kept.CopyFrom(file)
        kept.ClearField("source_code_info")
        kept.ClearField("service")
        dependencies = [name for name in file.dependency if name.startswith(SOURCES)]
        del kept.dependency[:]
        kept.dependency.extend(dependencies)
        for message in kept.message_type:
            message.ClearField("options")
    return slim.SerializeToString(deterministic=True)


def snake(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def word(enum, number: int) -> str:
    name = next(value.name for value in enum.value if value.number == number)
    return name.split("_", 1)[1].lower()


def limit(task: pathlib.Path) -> float:
    """Time limit of a task, its own or its template's, simulated seconds."""
    text = task.read_text()
    template = re.search(r'^template\s*=\s*"(\w+)"', text, re.M).group(1)
    texts = [text, (task.parents[1] / "templates" / f"{template}.toml").read_text()]
    found = [re.search(r"^time_limit\s*=\s*([\d.]+)", text, re.M) for text in texts]
    return next(float(one.group(1)) for one in found if one)


def tables(everything) -> str:
    """Queries and topics as Python."""
    told = with_options(everything)
    options = next(file for file in told.file if file.package == "wheelarm.options")
    enums = {enum.name: enum for enum in options.enum_type}
    queries, topics = [], []
    for file in ours(told):
        for service in file.service:
            for rpc in service.method:
                request, reply = (
                    kind.rsplit(".", 1)[1] for kind in (rpc.input_type, rpc.output_type)
                )
                field = next(
                    (value for key, value in rpc.options.ListFields() if key.name == "key_field"),
                    "",
                )
                queries.append((snake(rpc.name), request, reply, field))
        for message in file.message_type:
            for key, value in message.options.ListFields():
                if key.name != "topic":
                    continue
                name = value.name or re.sub(r"^stream/|/\{\w+\}", "", value.key).replace("/", "_")
                topics.append(
                    (
                        name,
                        value.key,
                        message.name,
                        word(enums["Rate"], value.rate),
                        value.unit,
                        value.frame,
                        word(enums["Role"], getattr(value, "from")),
                    )
                )
    library = (ROOT / "proto/src/lib.rs").read_text()
    constants = dict(re.findall(r"pub const (\w+): u(?:32|64) = (\d+);", library))
    tasks = {file.stem: limit(file) for file in sorted((ROOT / "assets/tasks").glob("*.toml"))}
    lines = [
        '"""The contract as tables. Made by `scripts/make_contract.py`; do not edit."""',
        "",
        f"CONTRACT_VERSION = {constants['CONTRACT_VERSION']}",
        f"PHYSICS_VERSION = {constants['PHYSICS_VERSION']}",
        "",
        "# Name, request, reply, field of the request that stands in the key.",
        "QUERIES = [",
        *(f"    {query!r}," for query in queries),
        "]",
        "",
        "# Name, key below `wheelarm/{sim}/`, message, rate, units, frame, who publishes it.",
        "TOPICS = [",
        *(f"    {topic!r}," for topic in topics),
        "]",
        "",
        "# Tasks that ship, with their time limit in simulated seconds.",
        "TASKS = {",
        *(f"    {name!r}: {seconds!r}," for name, seconds in tasks.items()),
        "}",
    ]
    return "\n".join(lines).replace("'", '"') + "\n"


class Stub:
    """Types of all messages, as one module."""

    def __init__(self, everything) -> None:
        self.comments: dict[str, str] = {}
        self.out = [
            '"""Messages of the contract `wheelarm.v1`. Made by `scripts/make_contract.py`."""',
            "",
            "from collections.abc import Iterable as _Iterable",
            "from collections.abc import Mapping as _Mapping",
            "from typing import Any as _Any",
            "from typing import ClassVar as _ClassVar",
            "",
            "from google.protobuf.internal.containers import "
            "RepeatedCompositeFieldContainer as _Messages",
            "from google.protobuf.internal.containers import RepeatedScalarFieldContainer as _Scalars",
            "from google.protobuf.internal.enum_type_wrapper import EnumTypeWrapper as _EnumWrapper",
            "from google.protobuf.message import Message as _Message",
            "",
        ]
        for file in ours(everything):
            for place in file.source_code_info.location:
                text = " ".join(place.leading_comments.split())
                if text:
                    self.comments[f"{file.name}:{'.'.join(map(str, place.path))}"] = text
        for file in ours(everything):
            for i, enum in enumerate(file.enum_type):
                self.enum(file, enum, f"5.{i}")
        for file in ours(everything):
            for i, message in enumerate(file.message_type):
                self.message(file, message, f"4.{i}")

    def comment(self, file, path: str) -> str:
        return self.comments.get(f"{file.name}:{path}", "").replace("\\", "\\\\")

    def documented(self, indent: str, text: str) -> list[str]:
        if not text:
            return []
        import textwrap

        lines = textwrap.wrap(text, 96 - len(indent))
        if len(lines) == 1 and len(lines[0]) < 88 - len(indent):
            return [f'{indent}"""{lines[0]}"""']
        return [f'{indent}"""{lines[0]}', *(indent + line for line in lines[1:]), f'{indent}"""']

    def enum(self, file, enum, path: str) -> None:
        self.out.append(f"class {enum.name}(int, metaclass=_EnumWrapper):")
        self.out += self.documented("    ", self.comment(file, path))
        for i, value in enumerate(enum.value):
            self.out.append(f"    {value.name}: _ClassVar[{enum.name}]")
            self.out += self.documented("    ", self.comment(file, f"{path}.2.{i}"))
        self.out.append("")
        self.out += [f"{value.name}: {enum.name}" for value in enum.value]
        self.out.append("")

    def kind(self, field) -> str:
        if field.type in (FieldProto.TYPE_MESSAGE, FieldProto.TYPE_ENUM):
            return field.type_name.rsplit(".", 1)[1]
        return SCALARS.get(field.type, "int")

    def message(self, file, message, path: str) -> None:
        self.out.append(f"class {message.name}(_Message):")
        self.out += self.documented("    ", self.comment(file, path)) or ["    ..."]
        arguments = []
        for i, field in enumerate(message.field):
            kind, many = self.kind(field), field.label == FieldProto.LABEL_REPEATED
            nested = field.type == FieldProto.TYPE_MESSAGE
            given = f"{kind} | _Mapping[str, _Any]" if nested else kind
            if field.type == FieldProto.TYPE_ENUM:
                given = f"{kind} | str | int"
            if many:
                held = f"_Messages[{kind}]" if nested else f"_Scalars[{kind}]"
                given = f"_Iterable[{given}]"
            else:
                held = kind
            if field.name.isidentifier() and field.name not in ("from", "import", "in"):
                self.out.append(f"    {field.name}: {held}")
                text = self.comment(file, f"{path}.2.{i}")
                if field.proto3_optional:
                    text += " Optional."
                self.out += self.documented("    ", text)
                arguments.append(f"        {field.name}: {given} | None = ...,")
        if arguments:
            self.out += ["    def __init__(", "        self,", "        *,", *arguments]
            self.out.append("    ) -> None: ...")
        self.out.append("")

    def text(self) -> str:
        return "\n".join(self.out).rstrip("\n") + "\n"


def main() -> None:
    everything = compiled()
    made = {
        "contract.fds": descriptors(everything),
        "_contract.py": tables(everything).encode(),
        "v1.pyi": Stub(everything).text().encode(),
    }
    if "--check" not in sys.argv[1:]:
        for name, content in made.items():
            (OUT / name).write_bytes(content)
        return
    for name, content in made.items():
        there = (OUT / name).read_bytes() if (OUT / name).is_file() else b""
        same = there == content
        if name.endswith(".fds") and there:
            # Two compilers may write the same descriptors in another order.
            parse = descriptor_pb2.FileDescriptorSet.FromString
            same = parse(there) == parse(content)
        if not same:
            raise SystemExit(
                f"{name} is not in date with the .proto files: run `make contract-python`"
            )


if __name__ == "__main__":
    main()
