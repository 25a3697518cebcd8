"""Images are read without a copy, and damaged messages are errors."""

from __future__ import annotations

import random

import numpy as np
import pytest

import wheelarm
from wheelarm import Frame, GarbledError, _wire, v1


def camera_frame(**more):
    depth = np.array([2.0, np.inf], "<f4")
    fields = {
        "header": v1.Header(tick=24, stamp_nanos=100_000_000, episode=3),
        "camera": "gen3",
        "intrinsics": v1.Intrinsics(width=2, height=1, fx=2.0, fy=2.0, cx=1.0, cy=0.5),
        "pose": v1.Pose(position=v1.Vector3(x=1.5)),
        "color": bytes([1, 2, 3, 4, 5, 6]),
        "depth": depth.tobytes(),
        "segmentation": np.array([256, 7], "<u2").tobytes(),
        "color_format": v1.PIXEL_FORMAT_RGB8,
        "depth_format": v1.PIXEL_FORMAT_DEPTH_METRES_F32,
        "segmentation_format": v1.PIXEL_FORMAT_ID_U16,
    }
    return v1.CameraFrame(**{**fields, **more})


def test_planes_are_views_of_the_received_bytes():
    data = camera_frame().SerializeToString()
    frame = Frame.from_bytes(data)
    assert (frame.camera, frame.tick, frame.header.episode) == ("gen3", 24, 3)
    assert frame.pose.position.x == 1.5
    assert frame.color.tolist() == [[[1, 2, 3], [4, 5, 6]]]
    assert frame.depth.tolist() == [[2.0, np.inf]]
    assert frame.segmentation.tolist() == [[256, 7]]
    whole = np.frombuffer(data, np.uint8)
    for plane in (frame.color, frame.depth_raw, frame.segmentation):
        assert np.shares_memory(plane, whole) and not plane.flags.writeable
    # Counted from the centre of the first pixel, as in OpenCV.
    assert frame.matrix.tolist() == [[2.0, 0.0, 0.5], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]]


def test_depth_in_millimetres_and_8_bit_ids_are_read():
    coarse = camera_frame(
        depth=np.array([2000, 0], "<u2").tobytes(),
        depth_format=v1.PIXEL_FORMAT_DEPTH_MILLIMETRES_U16,
        segmentation=bytes([3, 9]),
        segmentation_format=v1.PIXEL_FORMAT_ID_U8,
    )
    frame = Frame.from_bytes(coarse.SerializeToString())
    assert frame.depth.tolist() == [[2.0, np.inf]] and frame.depth.dtype == np.float32
    assert frame.segmentation.tolist() == [[3, 9]]


def test_sensor_frame_without_color_and_ids_is_read():
    frame = Frame.from_bytes(
        v1.SensorFrame(
            header=v1.Header(tick=7),
            sensor="gen3_depth",
            camera="gen3",
            intrinsics=v1.Intrinsics(width=1, height=1),
            depth=b"\x01\x02",
            depth_format=v1.PIXEL_FORMAT_DEPTH_MILLIMETRES_U16,
            exposure_nanos=5,
        ).SerializeToString()
    )
    assert frame.color is None and frame.segmentation is None
    assert frame.depth_raw.tolist() == [[0x0201]]


@pytest.mark.parametrize(
    "change",
    [
        {"depth": b"1234567"},
        {"color": b"", "depth": b"1"},
        {"segmentation_format": 99},
        {"color_format": v1.PIXEL_FORMAT_ID_U8},
        {"intrinsics": v1.Intrinsics(width=2**32 - 1, height=2**32 - 1)},
    ],
)
def test_plane_that_does_not_match_its_format_raises(change):
    with pytest.raises(GarbledError):
        Frame.from_bytes(camera_frame(**change).SerializeToString())


def test_damaged_bytes_raise_only_garbled_or_unicode_errors():
    good, random_ = camera_frame().SerializeToString(), random.Random(0)
    rejected = 0
    for _ in range(3000):
        data = bytearray(good)
        for _ in range(random_.randint(1, 4)):
            data[random_.randrange(len(data))] = random_.randrange(256)
        damaged = bytes(data[: random_.randint(0, len(data))])
        try:
            Frame.from_bytes(damaged)
        except (GarbledError, UnicodeDecodeError):
            rejected += 1
    assert rejected > 1000


def test_arrays_have_the_column_names_of_recordings():
    joints = v1.JointState(positions=[1.0, 2.0], velocities=[3.0, 4.0])
    columns = wheelarm.arrays(joints)
    assert columns["position"].tolist() == [1.0, 2.0]
    assert columns["velocity"].tolist() == [3.0, 4.0]
    assert np.isnan(columns["opening"])
    frame = v1.FramePose(pose=v1.Pose(orientation=v1.Quaternion(w=1.0)), twist=v1.Twist())
    poses = wheelarm.arrays(v1.PoseSet(frames=[frame, frame]))
    assert poses["pose"].shape == (2, 7) and poses["twist"].shape == (2, 6)
    assert poses["pose"][0].tolist() == [0, 0, 0, 0, 0, 0, 1]
    assert wheelarm.arrays(v1.ObjectPoses())["pose"].shape == (0, 7)
    assert wheelarm.arrays(v1.Deformable(vertices=[0, 1, 2]))["vertex"].shape == (1, 3)


def test_invalid_names_raise():
    for bad in ("", "a/b", "*", "ü", "x" * 65):
        with pytest.raises(ValueError, match="letters"):
            _wire.check_name(bad)
