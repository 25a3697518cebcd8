"""The 39 topics of WheelArm-Sim's recorder, under its names.

``processed_data/desired_pose`` is in millimetres and without a timestamp, as in
WheelArm-Sim; all others are in SI units. When another node publishes one of them
(WheelArm-Sim's ``data_processing_node`` or ``manual_control_node``), this node does not.
"""

from __future__ import annotations

from geometry_msgs.msg import (
    Pose,
    PoseStamped,
    QuaternionStamped,
    TwistStamped,
    Vector3Stamped,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState

from . import mapping
from .outputs import IMAGES, Outputs
from .robot import Robot

PREFIX = "processed_data"
IMU = f"{PREFIX}/imu"
DESIRED_POSE = f"{PREFIX}/desired_pose"
TIMESTEPS = f"{PREFIX}/timesteps"
#: Orientation, linear acceleration, angular velocity.
IMU_TOPICS = (f"{IMU}/orientation", f"{IMU}/linear_acceleration", f"{IMU}/angular_velocity")


def joint_topic(joint: str) -> str:
    """Topic of one joint."""
    return f"{PREFIX}/joint_state/{joint}"


def pose_topic(frame: str) -> str:
    """Topic of one frame's pose."""
    return f"{PREFIX}/cartesian_pose/{frame}"


def velocity_topic(frame: str) -> str:
    """Topic of one frame's velocity."""
    return f"{PREFIX}/cartesian_velocity/{frame}"


def image_topics(camera: str) -> tuple[str, str]:
    """Topics of a camera's color and depth; WheelArm-Sim has another name for the camera in
    the home."""
    if camera == "room":
        return f"{PREFIX}/rgb/cam_livingroom", f"{PREFIX}/depth/cam_livingroom"
    return f"{PREFIX}/cameras/rgb/{camera}", f"{PREFIX}/cameras/depth/{camera}"


class SeedTopics:
    """Publishes samples under WheelArm-Sim's names."""

    def __init__(self, outputs: Outputs, robot: Robot, cameras: list[str]):
        self.outputs, self.robot = outputs, robot
        kinds: dict[str, type] = {
            DESIRED_POSE: Pose,
            TIMESTEPS: Clock,
            f"{IMU}/orientation": QuaternionStamped,
            f"{IMU}/linear_acceleration": Vector3Stamped,
            f"{IMU}/angular_velocity": Vector3Stamped,
        }
        kinds |= {joint_topic(joint): JointState for joint in robot.joints}
        kinds |= {pose_topic(name): PoseStamped for name, *_ in robot.frames}
        kinds |= {velocity_topic(name): TwistStamped for name, *_ in robot.frames}
        images = [topic for camera in cameras for topic in image_topics(camera)]
        for topic, kind in kinds.items():
            outputs.declare(topic, kind)
        for topic in images:
            outputs.declare(topic, Image, IMAGES)
        #: Every topic that is published.
        self.topics = [*kinds, *images]

    def joints(self, sample) -> None:
        """Publishes a ``wheelarm.v1.JointState``."""
        names = self.robot.joints
        for index, name in enumerate(names):
            self.outputs.publish(
                joint_topic(name), lambda i=index: mapping.one_joint(sample, names, i)
            )

    def poses(self, sample) -> None:
        """Publishes a ``wheelarm.v1.PoseSet``."""
        stamp = sample.header.stamp_nanos
        for (name, parent, _), frame in zip(self.robot.frames, sample.frames, strict=False):
            self.outputs.publish(
                pose_topic(name),
                lambda pose=frame.pose, parent=parent: mapping.pose_stamped(pose, stamp, parent),
            )
            self.outputs.publish(
                velocity_topic(name),
                lambda twist=frame.twist, parent=parent: mapping.twist_stamped(
                    twist, stamp, parent
                ),
            )

    def imu(self, sample) -> None:
        """Publishes a ``wheelarm.v1.Imu``."""
        stamp, frame = sample.header.stamp_nanos, self.robot.imu
        self.outputs.publish(
            f"{IMU}/orientation",
            lambda: mapping.quaternion_stamped(sample.orientation, stamp, frame),
        )
        self.outputs.publish(
            f"{IMU}/linear_acceleration",
            lambda: mapping.vector_stamped(sample.linear_acceleration, stamp, frame),
        )
        self.outputs.publish(
            f"{IMU}/angular_velocity",
            lambda: mapping.vector_stamped(sample.angular_velocity, stamp, frame),
        )

    def applied(self, sample) -> None:
        """Publishes the desired pose of a ``wheelarm.v1.Applied``."""
        self.outputs.publish(DESIRED_POSE, lambda: mapping.pose_in_millimetres(sample.desired_pose))

    def clock(self, header) -> None:
        """Publishes the time of a ``wheelarm.v1.Clock``, from its header."""
        self.outputs.publish(TIMESTEPS, lambda: mapping.clock(header.stamp_nanos))
