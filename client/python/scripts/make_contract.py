#!/usr/bin/env python3
"""Generates the package's files of the contract from the .proto files.

    python scripts/make_contract.py           writes the three files
    python scripts/make_contract.py --check   fails when they are out of date

`src/wheelarm/contract.fds` contains the descriptors, from which the package creates its
classes at import; `src/wheelarm/_contract.py` the constants and the tables of queries,
topics and tasks; `src/wheelarm/v1.pyi` the types for editors and type checkers, with the
contract's comments and units. Requires `grpcio-tools`.
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
#: Constants of the crate `wheelarm-proto` that the package uses.
CONSTANTS = (
    "CONTRACT_VERSION",
    "PHYSICS_VERSION",
    "PHYSICS_HZ",
    "CONTROL_HZ",
    "ARM_JOINTS",
    "PREFIX",
    "MEDIA_TYPE",
)

FieldProto = descriptor_pb2.FieldDescriptorProto
SCALARS = {
    FieldProto.TYPE_DOUBLE: "float",
    FieldProto.TYPE_FLOAT: "float",
    FieldProto.TYPE_BOOL: "bool",
    FieldProto.TYPE_STRING: "str",
    FieldProto.TYPE_BYTES: "bytes",
}


def compile_protos() -> descriptor_pb2.FileDescriptorSet:
    """Compiles every file of the contract to descriptors, with comments."""
    files = sorted((ROOT / "proto" / SOURCES).glob("*.proto"))
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "all.fds"
        arguments = ["protoc", f"-I{ROOT / 'proto'}", "--include_imports"]
        arguments += ["--include_source_info", f"--descriptor_set_out={out}"]
        # protoc does not find its own descriptor.proto without this path.
        import grpc_tools

        arguments.insert(2, f"-I{pathlib.Path(grpc_tools.__file__).parent / '_proto'}")
        if protoc.main(arguments + [str(file) for file in files]) != 0:
            raise SystemExit("cannot compile the .proto files: see the errors of protoc above")
        return descriptor_pb2.FileDescriptorSet.FromString(out.read_bytes())


def with_options(everything: descriptor_pb2.FileDescriptorSet) -> descriptor_pb2.FileDescriptorSet:
    """Decodes the set again with a class that has the contract's own options."""
    pool = descriptor_pool.DescriptorPool()
    for file in everything.file:
        pool.Add(file)
    name = pool.FindMessageTypeByName("google.protobuf.FileDescriptorSet")
    return message_factory.GetMessageClass(name).FromString(everything.SerializeToString())


def contract_files(everything):
    """The files of the package `wheelarm.v1`."""
    return [file for file in everything.file if file.package == "wheelarm.v1"]


def descriptors(everything: descriptor_pb2.FileDescriptorSet) -> bytes:
    """The content of `contract.fds`: without comments, and without options that need an
    extension."""
    slim = descriptor_pb2.FileDescriptorSet()
    for file in contract_files(everything):
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


def to_snake(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def enum_word(enum, number: int) -> str:
    name = next(value.name for value in enum.value if value.number == number)
    return name.split("_", 1)[1].lower()


def time_limit(task: pathlib.Path) -> float:
    """Time limit of a task, its own or its template's, simulated seconds."""
    text = task.read_text()
    template = re.search(r'^template\s*=\s*"(\w+)"', text, re.M).group(1)
    texts = [text, (task.parents[1] / "templates" / f"{template}.toml").read_text()]
    found = [re.search(r"^time_limit\s*=\s*([\d.]+)", text, re.M) for text in texts]
    return next(float(one.group(1)) for one in found if one)


def tables(everything) -> str:
    """Constants, queries, topics and tasks as Python source."""
    decoded = with_options(everything)
    options = next(file for file in decoded.file if file.package == "wheelarm.options")
    enums = {enum.name: enum for enum in options.enum_type}
    queries, topics = [], []
    for file in contract_files(decoded):
        for service in file.service:
            for rpc in service.method:
                request, reply = (
                    kind.rsplit(".", 1)[1] for kind in (rpc.input_type, rpc.output_type)
                )
                field = next(
                    (value for key, value in rpc.options.ListFields() if key.name == "key_field"),
                    "",
                )
                queries.append((to_snake(rpc.name), request, reply, field))
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
                        enum_word(enums["Rate"], value.rate),
                        value.unit,
                        value.frame,
                        enum_word(enums["Role"], getattr(value, "from")),
                    )
                )
    tasks = {file.stem: time_limit(file) for file in sorted((ROOT / "assets/tasks").glob("*.toml"))}
    lines = [
        '"""The contract as tables. Generated by `scripts/make_contract.py`; do not edit."""',
        "",
        "# Constants of the crate wheelarm-proto.",
        *(f"{name} = {value}" for name, value in constants().items()),
        "",
        "# Name, request, reply, field of the request that is part of the key.",
        "QUERIES = [",
        *(f"    {query!r}," for query in queries),
        "]",
        "",
        "# Name, key below `wheelarm/{sim}/`, message, rate, units, frame, publisher.",
        "TOPICS = [",
        *(f"    {topic!r}," for topic in topics),
        "]",
        "",
        "# Tasks of the assets, with their time limits in simulated seconds.",
        "TASKS = {",
        *(f"    {name!r}: {seconds!r}," for name, seconds in tasks.items()),
        "}",
    ]
    text = "\n".join(lines).replace("'", '"') + "\n"
    # A name with an apostrophe would not be Python.
    compile(text, "_contract.py", "exec")
    return text


def constants() -> dict[str, str]:
    """The constants of the crate `wheelarm-proto` in `CONSTANTS`, as Python literals."""
    pattern = re.compile(r'pub const (\w+): (?:u32|u64|usize|&str) = (\d+|"[^"]*");')
    found: dict[str, set[str]] = {}
    for file in sorted((ROOT / "proto/src").rglob("*.rs")):
        for name, value in pattern.findall(file.read_text()):
            found.setdefault(name, set()).add(value)
    wrong = [name for name in CONSTANTS if len(found.get(name, ())) != 1]
    if wrong:
        raise SystemExit(f"proto/src must define {', '.join(wrong)} exactly once, with a literal")
    return {name: found[name].pop() for name in CONSTANTS}


class Stub:
    """Types of all messages, as one module."""

    def __init__(self, everything) -> None:
        self.comments: dict[str, str] = {}
        self.out = [
            '"""Messages of the contract `wheelarm.v1`. Generated by `scripts/make_contract.py`."""',
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
        for file in contract_files(everything):
            for location in file.source_code_info.location:
                text = " ".join(location.leading_comments.split())
                if text:
                    self.comments[f"{file.name}:{'.'.join(map(str, location.path))}"] = text
        for file in contract_files(everything):
            for i, enum in enumerate(file.enum_type):
                self.enum(file, enum, f"5.{i}")
        for file in contract_files(everything):
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
    everything = compile_protos()
    generated = {
        "contract.fds": descriptors(everything),
        "_contract.py": tables(everything).encode(),
        "v1.pyi": Stub(everything).text().encode(),
    }
    if "--check" not in sys.argv[1:]:
        for name, content in generated.items():
            (OUT / name).write_bytes(content)
        return
    for name, content in generated.items():
        present = (OUT / name).read_bytes() if (OUT / name).is_file() else b""
        same = present == content
        if name.endswith(".fds") and present:
            # Two compilers may write the same descriptors in another order.
            parse = descriptor_pb2.FileDescriptorSet.FromString
            same = parse(present) == parse(content)
        if not same:
            raise SystemExit(f"{name} is out of date: run `make contract-python`")


if __name__ == "__main__":
    main()
