"""The messages and enums of the contract, `wheelarm.v1`.

    from wheelarm import v1
    command = v1.Command(base=v1.BaseCommand(linear=0.2))
    scenario = v1.Scenario(task="pick_mustard", pacing=v1.PACING_LOCK_STEP)

They are ordinary protobuf messages, created at import from the descriptors in
`contract.fds`, in a descriptor pool of their own. So they work with every protobuf from
3.20 to 7 and do not clash with messages of other packages. SI units, radians, z up,
quaternions x y z w; `v1.pyi` documents the unit of every field.
"""

from __future__ import annotations

import importlib.resources
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.internal import enum_type_wrapper


def _build_classes() -> dict[str, Any]:
    resource = importlib.resources.files(__package__).joinpath("contract.fds")
    files = {
        file.name: file
        for file in descriptor_pb2.FileDescriptorSet.FromString(resource.read_bytes()).file
    }
    pool = descriptor_pool.DescriptorPool()
    added: set[str] = set()

    def add(name: str) -> None:
        """Adds a file after its dependencies."""
        if name not in added:
            added.add(name)
            for needed in files[name].dependency:
                add(needed)
            pool.AddSerializedFile(files[name].SerializeToString())

    for name in files:
        add(name)
    if hasattr(message_factory, "GetMessageClass"):
        class_of = message_factory.GetMessageClass
    else:  # protobuf before 4.22
        class_of = message_factory.MessageFactory(pool).GetPrototype
    built: dict[str, Any] = {}
    for name in files:
        file = pool.FindFileByName(name)
        for short, message in file.message_types_by_name.items():
            built[short] = class_of(message)
        for short, enum in file.enum_types_by_name.items():
            built[short] = enum_type_wrapper.EnumTypeWrapper(enum)
            built.update((value.name, value.number) for value in enum.values)
    return built


_CLASSES = _build_classes()
globals().update(_CLASSES)
__all__ = sorted(_CLASSES)  # noqa: PLE0605
