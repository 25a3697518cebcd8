"""The 39 topics of WheelArm-Sim's recorder, under its names.

``processed_data/desired_pose`` is in millimetres and has no stamp, as there; all
else is in SI units. Where another node publishes one of them (WheelArm-Sim's own
``data_processing_node`` or ``manual_control_node``), this node is silent on it.
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
from .outputs import PICTURES, Outputs
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


def picture_topics(camera: str) -> tuple[str, str]:
    """Topics of a camera's colour and depth; WheelArm-Sim's house camera has a name
    of its own."""
    if camera == "room":
        return f"{PREFIX}/rgb/cam_livingroom", f"{PREFIX}/depth/cam_livingroom"
    return f"{PREFIX}/cameras/rgb/{camera}", f"{PREFIX}/cameras/depth/{camera}"


class SeedTopics:
    """Publishes what is sampled under WheelArm-Sim's names."""

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
        pictures = [topic for camera in cameras for topic in picture_topics(camera)]
        for topic, kind in kinds.items():
            outputs.declare(topic, kind)
        for topic in pictures:
            outputs.declare(topic, Image, PICTURES)
        #: Every topic that is published.
        self.topics = [*kinds, *pictures]

    def joints(self, sample) -> None:
        """Takes a ``wheelarm.v1.JointState``."""
        names = self.robot.joints
        for index, name in enumerate(names):
            self.outputs.put(joint_topic(name), lambda i=index: mapping.one_joint(sample, names, i))

    def poses(self, sample) -> None:
        """Takes a ``wheelarm.v1.PoseSet``."""
        stamp = sample.header.stamp_nanos
        for (name, parent, _), frame in zip(self.robot.frames, sample.frames, strict=False):
            self.outputs.put(
                pose_topic(name),
                lambda pose=frame.pose, parent=parent: mapping.pose_stamped(pose, stamp, parent),
            )
            self.outputs.put(
                velocity_topic(name),
                lambda twist=frame.twist, parent=parent: mapping.twist_stamped(
                    twist, stamp, parent
                ),
            )

    def imu(self, sample) -> None:
        """Takes a ``wheelarm.v1.Imu``."""
        stamp, frame = sample.header.stamp_nanos, self.robot.imu
        self.outputs.put(
            f"{IMU}/orientation",
            lambda: mapping.quaternion_stamped(sample.orientation, stamp, frame),
        )
        self.outputs.put(
            f"{IMU}/linear_acceleration",
            lambda: mapping.vector_stamped(sample.linear_acceleration, stamp, frame),
        )
        self.outputs.put(
            f"{IMU}/angular_velocity",
            lambda: mapping.vector_stamped(sample.angular_velocity, stamp, frame),
        )

    def applied(self, sample) -> None:
        """Takes a ``wheelarm.v1.Applied``: the desired pose."""
        self.outputs.put(DESIRED_POSE, lambda: mapping.pose_in_millimetres(sample.desired_pose))

    def clock(self, header) -> None:
        """Takes the header of a ``wheelarm.v1.Clock``."""
        self.outputs.put(TIMESTEPS, lambda: mapping.clock(header.stamp_nanos))
