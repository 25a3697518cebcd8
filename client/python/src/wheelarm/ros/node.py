"""The node: topics in and out, and what holds them together."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections import deque

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, Imu, JointState
from std_msgs.msg import Float64, String
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory

from .. import v1
from ..client import Client
from ..errors import Gone, WheelArmError
from ..streams import Camera, Sample
from . import mapping, tree
from .command import CMD_VEL_TIMEOUT, Wishes
from .entities import Entities
from .outputs import LATCHED, PICTURES, TRANSFORMS, Outputs
from .pilot import Pilot
from .robot import ODOM, WORLD, Robot, optical_frame
from .seed import IMU_TOPICS, SeedTopics, picture_topics
from .services import HAS_STANDARD, StandardServices, trigger_services
from .simulation import EpisodeOptions, Simulation

STREAMS = ["joint_state", "pose", "imu", "odometry", "applied", "object_pose", "furniture_joint"]
#: Told by the server's own topics, in the order of arrival behind the streams.
OTHERS = ["clock", "refusal", "episode_stop"]
#: Seconds of silence after which the server is asked whether it is there.
SILENCE = 1.0


def color_topic(camera: str) -> str:
    """Where a camera's colours are published; its ``camera_info`` lies beside."""
    return f"camera/{camera}/color/image_raw"


def depth_topic(camera: str) -> str:
    """Where a camera's depth is published; its ``camera_info`` lies beside."""
    return f"camera/{camera}/depth/image_raw"


def info_topic(image_topic: str) -> str:
    """``camera_info`` beside a picture."""
    return image_topic.rsplit("/", 1)[0] + "/camera_info"


@dataclasses.dataclass(frozen=True)
class Options:
    """What is decided before the node starts; each is a parameter as well."""

    #: Endpoint of the server, as Zenoh writes it.
    endpoint: str = "tcp/127.0.0.1:7447"
    #: Name of the server.
    sim: str = "sim"
    #: Name of this commander.
    commander: str = "ros"
    #: Takes control over from whoever holds it.
    take: bool = False
    #: Also the 39 topics of WheelArm-Sim's recorder.
    seed_topics: bool = False
    #: ``cmd_vel`` is a TwistStamped.
    cmd_vel_stamped: bool = False
    #: Seconds of silence after which the chair stops.
    cmd_vel_timeout: float = CMD_VEL_TIMEOUT
    #: Seconds without a command after which control is given back; 0 keeps it.
    lease_timeout: float = 5.0
    #: Simulated seconds per second while lock-step time is played; 0 is no limit.
    play_rate: float = 1.0
    #: Encoding of depth, 32FC1 (metres) or 16UC1 (millimetres).
    depth_encoding: str = "32FC1"
    #: Publishes /tf and /tf_static; off where robot_state_publisher does.
    publish_tf: bool = True
    #: Chair below ``odom``, and ``odom`` below ``house`` (REP 105); off: the chair
    #: stands below ``house``.
    odom_frame: bool = True
    #: URI that is put before the paths of meshes in /robot_description.
    mesh_folder: str = ""


class _Camera:
    """One camera: received while somebody subscribes, in a thread of its own."""

    def __init__(self, node: WheelArmNode, name: str):
        self.node, self.name = node, name
        self._pictures: Camera | None = None
        color, depth = color_topic(name), depth_topic(name)
        topics = [(color, Image), (depth, Image)]
        topics += [(info_topic(color), CameraInfo), (info_topic(depth), CameraInfo)]
        for topic, kind in topics:
            node.outputs.declare(topic, kind, PICTURES)
        self.topics = [topic for topic, _ in topics]
        if node.options.seed_topics:
            self.topics += picture_topics(name)

    @property
    def is_open(self) -> bool:
        """Whether pictures are received."""
        return self._pictures is not None

    def look(self) -> None:
        """Receives pictures if somebody wants them now."""
        wanted = any(map(self.node.outputs.is_wanted, self.topics))
        if wanted and self._pictures is None:
            self._pictures = self.node.client.camera(self.name, kept=2)
            words = {"name": f"camera {self.name}", "args": (self._pictures,)}
            threading.Thread(target=self._run, daemon=True, **words).start()
        elif not wanted:
            self.close()

    def _run(self, pictures: Camera) -> None:
        for frame in pictures:
            try:
                self.node.publish_picture(self.name, frame)
            except Exception as problem:
                if self._pictures is not pictures:
                    return
                self.node.tell(f"a picture of {self.name} was not published: {problem!r}")

    def close(self) -> None:
        """Ends the subscription."""
        pictures, self._pictures = self._pictures, None
        if pictures is not None:
            pictures.close()


