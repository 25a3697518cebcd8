"""Client of WheelArm, a headless simulator of a wheelchair with a robotic arm.

    import wheelarm

    with wheelarm.Server(task="pick_mustard", pacing="lock-step") as server:
        with server.connect() as client, client.lockstep("me") as episode:
            moment = episode.step(wheelarm.command(linear=0.3, over_ticks=6))
            print(moment.samples["joint_state"].arrays()["position"])

SI units, radians, z up, quaternions x y z w. `wheelarm.v1` contains the messages.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as _version

from . import v1
from ._contract import CONTRACT_VERSION, TASKS
from .client import Client, camera_setting, connect, make_scenario
from .commander import Commander, command
from .errors import (
    EpisodeEndedError,
    ForkedError,
    GarbledError,
    GoneError,
    NoServerError,
    OtherNameError,
    OtherVersionError,
    RefusedError,
    SilentError,
    WheelArmError,
)
from .frame import Frame
from .local import Server, find_program
from .lockstep import LockStep, Moment
from .streams import Camera, Sample, Streams, arrays, pose, quaternion, twist, vector

try:
    __version__ = _version("wheelarm")
except PackageNotFoundError:  # used from a checkout without installation
    __version__ = "0.0.0"

__all__ = [
    "CONTRACT_VERSION",
    "TASKS",
    "Camera",
    "Client",
    "Commander",
    "EpisodeEndedError",
    "ForkedError",
    "Frame",
    "GarbledError",
    "GoneError",
    "LockStep",
    "Moment",
    "NoServerError",
    "OtherNameError",
    "OtherVersionError",
    "RefusedError",
    "Sample",
    "Server",
    "SilentError",
    "Streams",
    "WheelArmError",
    "__version__",
    "arrays",
    "camera_setting",
    "command",
    "connect",
    "find_program",
    "make_scenario",
    "pose",
    "quaternion",
    "twist",
    "v1",
    "vector",
]

_ENVIRONMENTS = ["WheelArmEnv", "WheelArmVectorEnv", "env_id", "register_task"]

try:
    import gymnasium as _gymnasium  # noqa: F401
except ImportError:  # the environments are an optional extra

    def __getattr__(name: str) -> object:
        if name in _ENVIRONMENTS:
            raise ImportError(f"wheelarm.{name} needs Gymnasium: pip install 'gymnasium>=1.0,<2'")
        raise AttributeError(f"module 'wheelarm' has no attribute {name!r}")

else:
    from .env import WheelArmEnv, env_id, register_all, register_task
    from .vector import WheelArmVectorEnv

    register_all()
    __all__ += ["WheelArmEnv", "WheelArmVectorEnv", "env_id", "register_task"]
