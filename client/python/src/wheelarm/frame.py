"""Pictures of cameras as numpy arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import v1
from ._wire import read, walk
from .errors import Garbled

#: Pixel format: what is stored, bytes of a pixel.
_FORMATS: dict[int, tuple[str, Any, int]] = {
    1: ("rgb", np.dtype("u1"), 3),
    2: ("depth", np.dtype("<f4"), 1),
    3: ("depth", np.dtype("<u2"), 1),
    4: ("ids", np.dtype("u1"), 1),
    5: ("ids", np.dtype("<u2"), 1),
}
_FIRST = {"rgb": 1, "depth": 2, "ids": 4}
_MILLIMETRES = 3


@dataclass(frozen=True)
class Frame:
    """One picture of one camera: colour, depth and instance ids, registered.

    The arrays are read-only views into the message as it came; ``.copy()`` gives one
    that may be changed.

    Attributes:
        camera: Name of the camera or sensor.
        header: Stamp of the exposure (of a sensor, of the arrival).
        intrinsics: Pinhole intrinsics, pixels; the middle of the first pixel is at
            (0.5, 0.5). OpenCV and ROS count from its middle: subtract 0.5 from cx and cy.
        pose: Pose of the optical frame (z forward, x right, y down) in `house`, metres.
        rgb: Colour, (height, width, 3) uint8, sRGB. None where a sensor has none.
        depth_raw: Depth along the optical axis as it was sent, (height, width): float32
            in metres, infinite where nothing is hit, or uint16 in millimetres, 0 where
            nothing is hit. None where a sensor has none.
        ids: Instance ids, (height, width) uint16 or uint8; 0 where nothing is hit. The
            scene query tells what they stand for. None where a sensor has none.
    """

    camera: str
    header: v1.Header
    intrinsics: v1.Intrinsics
    pose: v1.Pose
    rgb: NDArray[np.uint8] | None
    depth_raw: NDArray[Any] | None
    ids: NDArray[Any] | None

    @property
    def tick(self) -> int:
        """Physics tick of the stamp, 240 per second of simulation time."""
        return int(self.header.tick)

    @property
    def stamp(self) -> float:
        """Simulation time of the stamp, s."""
        return float(self.header.stamp_nanos) * 1e-9

    @property
    def depth(self) -> NDArray[np.float32] | None:
        """Depth along the optical axis, (height, width) float32, metres; infinite where
        nothing is hit. No copy where it was sent so."""
        raw = self.depth_raw
        if raw is None or raw.dtype == np.float32:
            return raw
        metres = raw.astype(np.float32) * np.float32(1e-3)
        metres[raw == 0] = np.inf
        return metres

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Intrinsics as a matrix, (3, 3), pixels, counted from the middle of the first
        pixel as OpenCV does."""
        i = self.intrinsics
        return np.array([[i.fx, 0.0, i.cx - 0.5], [0.0, i.fy, i.cy - 0.5], [0.0, 0.0, 1.0]])

    @classmethod
    def of(cls, data: bytes) -> Frame:
        """Reads an encoded `CameraFrame` or `SensorFrame` without copying its planes.

        Raises:
            Garbled: when a plane has another length than size and format say.
        """
        camera, header, intrinsics, pose = "", v1.Header(), v1.Intrinsics(), v1.Pose()
        planes: dict[str, memoryview] = {}
        formats = dict(_FIRST)
        for field, value in walk(data):
            if isinstance(value, int):
                if field in (8, 9, 10) and value:
                    formats[("rgb", "depth", "ids")[field - 8]] = value
            elif field == 1:
                header = read(v1.Header, value.tobytes(), "header")
            elif field == 2:
                camera = value.tobytes().decode()
            elif field == 3:
                intrinsics = read(v1.Intrinsics, value.tobytes(), "intrinsics")
            elif field == 4:
                pose = read(v1.Pose, value.tobytes(), "pose")
            elif field in (5, 6, 7):
                planes[("rgb", "depth", "ids")[field - 5]] = value
        width, height = intrinsics.width, intrinsics.height

        def plane(name: str) -> NDArray[Any] | None:
            if name not in planes:
                return None
            wanted, dtype, channels = _FORMATS.get(formats[name], ("", None, 0))
            if wanted != name:
                raise Garbled(
                    f"the plane `{name}` has the pixel format {formats[name]}, which this "
                    "package cannot read: use server and package of one release"
                )
            found, expected = len(planes[name]), width * height * channels * dtype.itemsize
            if found != expected:
                raise Garbled(
                    f"the plane `{name}` has {found} bytes, expected {expected} for {width}x{height}"
                )
            shape = (height, width, 3) if channels == 3 else (height, width)
            return np.frombuffer(planes[name], dtype=dtype).reshape(shape)

        return cls(camera, header, intrinsics, pose, plane("rgb"), plane("depth"), plane("ids"))
