"""Camera images as numpy arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import v1
from ._wire import read, walk
from .errors import GarbledError

#: Pixel format: plane, type of a value, values of a pixel.
_FORMATS: dict[int, tuple[str, Any, int]] = {
    int(v1.PIXEL_FORMAT_RGB8): ("color", np.dtype("u1"), 3),
    int(v1.PIXEL_FORMAT_DEPTH_METRES_F32): ("depth", np.dtype("<f4"), 1),
    int(v1.PIXEL_FORMAT_DEPTH_MILLIMETRES_U16): ("depth", np.dtype("<u2"), 1),
    int(v1.PIXEL_FORMAT_ID_U8): ("segmentation", np.dtype("u1"), 1),
    int(v1.PIXEL_FORMAT_ID_U16): ("segmentation", np.dtype("<u2"), 1),
}
#: Formats of planes without one.
_DEFAULTS = {
    "color": int(v1.PIXEL_FORMAT_RGB8),
    "depth": int(v1.PIXEL_FORMAT_DEPTH_METRES_F32),
    "segmentation": int(v1.PIXEL_FORMAT_ID_U8),
}
#: Field numbers of `CameraFrame`; `SensorFrame` has the same, with `sensor` for `camera`.
_NUMBER = {field.name: field.number for field in v1.CameraFrame.DESCRIPTOR.fields}
_PLANES = {_NUMBER[name]: name for name in _DEFAULTS}
_PLANE_FORMATS = {_NUMBER[f"{name}_format"]: name for name in _DEFAULTS}


@dataclass(frozen=True)
class Frame:
    """One image of one camera: color, depth and instance ids of the same pixels.

    The arrays are read-only views of the received message; ``.copy()`` makes a writable one.

    Attributes:
        camera: Name of the camera or sensor.
        header: Header of the exposure (of a sensor: of the arrival).
        intrinsics: Pinhole intrinsics, pixels; the centre of the first pixel is at
            (0.5, 0.5). OpenCV and ROS count from this centre: subtract 0.5 from cx and cy.
        pose: Pose of the optical frame (z forward, x right, y down) in `house`, metres.
        color: Color, (height, width, 3) uint8, sRGB. None for a sensor without color.
        depth_raw: Depth along the optical axis as sent, (height, width): float32 in metres,
            infinite without a surface, or uint16 in millimetres, 0 without a surface. None
            for a sensor without depth.
        segmentation: Instance ids, (height, width) uint16 or uint8; 0 without a surface. The scene
            query lists their bodies. None for a sensor.
    """

    camera: str
    header: v1.Header
    intrinsics: v1.Intrinsics
    pose: v1.Pose
    color: NDArray[np.uint8] | None
    depth_raw: NDArray[Any] | None
    segmentation: NDArray[Any] | None

    @property
    def tick(self) -> int:
        """Physics tick of the timestamp, 240 per second of simulation time."""
        return int(self.header.tick)

    @property
    def stamp(self) -> float:
        """Simulation time of the timestamp, s."""
        return float(self.header.stamp_nanos) * 1e-9

    @property
    def depth(self) -> NDArray[np.float32] | None:
        """Depth along the optical axis, (height, width) float32, metres; infinite without a
        surface. Not a copy if it was sent in this format."""
        raw = self.depth_raw
        if raw is None or raw.dtype == np.float32:
            return raw
        metres = raw.astype(np.float32) * np.float32(1e-3)
        metres[raw == 0] = np.inf
        return metres

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Intrinsics as a matrix, (3, 3), pixels, counted from the centre of the first pixel,
        as in OpenCV."""
        i = self.intrinsics
        return np.array([[i.fx, 0.0, i.cx - 0.5], [0.0, i.fy, i.cy - 0.5], [0.0, 0.0, 1.0]])

    @classmethod
    def from_bytes(cls, data: bytes) -> Frame:
        """Decodes a `CameraFrame` or `SensorFrame` without a copy of its planes.

        Raises:
            GarbledError: when a plane does not match its size and format.
        """
        camera, header, intrinsics, pose = "", v1.Header(), v1.Intrinsics(), v1.Pose()
        planes: dict[str, memoryview] = {}
        formats = dict(_DEFAULTS)
        for field, value in walk(data):
            if isinstance(value, int):
                if field in _PLANE_FORMATS and value:
                    formats[_PLANE_FORMATS[field]] = value
            elif field == _NUMBER["header"]:
                header = read(v1.Header, value.tobytes(), "header")
            elif field == _NUMBER["camera"]:
                camera = value.tobytes().decode()
            elif field == _NUMBER["intrinsics"]:
                intrinsics = read(v1.Intrinsics, value.tobytes(), "intrinsics")
            elif field == _NUMBER["pose"]:
                pose = read(v1.Pose, value.tobytes(), "pose")
            elif field in _PLANES:
                planes[_PLANES[field]] = value
        width, height = intrinsics.width, intrinsics.height

        def plane(name: str) -> NDArray[Any] | None:
            if name not in planes:
                return None
            stored, dtype, channels = _FORMATS.get(formats[name], ("", None, 0))
            if stored != name:
                # This text and the next are those of `BadFrame` of the Rust SDK.
                raise GarbledError(
                    f"the plane `{name}` has the pixel format {formats[name]}, which this "
                    "version cannot read: use client and server of one build"
                )
            found, expected = len(planes[name]), width * height * channels * dtype.itemsize
            if found != expected:
                raise GarbledError(
                    f"the plane `{name}` has {found} bytes, expected {expected} for {width}x{height}"
                )
            shape = (height, width, 3) if channels == 3 else (height, width)
            return np.frombuffer(planes[name], dtype=dtype).reshape(shape)

        return cls(camera, header, intrinsics, pose, plane("color"), plane("depth"), plane("segmentation"))
