"""The node: its inputs, outputs, parameters and threads."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections import deque

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, Imu, JointState, LaserScan
from std_msgs.msg import Float64, String
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory

from .. import v1
from ..client import Client
from ..errors import GoneError, WheelArmError
from ..streams import Camera, Sample
from . import mapping, tree
from .command import CMD_VEL_TIMEOUT, PendingCommands
from .controller import Controller
from .entities import Entities
from .furniture import Furniture
from .outputs import IMAGES, LATCHED, TRANSFORMS, Outputs
from .robot import ODOM, WORLD, Robot, optical_frame
from .seed import IMU_TOPICS, SeedTopics, image_topics
from .services import HAS_STANDARD, StandardServices, trigger_services
from .simulation import EpisodeOptions, Simulation

STREAMS = [
    "joint_state",
    "pose",
    "imu",
    "scan",
    "sensed_scan",
    "odometry",
    "applied",
    "object_pose",
    "furniture_joint",
]
#: Topic of each stream of laser scans.
SCANS = {"scan": "scan", "sensed_scan": "sensed/scan"}
#: Field of ``wheelarm.v1.MapReply`` of each map topic.
MAPS = {"map": "occupied", "map/free": "free"}
#: Streams without a ROS topic. `tests/test_contract.py` requires each stream in one of the lists.
UNPUBLISHED = [
    "sensed_joint",
    "sensed_odometry",
    "sensed_imu",
    "disturbance",
    "person",
    "evaluation",
    "command",
    "deformable",
    "contact",
    "phase",
    "state_hash",
    "event",
]
#: Other topics of the server, in the same queue.
OTHERS = ["clock", "refusal", "episode_stop"]
#: Seconds of silence after which the server's status is requested.
SILENCE = 1.0


def color_topic(camera: str) -> str:
    """Topic of a camera's color images."""
    return f"camera/{camera}/color/image_raw"


def depth_topic(camera: str) -> str:
    """Topic of a camera's depth images."""
    return f"camera/{camera}/depth/image_raw"


