"""Client of one server: queries, streams, cameras, control."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

from . import v1
from ._connection import Connection
from ._session import DEFAULT_ENDPOINT, refuse_fork
from ._wire import check_name, check_topic
from .commander import Commander
from .lockstep import LockStep
from .packs import put_requests, zip_bytes
from .streams import Camera, Streams


def connect(endpoint: str = DEFAULT_ENDPOINT, sim: str = "sim", *, timeout: float = 5.0) -> Client:
    """Connects to a server and checks that both sides use one version of the contract.

    Args:
        endpoint: Endpoint of the server, for example ``tcp/127.0.0.1:7447``.
        sim: Name of the server; several servers can share one network.
        timeout: Time limit, s.

    Raises:
        NoServerError: when no server listens.
        OtherNameError: when the server has another name.
        OtherVersionError: when the server uses another version of the contract.
    """
    return Client(endpoint, sim, timeout=timeout)


class Client(Connection):
    """A connection to one server. Close it, or use it as a context manager.

    Samples and replies of any session but the server's are dropped.
    """

    # -- queries ---------------------------------------------------------------------

    def scene(self) -> v1.SceneReply:
        """The home: bodies, grasps, instance ids, goal, and the robot."""
        return self.request(v1.SceneRequest())

    def tasks(self) -> list[v1.TaskInfo]:
        """The tasks of the library."""
        return list(self.request(v1.TasksRequest()).tasks)

    def reach(self, pose: v1.Pose, near_joints: Iterable[float] = (), **more: Any) -> v1.ReachReply:
        """Whether the end effector can reach a pose in `base_link`, metres.

        Args:
            near_joints: Joint positions near which the solver searches, radians.
            more: Other fields of `v1.ReachRequest`.
        """
        return self.request(v1.ReachRequest(pose=pose, near_joints=list(near_joints), **more))

    def map(self, *, without_objects: bool = False) -> v1.MapReply:
        """The floor of the home in cells of 5 cm: where something stands, where this chair gets
        to, rooms and doors. ``numpy.frombuffer(map.free, "i1").reshape(map.height, map.width)``
        has y rows upwards: 0 free, 100 not, -1 outside."""
        return self.request(v1.MapRequest(without_objects=without_objects))

    def reset(
        self,
        scenario: v1.Scenario | Mapping[str, Any] | None = None,
        *,
        snapshot: bytes = b"",
        force: bool = False,
        **fields: Any,
    ) -> v1.Scenario:
        """Sets up a scenario: ``client.reset(task="pick_bowl", seed=7)``. Absent fields keep
        the value in force; see `v1.Scenario` for all fields.

        Args:
            scenario: The scenario; `fields` override its values.
            snapshot: A state to continue from (bytes of `v1.SnapshotReply`).
            force: Resets even if another client is in control.

        Returns:
            The scenario in force, with the sampled values.
        """
        requested = v1.Scenario()
        if isinstance(scenario, v1.Scenario):
            requested.CopyFrom(scenario)
        elif scenario is not None:
            fields = {**scenario, **fields}
        requested.MergeFrom(make_scenario(**fields))
        request = v1.ResetRequest(
            scenario=requested, snapshot=snapshot, force=force, secret=self._secret
        )
        return self.request(request).scenario

    def put_pack(self, path: str | os.PathLike[str]) -> v1.PackRef:
        """Sends a world pack, a folder or zip file, which the server stores; then its home is
        a scene: ``client.reset(scene=client.put_pack("anna-flat").name)``. Needs the role
        admin.

        Returns:
            Name, version and digests of the stored pack.

        Raises:
            ValueError: when `path` is not a pack, or is too large.
            RefusedError: when the server rejects the pack; the message has the fix.
        """
        reply = v1.PackPutReply()
        for request in put_requests(zip_bytes(path)):
            reply = self.request(request)
        return reply.pack

    def pause(self) -> None:
        """Pauses time."""
        self.request(v1.PauseRequest())

    def resume(self) -> None:
        """Resumes time."""
        self.request(v1.ResumeRequest())

    def snapshot(self) -> v1.SnapshotReply:
        """State, assets and instance ids at the first tick of the running episode."""
        return self.request(v1.SnapshotRequest())

    def shutdown(self, *, force: bool = False) -> None:
        """Ends the server; with `force` even if another client is in control."""
        self.request(v1.ShutdownRequest(force=force, secret=self._secret))

    # -- streams ---------------------------------------------------------------------

    def streams(self, *topics: str) -> Streams:
        """Subscribes to topics: ``for sample in client.streams("joint_state", "clock")``.

        Raises:
            ValueError: when a topic does not exist; the message lists all of them.
        """
        refuse_fork(self._owner)
        return Streams(self, [check_topic(topic) for topic in topics])

    def cameras(self) -> list[str]:
        """Names of the cameras that are in use."""
        cameras = self.status().scenario.cameras
        return [one.name for one in cameras if not one.HasField("rate_hz") or one.rate_hz > 0.0]

    def camera(self, name: str, *, queue_size: int = 1) -> Camera:
        """Subscribes to a camera; the newest `queue_size` images are kept (count).

        Raises:
            ValueError: when the camera is not in use; the message lists those in use.
        """
        found = self.cameras()
        if name not in found:
            # The text of `LinkError::NoCamera` of the Rust SDK.
            raise ValueError(
                f"the camera {name!r} is not in use (in use: {', '.join(found) or 'none'}): "
                "choose one of them, or ask for it when the server starts (--camera) or with a "
                "reset"
            )
        return Camera(self, self._key(f"camera/{check_name(name)}"), queue_size)

    def sensor(self, name: str, *, queue_size: int = 1) -> Camera:
        """Subscribes to the images of a sensor model, for example ``gen3_depth``."""
        refuse_fork(self._owner)
        return Camera(self, self._key(f"sensor/{check_name(name)}"), queue_size)

    # -- control ---------------------------------------------------------------------

    def commander(self, name: str, *, take: bool = False, sealed: bool = True) -> Commander:
        """Requests control under a name.

        Args:
            name: Letters, digits, ``-``, ``_``; 1 to 64.
            take: Takes control over from the client that holds it.
            sealed: Signs commands, so that no other client can command under this name.

        Raises:
            RefusedError: when another client holds control; the message names it.
        """
        refuse_fork(self._owner)
        return Commander(self, name, take=take, sealed=sealed)

    def lockstep(
        self,
        name: str = "python",
        label: str = "python",
        *,
        topics: Iterable[str] = ("joint_state", "pose", "odometry", "evaluation"),
        cameras: Iterable[str] = (),
        take: bool = False,
        recorders: int = 0,
        instruction: str | None = None,
    ) -> LockStep:
        """Starts an episode in lock-step, in which time waits for this program.

        Args:
            name: Name of the commander.
            label: Name of the episode's file.
            topics: Topics whose newest sample every step returns.
            cameras: Cameras whose newest image every step returns.
            take: Takes control over from the client that holds it.
            recorders: Recorders that must be ready (count).
            instruction: Sentence that is stored; the scenario's if absent.

        Raises:
            RefusedError: when the pacing is not lock-step, or an episode runs.
        """
        refuse_fork(self._owner)
        return LockStep(
            self,
            name,
            label,
            topics=tuple(topics),
            cameras=tuple(cameras),
            take=take,
            recorders=recorders,
            instruction=instruction,
        )

    def __enter__(self) -> Client:
        return self


def camera_setting(name: str, width: int, height: int, rate_hz: float = 10.0) -> v1.CameraSetting:
    """A camera of a scenario. The name ``*`` applies to every camera of the robot without a
    setting; ``room`` is the camera in the home. Pixels, 16 to 4096 each way, and Hz; a rate
    of 0 disables it."""
    return v1.CameraSetting(name=name, width=width, height=height, rate_hz=rate_hz)


_ENUM_PREFIXES = {"pacing": "PACING_", "quality": "RENDER_QUALITY_", "starts": "STARTS_"}


def make_scenario(**fields: Any) -> v1.Scenario:
    """A scenario from its fields. Pacing, quality and starts may be names:
    ``make_scenario(task="pick_bowl", pacing="lock-step", starts="anywhere")``.

    Raises:
        ValueError: when a field or a name is unknown.
    """
    for field, prefix in _ENUM_PREFIXES.items():
        value = fields.get(field)
        if isinstance(value, str):
            fields[field] = getattr(v1, prefix + value.upper().replace("-", "_"), None)
            if fields[field] is None:
                raise ValueError(f"unknown {field}={value!r}: see wheelarm.v1.Scenario")
    if fields.get("cameras") is not None:
        cameras = fields["cameras"]
        if isinstance(cameras, Mapping):
            cameras = [camera_setting(name, *size) for name, size in cameras.items()]
        fields["cameras"] = cameras
    try:
        return v1.Scenario(**{key: value for key, value in fields.items() if value is not None})
    except (ValueError, TypeError) as cause:
        known = ", ".join(field.name for field in v1.Scenario.DESCRIPTOR.fields)
        raise ValueError(f"invalid field of a scenario: {cause}; available: {known}") from None
