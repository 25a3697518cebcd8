"""Conversion of WheelArm messages to ROS 2 messages: pure functions.

Both sides use SI units, radians, z up and quaternions x y z w, so numbers are equal, with
two exceptions: ROS counts pixels from the centre of the first pixel, WheelArm from its edge
(``camera_info``), and depth may be in millimetres (``depth_image``). Timestamps are
simulation time.
"""

from __future__ import annotations

import array
import math
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    QuaternionStamped,
    Transform,
    TransformStamped,
    Twist,
    TwistStamped,
    Vector3,
    Vector3Stamped,
)
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, Imu, JointState, LaserScan
from std_msgs.msg import Header

from .robot import WORLD
from .tree import Transform as TreeTransform

#: Encodings of depth: metres as float32, or millimetres as 16 bits (REP 118).
DEPTH_ENCODINGS = ("32FC1", "16UC1")


def time(stamp_nanos: int) -> Time:
    """A timestamp from simulation time, nanoseconds."""
    seconds, nanos = divmod(int(stamp_nanos), 1_000_000_000)
    return Time(sec=seconds, nanosec=nanos)


def nanos(stamp: Time) -> int:
    """Nanoseconds of a timestamp."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def header(stamp_nanos: int, frame: str) -> Header:
    """A header of simulation time and a frame."""
    return Header(stamp=time(stamp_nanos), frame_id=frame)


def point(vector) -> Point:
    """``wheelarm.v1.Vector3`` as a point."""
    return Point(x=vector.x, y=vector.y, z=vector.z)


def vector(vector) -> Vector3:
    """``wheelarm.v1.Vector3`` as a vector."""
    return Vector3(x=vector.x, y=vector.y, z=vector.z)


def quaternion(value) -> Quaternion:
    """``wheelarm.v1.Quaternion``; an absent one is the identity."""
    if value.x == value.y == value.z == value.w == 0.0:
        return Quaternion(w=1.0)
    return Quaternion(x=value.x, y=value.y, z=value.z, w=value.w)


def pose(value) -> Pose:
    """``wheelarm.v1.Pose``, metres."""
    return Pose(position=point(value.position), orientation=quaternion(value.orientation))


def twist(value) -> Twist:
    """``wheelarm.v1.Twist``, m/s and rad/s."""
    return Twist(linear=vector(value.linear), angular=vector(value.angular))


def pose_in_millimetres(value) -> Pose:
    """``wheelarm.v1.Pose`` with its position in millimetres, as in WheelArm-Sim's
    ``processed_data/desired_pose``."""
    place = value.position
    return Pose(
        position=Point(x=1e3 * place.x, y=1e3 * place.y, z=1e3 * place.z),
        orientation=quaternion(value.orientation),
    )


def clock(stamp_nanos: int) -> Clock:
    """Simulation time."""
    return Clock(clock=time(stamp_nanos))


def joint_state(sample, names: Sequence[str]) -> JointState:
    """``wheelarm.v1.JointState``, rad, rad/s and N·m; ``names`` are the joints of the robot's
    description, in its order."""
    return JointState(
        header=header(sample.header.stamp_nanos, ""),
        name=list(names),
        position=array.array("d", sample.positions),
        velocity=array.array("d", sample.velocities),
        effort=array.array("d", sample.efforts),
    )


def furniture_joints(sample, names: Sequence[str]) -> JointState:
    """``wheelarm.v1.FurnitureJoints``: m and m/s of drawers, rad and rad/s of doors."""
    return JointState(
        header=header(sample.header.stamp_nanos, ""),
        name=list(names),
        position=array.array("d", sample.positions),
        velocity=array.array("d", sample.velocities),
    )


def one_joint(sample, names: Sequence[str], index: int) -> JointState:
    """One joint of ``wheelarm.v1.JointState``, without effort, as in WheelArm-Sim's
    ``processed_data/joint_state/{joint}``."""
    return JointState(
        header=header(sample.header.stamp_nanos, ""),
        name=[names[index]],
        position=array.array("d", [sample.positions[index]]),
        velocity=array.array("d", [sample.velocities[index]]),
    )


def imu(sample, frame: str) -> Imu:
    """``wheelarm.v1.Imu`` of the link ``frame``; at rest +9.81 m/s² along z.
    Covariances of 0 mean unknown."""
    return Imu(
        header=header(sample.header.stamp_nanos, frame),
        orientation=quaternion(sample.orientation),
        angular_velocity=vector(sample.angular_velocity),
        linear_acceleration=vector(sample.linear_acceleration),
    )


def laser_scan(sample, scanner, rate_hz: float) -> LaserScan:
    """``wheelarm.v1.Scan`` or ``SensedScan`` of a ``wheelarm.v1.ScannerDescription``. All rays
    have one time; distances are infinite as REP 117 defines it."""
    return LaserScan(
        header=header(sample.header.stamp_nanos, scanner.frame),
        angle_min=scanner.first_angle,
        angle_max=scanner.first_angle + scanner.angle_step * max(scanner.rays - 1, 0),
        angle_increment=scanner.angle_step,
        scan_time=1.0 / rate_hz if rate_hz > 0.0 else 0.0,
        range_min=scanner.least_range,
        range_max=scanner.greatest_range,
        ranges=array.array("f", sample.ranges),
    )


def occupancy_grid(home, layer: str) -> OccupancyGrid:
    """A layer of ``wheelarm.v1.MapReply``, ``occupied`` or ``free``, in the world frame."""
    stamp = home.header.stamp_nanos
    cells = array.array("b")
    cells.frombytes(getattr(home, layer))
    return OccupancyGrid(
        header=header(stamp, WORLD),
        info=MapMetaData(
            map_load_time=time(stamp),
            resolution=home.resolution,
            width=home.width,
            height=home.height,
            origin=Pose(position=Point(x=home.x, y=home.y), orientation=Quaternion(w=1.0)),
        ),
        data=cells,
    )


def odometry(sample, frame: str, child: str) -> Odometry:
    """``wheelarm.v1.Odometry``: the pose of ``child`` in ``frame``, its twist in
    ``child``. Covariances of 0 mean unknown."""
    message = Odometry(header=header(sample.header.stamp_nanos, frame), child_frame_id=child)
    message.pose.pose = pose(sample.pose)
    message.twist.twist = twist(sample.twist)
    return message


def pose_stamped(value, stamp_nanos: int, frame: str) -> PoseStamped:
    """``wheelarm.v1.Pose`` in ``frame``, metres."""
    return PoseStamped(header=header(stamp_nanos, frame), pose=pose(value))


def twist_stamped(value, stamp_nanos: int, frame: str) -> TwistStamped:
    """``wheelarm.v1.Twist`` in ``frame``, m/s and rad/s."""
    return TwistStamped(header=header(stamp_nanos, frame), twist=twist(value))


def quaternion_stamped(value, stamp_nanos: int, frame: str) -> QuaternionStamped:
    """``wheelarm.v1.Quaternion`` with a timestamp and a frame."""
    return QuaternionStamped(header=header(stamp_nanos, frame), quaternion=quaternion(value))


def vector_stamped(value, stamp_nanos: int, frame: str) -> Vector3Stamped:
    """``wheelarm.v1.Vector3`` with a timestamp and a frame."""
    return Vector3Stamped(header=header(stamp_nanos, frame), vector=vector(value))


def transform_stamped(
    transform: TreeTransform, stamp_nanos: int, parent: str, child: str
) -> TransformStamped:
    """Pose of ``child`` in ``parent``."""
    (x, y, z), (qx, qy, qz, qw) = transform
    return TransformStamped(
        header=header(stamp_nanos, parent),
        child_frame_id=child,
        transform=Transform(
            translation=Vector3(x=x, y=y, z=z),
            rotation=Quaternion(x=qx, y=qy, z=qz, w=qw),
        ),
    )


def _bytes(pixels: np.ndarray) -> array.array:
    # rclpy copies an `array.array` at once, but a numpy array element by element, which needs
    # 0.4 s per image.
    data = array.array("B")
    data.frombytes(memoryview(np.ascontiguousarray(pixels)).cast("B"))
    return data


def _image(pixels: np.ndarray, encoding: str, stamp_nanos: int, frame: str) -> Image:
    height, width = pixels.shape[:2]
    message = Image(
        header=header(stamp_nanos, frame),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=pixels.nbytes // height if height else 0,
    )
    message.data = _bytes(pixels)
    return message


def color_image(rgb: np.ndarray, stamp_nanos: int, frame: str) -> Image:
    """``rgb8`` from color of shape (height, width, 3), uint8."""
    if rgb.dtype != np.uint8 or rgb.ndim != 3 or rgb.shape[2] != 3:
        raise ValueError(
            f"color is {rgb.dtype} of shape {rgb.shape}, expected uint8 of (height, width, 3)"
        )
    return _image(rgb, "rgb8", stamp_nanos, frame)


def depth_image(depth: np.ndarray, encoding: str, stamp_nanos: int, frame: str) -> Image:
    """Depth from metres of shape (height, width), float32, +inf without a surface.

    ``32FC1`` keeps metres and +inf; ``16UC1`` is millimetres, rounded, and 0 without a surface
    within 65.535 m (REP 117, REP 118).
    """
    if depth.dtype != np.float32 or depth.ndim != 2:
        raise ValueError(
            f"depth is {depth.dtype} of shape {depth.shape}, expected float32 of (height, width)"
        )
    if encoding == "32FC1":
        return _image(depth.astype("<f4", copy=False), encoding, stamp_nanos, frame)
    if encoding == "16UC1":
        millimetres = np.rint(depth * np.float32(1e3))
        fits = millimetres <= 65535
        pixels = np.where(fits, millimetres, 0).astype("<u2")
        return _image(pixels, encoding, stamp_nanos, frame)
    raise ValueError(
        f"unknown depth encoding {encoding!r}; available: {', '.join(DEPTH_ENCODINGS)}"
    )


def camera_info(intrinsics, stamp_nanos: int, frame: str) -> CameraInfo:
    """``wheelarm.v1.Intrinsics`` as a pinhole without distortion (``plumb_bob``).

    The centre of the first pixel is (0.5, 0.5) in WheelArm and (0, 0) in ROS, so the
    principal point is reduced by 0.5.
    """
    fx, fy = intrinsics.fx, intrinsics.fy
    cx, cy = intrinsics.cx - 0.5, intrinsics.cy - 0.5
    return CameraInfo(
        header=header(stamp_nanos, frame),
        height=intrinsics.height,
        width=intrinsics.width,
        distortion_model="plumb_bob",
        d=[0.0] * 5,
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def is_finite(*numbers: float) -> bool:
    """Whether all numbers are finite."""
    return all(map(math.isfinite, numbers))