def info_topic(image_topic: str) -> str:
    """Topic of the ``camera_info`` of an image topic."""
    return image_topic.rsplit("/", 1)[0] + "/camera_info"


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the node; each is also a parameter."""

    #: Endpoint of the server, in Zenoh's notation.
    endpoint: str = "tcp/127.0.0.1:7447"
    #: Name of the server.
    sim: str = "sim"
    #: Name of this commander.
    commander: str = "ros"
    #: Takes control over from the client that holds it.
    take: bool = False
    #: Publishes the 39 topics of WheelArm-Sim's recorder too.
    seed_topics: bool = False
    #: ``cmd_vel`` is a TwistStamped.
    cmd_vel_stamped: bool = False
    #: Seconds without ``cmd_vel`` after which the chair stops.
    cmd_vel_timeout: float = CMD_VEL_TIMEOUT
    #: Seconds without a command after which control is released; 0 keeps it.
    lease_timeout: float = 5.0
    #: Simulated seconds per second while lock-step time is played; 0 for unlimited.
    play_rate: float = 1.0
    #: Encoding of depth, 32FC1 (metres) or 16UC1 (millimetres).
    depth_encoding: str = "32FC1"
    #: Publishes /tf and /tf_static; disable it with robot_state_publisher.
    publish_tf: bool = True
    #: Chair below ``odom``, and ``odom`` below ``house`` (REP 105); off: the chair below
    #: ``house``.
    odom_frame: bool = True
    #: URI prefix of the mesh paths in /robot_description.
    mesh_folder: str = ""


class _Camera:
    """One camera: its thread receives images while a topic has a subscriber."""

    def __init__(self, node: WheelArmNode, name: str):
        self.node, self.name = node, name
        self._images: Camera | None = None
        color, depth = color_topic(name), depth_topic(name)
        topics = [(color, Image), (depth, Image)]
        topics += [(info_topic(color), CameraInfo), (info_topic(depth), CameraInfo)]
        for topic, kind in topics:
            node.outputs.declare(topic, kind, IMAGES)
        self.topics = [topic for topic, _ in topics]
        if node.options.seed_topics:
            self.topics += image_topics(name)

    @property
    def is_open(self) -> bool:
        """Whether images are received."""
        return self._images is not None

    def update(self) -> None:
        """Starts or ends the subscription, depending on the subscribers of the topics."""
        needed = any(map(self.node.outputs.has_subscriber, self.topics))
        if needed and self._images is None:
            self._images = self.node.client.camera(self.name, queue_size=2)
            options = {"name": f"camera {self.name}", "args": (self._images,)}
            threading.Thread(target=self._run, daemon=True, **options).start()
        elif not needed:
            self.close()

    def _run(self, images: Camera) -> None:
        for frame in images:
            try:
                self.node.publish_image(self.name, frame)
            except Exception as error:
                if self._images is not images:
                    return
                self.node.report(f"cannot publish an image of {self.name}: {error!r}")

    def close(self) -> None:
        """Ends the subscription."""
        images, self._images = self._images, None
        if images is not None:
            images.close()


class WheelArmNode(Node):
    """The node of one server. Its topics are relative names, so that a namespace and
    remappings work."""

    def __init__(self, options: Options = Options()):
        """Parameters override ``options``.

        Raises ``wheelarm.WheelArmError`` when no server answers, ``ValueError`` when a
        parameter is invalid.
        """
        super().__init__("wheelarm")
        self.options = self._declare(options)
        self.client = Client(self.options.endpoint, self.options.sim)
        self.outputs = Outputs(self)
        self.cameras: dict[str, _Camera] = {}
        self.seed: SeedTopics | None = None
        self.robot: Robot | None = None
        self.entities: Entities | None = None
        self.furniture = Furniture()
        self._run_id, self._tick = "", 0
        self._last_arrival = time.monotonic()
        self._newest: dict[str, object] = {}
        self._problems: deque[str] = deque(maxlen=5)
        self._ended = False
        status, scene = self.client.status(), self.client.scene()
        robot = Robot.from_description(scene.robot)
        self.controller = Controller(
            self.client,
            PendingCommands(robot, self.options.cmd_vel_timeout),
            self.options.commander,
            take=self.options.take,
            lease_timeout=self.options.lease_timeout,
            rate=self.options.play_rate,
            report=self.report,
        )
        self.simulation = Simulation(self.client, self.controller, self._episode_options)
        self._declare_outputs()
        self._use_scene(status, scene, robot)
        self._declare_inputs()
        trigger_services(self, self.simulation, self.controller)
        if HAS_STANDARD:
            StandardServices(self, self.simulation, lambda: self.entities)
        else:
            self.get_logger().info(
                "simulation_interfaces is not installed: the node runs without its services"
            )
        # Wall time: with `use_sim_time` the node's own clock stops while time is paused.
        steady, group = RosClock(clock_type=ClockType.STEADY_TIME), MutuallyExclusiveCallbackGroup()
        self.create_timer(0.2, self._check, callback_group=group, clock=steady)
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
            raise ValueError(
                f"invalid depth_encoding={chosen.depth_encoding!r}: choose one of {known}"
            )
        for name in ("cmd_vel_timeout", "lease_timeout", "play_rate"):
            number = getattr(chosen, name)
            if not mapping.is_finite(number) or number < 0:
                raise ValueError(f"invalid {name}={number}: it must be 0 or more")
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
            *((topic, LaserScan) for topic in SCANS.values()),
            ("/diagnostics", DiagnosticArray),
        ):
            self.outputs.declare(topic, kind)
        self.outputs.declare("robot_description", String, LATCHED)
        self.outputs.declare("furniture_description", String, LATCHED)
        for layer in MAPS:
            self.outputs.declare(layer, OccupancyGrid, LATCHED)
        self.outputs.declare("furniture/joint_states", JointState)
        if self.options.publish_tf:
            self.outputs.declare("/tf", TFMessage, TRANSFORMS)
            self.outputs.declare("/tf_static", TFMessage, LATCHED)
        if self.options.seed_topics:
            # WheelArm-Sim's name of this topic.
            self.outputs.declare("imu", Imu)
        self._imu_topics = ["imu/data", "imu", *IMU_TOPICS]

    def _declare_inputs(self) -> None:
        group = MutuallyExclusiveCallbackGroup()

        def subscribe(topic: str, kind: type, store) -> None:
            def receive(message) -> None:
                problem = self.controller.update(
                    lambda commands, wall, nanos: store(commands, message, wall, nanos)
                )
                if problem:
                    self.report(problem)

            self.create_subscription(kind, topic, receive, 10, callback_group=group)

        if self.options.cmd_vel_stamped:
            subscribe("cmd_vel", TwistStamped, lambda c, m, wall, ns: c.twist(m.twist, wall, ns))
        else:
            subscribe("cmd_vel", Twist, lambda c, m, wall, ns: c.twist(m, wall, ns))
        subscribe("joint_command", JointState, lambda c, m, wall, ns: c.joint_command(m))
        subscribe(
            "joint_trajectory",
            JointTrajectory,
            lambda c, m, wall, ns: c.trajectory(m, ns, mapping.nanos),
        )
        subscribe("desired_pose", PoseStamped, lambda c, m, wall, ns: c.desired_pose(m))
        subscribe("gripper", Float64, lambda c, m, wall, ns: c.opening(m.data))

    def _use_scene(self, status, scene, robot: Robot | None = None) -> None:
        """Adopts robot, entities, pacing and cameras of the present scenario."""
        robot = robot or Robot.from_description(scene.robot)
        self.robot, self.entities = robot, Entities.from_scene(scene, robot)
        self.furniture = Furniture.from_scene(scene)
        with self.controller.changed:
            self.controller.commands.robot = robot
        lock_step = status.scenario.pacing == v1.PACING_LOCK_STEP
        self.controller.lock_step = self.controller.commands.in_simulation_time = lock_step
        self._run_id, self._tick = status.header.run_id, status.header.tick
        self._scan_rate = status.scenario.scan_rate_hz
        names = [camera.name for camera in status.scenario.cameras if camera.rate_hz > 0.0]
        for name in names:
            if name not in self.cameras:
                self.cameras[name] = _Camera(self, name)
        if self.options.seed_topics:
            self.seed = SeedTopics(self.outputs, robot, names)
        self.outputs.publish_latched(
            "robot_description",
            String(data=tree.with_mesh_folder(robot.urdf, self.options.mesh_folder)),
        )
        self.outputs.publish_latched(
            "furniture_description", String(data=self.furniture.urdf)
        )
        home = self.client.map(without_objects=True)
        for topic, layer in MAPS.items():
            self.outputs.publish_latched(topic, mapping.occupancy_grid(home, layer))
        if self.options.publish_tf:
            self.outputs.publish_latched("/tf_static", self._static(status, scene, robot))

    def _static(self, status, scene, robot: Robot) -> TFMessage:
        stamp = status.header.stamp_nanos
        transforms = [
            mapping.transform_stamped(joint.origin, stamp, joint.parent, joint.child)
            for joint in [*robot.tree, *self.furniture.tree]
            if joint.kind == "fixed"
        ]
        # Mounts of the cameras: the sampled ones of the scenario override the description.
        places = {
            camera.name: (camera.link, camera.pose)
            for camera in [*scene.robot.cameras, *scene.cameras]
        }
        links = {name: link for name, _, link in robot.frames}
        for camera in status.scenario.cameras:
            if camera.HasField("place"):
                frame = camera.place.frame
                places[camera.name] = (links.get(frame, frame), camera.place.pose)
        if robot.scanner is not None:
            scanner = robot.scanner
            place = tree.from_pose(scanner.pose)
            transforms.append(
                mapping.transform_stamped(place, stamp, scanner.link, scanner.frame)
            )
        transforms += [
            mapping.transform_stamped(tree.from_pose(pose), stamp, link, optical_frame(name))
            for name, (link, pose) in places.items()
        ]
        return TFMessage(transforms=transforms)

    # Input from the server.

    def _run(self) -> None:
        while not self._ended:
            try:
                sample = self._streams.next(0.5)
                if sample is not None:
                    self._last_arrival = time.monotonic()
                    self._process(sample)
            except GoneError:
                return
            except WheelArmError as error:
                self.report(str(error))
            except Exception as error:
                if self._ended:
                    return
                self.report(f"cannot publish a sample: {error!r}")

    def _process(self, received: Sample) -> None:
        topic = received.topic
        if topic == "imu" and not any(map(self.outputs.has_subscriber, self._imu_topics)):
            return
        sample = received.message
        if topic == "refusal":
            self.controller.refusal(sample)
            return
        header = sample.header
        if header.run_id != self._run_id or (topic == "clock" and header.tick < self._tick):
            # A reset or a new server: the scene may have changed.
            self._use_scene(self.client.status(), self.client.scene())
            self._newest.clear()
        if topic == "clock":
            self._tick = header.tick
        stamp, robot = header.stamp_nanos, self.robot
        publish = self.outputs.publish
        self._newest[topic] = sample
        if topic == "joint_state":
            publish("joint_states", lambda: mapping.joint_state(sample, robot.joints))
        elif topic == "pose":
            self.entities.poses(sample)
        elif topic == "object_pose":
            self.entities.object_poses(sample)
        elif topic == "furniture_joint":
            self.entities.furniture_joints(sample)
            names = self.furniture.joints
            publish("furniture/joint_states", lambda: mapping.furniture_joints(sample, names))
        elif topic == "imu":
            publish("imu/data", lambda: mapping.imu(sample, robot.imu))
            publish("imu", lambda: mapping.imu(sample, robot.imu))
        elif topic in SCANS and robot.scanner is not None:
            rate = self._scan_rate
            publish(
                SCANS[topic], lambda: mapping.laser_scan(sample, robot.scanner, rate)
            )
        elif topic == "odometry":
            publish("odom", lambda: mapping.odometry(sample, ODOM, robot.root))
        elif topic == "applied":
            self.controller.applied(sample)
        elif topic == "episode_stop":
            self.controller.episode_ended()
        elif topic == "clock":
            self._publish_transforms()
            publish("/clock", lambda: mapping.clock(stamp))
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
            # Last, so that the answer to this tick uses all its samples.
            self.controller.clock(header)

    def _publish_transforms(self) -> None:
        parts = [self._newest.pop(topic, None) for topic in ("joint_state", "pose", "odometry")]
        if None in parts or len({part.header.tick for part in parts}) != 1:
            return
        furniture = self._newest.get("furniture_joint")
        if furniture is not None and furniture.header.tick != parts[0].header.tick:
            furniture = None
        self.outputs.publish("/tf", lambda: self._tf_message(*parts, furniture))

    def _tf_message(self, joints, poses, odometry, furniture=None) -> TFMessage:
        stamp, robot = joints.header.stamp_nanos, self.robot
        poses_by_link = {
            (parent, link): tree.from_pose(frame.pose)
            for (_, parent, link), frame in zip(robot.frames, poses.frames, strict=False)
        }
        chair = poses_by_link[WORLD, robot.root]
        in_base = {
            link: place
            for (parent, link), place in poses_by_link.items()
            if parent == robot.arm_base
        }
        if self.options.odom_frame:
            odom_from_chair = tree.from_pose(odometry.pose)
            house_from_odom = tree.compose(chair, tree.invert(odom_from_chair))
            transforms = [
                mapping.transform_stamped(house_from_odom, stamp, WORLD, ODOM),
                mapping.transform_stamped(odom_from_chair, stamp, ODOM, robot.root),
            ]
        else:
            transforms = [mapping.transform_stamped(chair, stamp, WORLD, robot.root)]
        positions = dict(zip(robot.joints, joints.positions, strict=False))
        transforms += [
            mapping.transform_stamped(place, stamp, joint.parent, joint.child)
            for joint, place in tree.moving_transforms(
                robot.tree, positions, robot.arm_base, in_base
            )
        ]
        if furniture is not None:
            positions = dict(zip(self.furniture.joints, furniture.positions, strict=False))
            transforms += [
                mapping.transform_stamped(place, stamp, joint.parent, joint.child)
                for joint, place in tree.moving_transforms(self.furniture.tree, positions)
            ]
        return TFMessage(transforms=transforms)

    def publish_image(self, camera: str, frame) -> None:
        """Publishes one image of a camera: color, depth and ``camera_info``."""
        stamp, optical = frame.header.stamp_nanos, optical_frame(camera)
        publish = self.outputs.publish
        color, depth = color_topic(camera), depth_topic(camera)
        for topic in (color, depth):
            publish(
                info_topic(topic), lambda: mapping.camera_info(frame.intrinsics, stamp, optical)
            )
        publish(color, lambda: mapping.color_image(frame.color, stamp, optical))
        encoding = self.options.depth_encoding
        publish(depth, lambda: mapping.depth_image(frame.depth, encoding, stamp, optical))
        if self.seed is not None:
            color, depth = image_topics(camera)
            publish(color, lambda: mapping.color_image(frame.color, stamp, optical))
            publish(depth, lambda: mapping.depth_image(frame.depth, "32FC1", stamp, optical))

    # State of the node.

    def report(self, text: str) -> None:
        """Writes a problem to the log and publishes it on /diagnostics."""
        self.get_logger().error(text, throttle_duration_sec=0.5)
        self._problems.append(text)
        self._diagnose(text)

    def _check(self) -> None:
        try:
            self._check_server_and_cameras()
        except (WheelArmError, ValueError) as error:
            self.report(str(error))

    def _check_server_and_cameras(self) -> None:
        if time.monotonic() - self._last_arrival > SILENCE:
            # Paused or ended; the request also finds a server that has restarted.
            self._last_arrival = time.monotonic()
            self.client.request(v1.StatusRequest(), timeout=2.0)
        for camera in list(self.cameras.values()):
            camera.update()
        if self.seed is not None:
            self.outputs.silence_duplicates(self.seed.topics)

    def _diagnose(self, problem: str = "") -> None:
        if not self.outputs.has_subscriber("/diagnostics"):
            return
        values = {"commander": self.controller.name, "refused": str(self.controller.refused)}
        try:
            status = self.client.request(v1.StatusRequest(), timeout=2.0)
            waits = status.waiting_for
            level, text = DiagnosticStatus.OK, "in use" if not status.paused else "paused"
            if status.broken:
                level, text = DiagnosticStatus.ERROR, status.broken
            values |= {
                "holder": status.holder,
                "episode": str(status.episode.header.episode) if status.HasField("episode") else "",
                "waiting_for": waits,
                "real_time_factor": f"{status.real_time_factor:.3f}",
                "simulation_time": f"{status.header.stamp_nanos * 1e-9:.3f}",
                "adapter": status.adapter,
            }
        except WheelArmError as silent:
            level, text = DiagnosticStatus.STALE, str(silent)
        if problem or (self.controller.problem and level == DiagnosticStatus.OK):
            level, text = DiagnosticStatus.WARN, problem or self.controller.problem
        values["recent_problems"] = " | ".join(self._problems)
        one = DiagnosticStatus(
            level=level,
            name=f"{self.get_name()}: {self.options.sim}",
            message=text,
            hardware_id=self.options.endpoint,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        stamp = mapping.header(self._tick * 1_000_000_000 // 240, "")
        self.outputs.publish("/diagnostics", lambda: DiagnosticArray(header=stamp, status=[one]))

    def close(self) -> None:
        """Releases control and ends every thread."""
        self._ended = True
        self._streams.close()
        self._thread.join(timeout=5)
        for camera in self.cameras.values():
            camera.close()
        self.controller.close()
        self.client.close()
        self.destroy_node()


__all__ = ["Options", "WheelArmNode", "color_topic", "depth_topic", "info_topic"]