class WheelArmNode(Node):
    """Speaks for one server. Its topics are relative names, so that a namespace and
    remappings work."""

    def __init__(self, options: Options = Options()):
        """Parameters take the place of ``options``.

        Raises ``wheelarm.WheelArmError`` when no server answers, ``ValueError`` when a
        parameter is wrong.
        """
        super().__init__("wheelarm")
        self.options = self._declare(options)
        self.client = Client(self.options.endpoint, self.options.sim)
        self.outputs = Outputs(self)
        self.cameras: dict[str, _Camera] = {}
        self.seed: SeedTopics | None = None
        self.robot: Robot | None = None
        self.entities: Entities | None = None
        self._run_id, self._tick = "", 0
        self._heard = time.monotonic()
        self._last: dict[str, object] = {}
        self._told: deque[str] = deque(maxlen=5)
        self._ended = False
        status, scene = self.client.status(), self.client.scene()
        robot = Robot.of(scene.robot)
        self.pilot = Pilot(
            self.client,
            Wishes(robot, self.options.cmd_vel_timeout),
            self.options.commander,
            take=self.options.take,
            lease_timeout=self.options.lease_timeout,
            rate=self.options.play_rate,
            tell=self.tell,
        )
        self.simulation = Simulation(self.client, self.pilot, self._episode_options)
        self._declare_outputs()
        self._adopt(status, scene, robot)
        self._inputs()
        trigger_services(self, self.simulation, self.pilot)
        if HAS_STANDARD:
            StandardServices(self, self.simulation, lambda: self.entities)
        else:
            self.get_logger().info(
                "simulation_interfaces is not installed: its services are not offered"
            )
        # Wall time: with `use_sim_time` the node's own clock stands while time is paused.
        steady, group = RosClock(clock_type=ClockType.STEADY_TIME), MutuallyExclusiveCallbackGroup()
        self.create_timer(0.2, self._look, callback_group=group, clock=steady)
        self.create_timer(1.0, self._diagnose, callback_group=group, clock=steady)
        self._streams = self.client.streams(*STREAMS, *OTHERS)
        self._thread = threading.Thread(target=self._run, name="streams", daemon=True)
        self._thread.start()

    # Start.

    def _declare(self, options: Options) -> Options:
        values = {}
        for one in dataclasses.fields(Options):
            default = getattr(options, one.name)
            values[one.name] = self.declare_parameter(one.name, default).value
        for name, default in (
            ("label", ""),
            ("instruction", ""),
            ("require_recorders", 0),
        ):
            self.declare_parameter(name, default)
        chosen = Options(**values)
        if chosen.depth_encoding not in mapping.DEPTH_ENCODINGS:
            known = ", ".join(mapping.DEPTH_ENCODINGS)
            raise ValueError(f"depth_encoding is {chosen.depth_encoding!r}; it can be {known}")
        for name in ("cmd_vel_timeout", "lease_timeout", "play_rate"):
            number = getattr(chosen, name)
            if not mapping.is_finite(number) or number < 0:
                raise ValueError(f"{name} is {number}; it must be 0 or more")
        return chosen

    def _episode_options(self) -> EpisodeOptions:
        value = lambda name: self.get_parameter(name).value  # noqa: E731
        return EpisodeOptions(value("label"), value("instruction"), value("require_recorders"))

    def _declare_outputs(self) -> None:
        for topic, kind in (
            ("/clock", Clock),
            ("joint_states", JointState),
            ("imu/data", Imu),
            ("odom", Odometry),
            ("/diagnostics", DiagnosticArray),
        ):
            self.outputs.declare(topic, kind)
        self.outputs.declare("robot_description", String, LATCHED)
        if self.options.publish_tf:
            self.outputs.declare("/tf", TFMessage, TRANSFORMS)
            self.outputs.declare("/tf_static", TFMessage, LATCHED)
        if self.options.seed_topics:
            # WheelArm-Sim's own name of it.
            self.outputs.declare("imu", Imu)
        self._imu_topics = ["imu/data", "imu", *IMU_TOPICS]

    def _inputs(self) -> None:
        group = MutuallyExclusiveCallbackGroup()

        def hear(topic: str, kind: type, put) -> None:
            def taken(message) -> None:
                problem = self.pilot.wish(
                    lambda wishes, wall, nanos: put(wishes, message, wall, nanos)
                )
                if problem:
                    self.tell(problem)

            self.create_subscription(kind, topic, taken, 10, callback_group=group)

        if self.options.cmd_vel_stamped:
            hear("cmd_vel", TwistStamped, lambda w, m, wall, nanos: w.twist(m.twist, wall, nanos))
        else:
            hear("cmd_vel", Twist, lambda w, m, wall, nanos: w.twist(m, wall, nanos))
        hear("joint_command", JointState, lambda w, m, wall, nanos: w.joint_command(m))
        hear(
            "joint_trajectory",
            JointTrajectory,
            lambda w, m, wall, nanos: w.trajectory(m, nanos, mapping.nanos),
        )
        hear("desired_pose", PoseStamped, lambda w, m, wall, nanos: w.desired_pose(m))
        hear("gripper", Float64, lambda w, m, wall, nanos: w.opening(m.data))

    def _adopt(self, status, scene, robot: Robot | None = None) -> None:
        """Takes over what is simulated now."""
        robot = robot or Robot.of(scene.robot)
        self.robot, self.entities = robot, Entities.of(scene, robot)
        with self.pilot.changed:
            self.pilot.wishes.robot = robot
        lock_step = status.scenario.pacing == v1.PACING_LOCK_STEP
        self.pilot.lock_step = self.pilot.wishes.in_simulation_time = lock_step
        self._run_id, self._tick = status.header.run_id, status.header.tick
        names = [camera.name for camera in status.scenario.cameras if camera.rate_hz > 0.0]
        for name in names:
            if name not in self.cameras:
                self.cameras[name] = _Camera(self, name)
        if self.options.seed_topics:
            self.seed = SeedTopics(self.outputs, robot, names)
        self.outputs.keep(
            "robot_description",
            String(data=tree.with_mesh_folder(robot.urdf, self.options.mesh_folder)),
        )
        if self.options.publish_tf:
            self.outputs.keep("/tf_static", self._static(status, scene, robot))

    def _static(self, status, scene, robot: Robot) -> TFMessage:
        stamp = status.header.stamp_nanos
        transforms = [
            mapping.transform_stamped(joint.origin, stamp, joint.parent, joint.child)
            for joint in robot.tree
            if joint.kind == "fixed"
        ]
        # Where the cameras are: as this specimen was drawn, or as described.
        places = {
            camera.name: (camera.link, camera.pose)
            for camera in [*scene.robot.cameras, *scene.cameras]
        }
        links = {name: link for name, _, link in robot.frames}
        for camera in status.scenario.cameras:
            if camera.HasField("place"):
                frame = camera.place.frame
                places[camera.name] = (links.get(frame, frame), camera.place.pose)
        transforms += [
            mapping.transform_stamped(tree.of_pose(pose), stamp, link, optical_frame(name))
            for name, (link, pose) in places.items()
        ]
        return TFMessage(transforms=transforms)

    # What comes from the server.

    def _run(self) -> None:
        while not self._ended:
            try:
                sample = self._streams.next(0.5)
                if sample is not None:
                    self._heard = time.monotonic()
                    self._take(sample)
            except Gone:
                return
            except WheelArmError as problem:
                self.tell(str(problem))
            except Exception as problem:
                if self._ended:
                    return
                self.tell(f"a sample was not published: {problem!r}")

    def _take(self, told: Sample) -> None:
        topic = told.topic
        if topic == "imu" and not any(map(self.outputs.is_wanted, self._imu_topics)):
            return
        sample = told.message
        if topic == "refusal":
            self.pilot.refusal(sample)
            return
        header = sample.header
        if header.run_id != self._run_id or (topic == "clock" and header.tick < self._tick):
            # A reset or another server: what stands there may be another.
            self._adopt(self.client.status(), self.client.scene())
            self._last.clear()
        if topic == "clock":
            self._tick = header.tick
        stamp, robot = header.stamp_nanos, self.robot
        put = self.outputs.put
        self._last[topic] = sample
        if topic == "joint_state":
            put("joint_states", lambda: mapping.joint_state(sample, robot.joints))
        elif topic == "pose":
            self.entities.poses(sample)
        elif topic == "object_pose":
            self.entities.object_poses(sample)
        elif topic == "furniture_joint":
            self.entities.furniture_joints(sample)
        elif topic == "imu":
            put("imu/data", lambda: mapping.imu(sample, robot.imu))
            put("imu", lambda: mapping.imu(sample, robot.imu))
        elif topic == "odometry":
            put("odom", lambda: mapping.odometry(sample, ODOM, robot.root))
        elif topic == "applied":
            self.pilot.applied(sample)
        elif topic == "episode_stop":
            self.pilot.episode_ended()
        elif topic == "clock":
            self._transforms()
            put("/clock", lambda: mapping.clock(stamp))
        if self.seed is not None:
            feed = {
                "joint_state": self.seed.joints,
                "pose": self.seed.poses,
                "imu": self.seed.imu,
                "applied": self.seed.applied,
            }.get(topic)
            if feed is not None:
                feed(sample)
            elif topic == "clock":
                self.seed.clock(header)
        if topic == "clock":
            # Last: what answers this tick has seen all of it.
            self.pilot.clock(header)

    def _transforms(self) -> None:
        parts = [self._last.pop(topic, None) for topic in ("joint_state", "pose", "odometry")]
        if None in parts or len({part.header.tick for part in parts}) != 1:
            return
        self.outputs.put("/tf", lambda: self._moving(*parts))

    def _moving(self, joints, poses, odometry) -> TFMessage:
        stamp, robot = joints.header.stamp_nanos, self.robot
        told = {
            (parent, link): tree.of_pose(frame.pose)
            for (_, parent, link), frame in zip(robot.frames, poses.frames, strict=False)
        }
        chair = told[WORLD, robot.root]
        in_base = {
            link: place for (parent, link), place in told.items() if parent == robot.arm_base
        }
        if self.options.odom_frame:
            odom_from_chair = tree.of_pose(odometry.pose)
            house_from_odom = tree.chained(chair, tree.inverse(odom_from_chair))
            transforms = [
                mapping.transform_stamped(house_from_odom, stamp, WORLD, ODOM),
                mapping.transform_stamped(odom_from_chair, stamp, ODOM, robot.root),
            ]
        else:
            transforms = [mapping.transform_stamped(chair, stamp, WORLD, robot.root)]
        positions = dict(zip(robot.joints, joints.positions, strict=False))
        transforms += [
            mapping.transform_stamped(place, stamp, joint.parent, joint.child)
            for joint, place in tree.moving(robot.tree, positions, robot.arm_base, in_base)
        ]
        return TFMessage(transforms=transforms)

    def publish_picture(self, camera: str, frame) -> None:
        """Publishes one picture of a camera: colour, depth, and how it was taken."""
        stamp, optical = frame.header.stamp_nanos, optical_frame(camera)
        put = self.outputs.put
        color, depth = color_topic(camera), depth_topic(camera)
        for topic in (color, depth):
            put(info_topic(topic), lambda: mapping.camera_info(frame.intrinsics, stamp, optical))
        put(color, lambda: mapping.color_image(frame.rgb, stamp, optical))
        encoding = self.options.depth_encoding
        put(depth, lambda: mapping.depth_image(frame.depth, encoding, stamp, optical))
        if self.seed is not None:
            color, depth = picture_topics(camera)
            put(color, lambda: mapping.color_image(frame.rgb, stamp, optical))
            put(depth, lambda: mapping.depth_image(frame.depth, "32FC1", stamp, optical))

    # What the node says of itself.

    def tell(self, words: str) -> None:
        """Says a problem: to the log, and on /diagnostics at once."""
        self.get_logger().error(words, throttle_duration_sec=0.5)
        self._told.append(words)
        self._diagnose(words)

    def _look(self) -> None:
        try:
            self._look_around()
        except (WheelArmError, ValueError) as problem:
            self.tell(str(problem))

    def _look_around(self) -> None:
        if time.monotonic() - self._heard > SILENCE:
            # Paused, or gone: whoever comes back is found by asking.
            self._heard = time.monotonic()
            self.client.ask(v1.StatusRequest(), timeout=2.0)
        for camera in list(self.cameras.values()):
            camera.look()
        if self.seed is not None:
            self.outputs.yield_to_others(self.seed.topics)

    def _diagnose(self, problem: str = "") -> None:
        if not self.outputs.is_wanted("/diagnostics"):
            return
        values = {"commander": self.pilot.name, "refused": str(self.pilot.refused)}
        try:
            status = self.client.ask(v1.StatusRequest(), timeout=2.0)
            waits = status.waiting_for
            level, words = DiagnosticStatus.OK, "in use" if not status.paused else "paused"
            if status.broken:
                level, words = DiagnosticStatus.ERROR, status.broken
            values |= {
                "holder": status.holder,
                "episode": str(status.episode.header.episode) if status.HasField("episode") else "",
                "waiting_for": waits,
                "real_time_factor": f"{status.real_time_factor:.3f}",
                "simulation_time": f"{status.header.stamp_nanos * 1e-9:.3f}",
                "adapter": status.adapter,
            }
        except WheelArmError as silent:
            level, words = DiagnosticStatus.STALE, str(silent)
        if problem or (self.pilot.problem and level == DiagnosticStatus.OK):
            level, words = DiagnosticStatus.WARN, problem or self.pilot.problem
        values["told"] = " | ".join(self._told)
        one = DiagnosticStatus(
            level=level,
            name=f"{self.get_name()}: {self.options.sim}",
            message=words,
            hardware_id=self.options.endpoint,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        stamp = mapping.header(self._tick * 1_000_000_000 // 240, "")
        self.outputs.put("/diagnostics", lambda: DiagnosticArray(header=stamp, status=[one]))

    def close(self) -> None:
        """Gives control back and ends every thread."""
        self._ended = True
        self._streams.close()
        self._thread.join(timeout=5)
        for camera in self.cameras.values():
            camera.close()
        self.pilot.close()
        self.client.close()
        self.destroy_node()


__all__ = ["Options", "WheelArmNode", "color_topic", "depth_topic", "info_topic"]
