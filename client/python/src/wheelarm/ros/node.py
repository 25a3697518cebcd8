"""The node: topics in and out, and what holds them together."""

from __future__ import annotations

import dataclasses
import queue
import threading
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

from . import mapping, tree
from .command import CMD_VEL_TIMEOUT, Wishes
from .entities import Entities
from .link import Link, Refused, Silent
from .outputs import LATCHED, PICTURES, TRANSFORMS, Outputs
from .pilot import Pilot
from .robot import ODOM, WORLD, Robot, optical_frame
from .seed import SeedTopics, picture_topics
from .services import HAS_STANDARD, StandardServices, trigger_services
from .simulation import EpisodeOptions, Simulation

STREAMS = ["joint_state", "pose", "imu", "odometry", "applied", "object_pose", "furniture_joint"]
#: Told by the server's own topics, in the order of arrival behind the streams.
OTHERS = ["clock", "refusal", "episode/stop"]


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
        self._newest: deque = deque(maxlen=2)
        self._there = threading.Semaphore(0)
        self._subscription = None
        self._ended = False
        color, depth = color_topic(name), depth_topic(name)
        self.topics = [(color, Image), (depth, Image)]
        self.topics += [(info_topic(color), CameraInfo), (info_topic(depth), CameraInfo)]
        for topic, kind in self.topics:
            node.outputs.declare(topic, kind, PICTURES)
        self._thread = threading.Thread(target=self._run, name=f"camera {name}", daemon=True)
        self._thread.start()

    @property
    def is_open(self) -> bool:
        """Whether pictures are received."""
        return self._subscription is not None

    def look(self) -> None:
        """Receives pictures if somebody wants them now."""
        topics = [topic for topic, _ in self.topics]
        if self.node.seed is not None:
            topics += picture_topics(self.name)
        wanted = any(map(self.node.outputs.is_wanted, topics))
        if wanted and self._subscription is None:
            self._subscription = self.node.link.camera(self.name, self._taken)
        elif not wanted and self._subscription is not None:
            self._subscription.close()
            self._subscription = None

    def _taken(self, frame) -> None:
        self._newest.append(frame)
        self._there.release()

    def _run(self) -> None:
        while True:
            self._there.acquire()
            if self._ended:
                return
            try:
                frame = self._newest.popleft()
            except IndexError:
                continue
            try:
                self.node.publish_picture(self.name, frame)
            except Exception as problem:
                if self._ended:
                    return
                self.node.tell(f"a picture of {self.name} was not published: {problem}")

    def close(self) -> None:
        self._ended = True
        if self._subscription is not None:
            self._subscription.close()
        self._there.release()
        self._thread.join(timeout=5)


class WheelArmNode(Node):
    """Speaks for one server. Its topics are relative names, so that a namespace and
    remappings work."""

    def __init__(self, options: Options = Options()):
        """Parameters take the place of ``options``.

        Raises ``Silent`` or ``Refused`` when no server answers.
        """
        super().__init__("wheelarm")
        self.options = self._declare(options)
        self.link = Link(self.options.endpoint, self.options.sim)
        self.outputs = Outputs(self)
        self.cameras: dict[str, _Camera] = {}
        self.seed: SeedTopics | None = None
        self.robot: Robot | None = None
        self.entities: Entities | None = None
        self._run_id, self._tick = "", 0
        self._samples: queue.SimpleQueue = queue.SimpleQueue()
        self._last: dict[str, object] = {}
        self._told: deque[str] = deque(maxlen=5)
        self._ended = False
        status, scene = self.link.ask("status"), self.link.ask("scene")
        robot = Robot.of(scene.robot)
        self.pilot = Pilot(
            self.link,
            Wishes(robot, self.options.cmd_vel_timeout),
            self.options.commander,
            take=self.options.take,
            lease_timeout=self.options.lease_timeout,
            rate=self.options.play_rate,
            tell=self.tell,
        )
        self.simulation = Simulation(self.link, self.pilot, self._episode_options)
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
        self._subscription = self.link.listen(
            STREAMS + OTHERS, lambda topic, sample: self._samples.put((topic, sample))
        )
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
                f"depth_encoding is {chosen.depth_encoding!r}; it can be {known}"
            )
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
        kind = status.scenario.DESCRIPTOR.fields_by_name["pacing"].enum_type.values_by_number
        lock_step = kind[status.scenario.pacing].name == "PACING_LOCK_STEP"
        self.pilot.lock_step = self.pilot.wishes.in_simulation_time = lock_step
        self._run_id, self._tick = status.header.run_id, status.header.tick
        names = [camera.name for camera in status.scenario.cameras if camera.rate_hz > 0]
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
        while True:
            topic, sample = self._samples.get()
            if self._ended:
                return
            try:
                self._take(topic, sample)
            except (Refused, Silent) as problem:
                self.tell(str(problem))
            except Exception as problem:
                if self._ended:
                    return
                self.tell(f"a sample of {topic} was not published: {problem!r}")

    def _take(self, topic: str, sample) -> None:
        if topic == "refusal":
            self.pilot.refusal(sample)
            return
        header = sample.header
        if header.run_id != self._run_id or (topic == "clock" and header.tick < self._tick):
            # A reset or another server: what stands there may be another.
            self._adopt(self.link.ask("status"), self.link.ask("scene"))
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
        elif topic == "episode/stop":
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
            for (_, parent, link), frame in zip(robot.frames, poses.frames)
        }
        chair = told[WORLD, robot.root]
        in_base = {link: place for (parent, link), place in told.items() if parent == robot.arm_base}
        if self.options.odom_frame:
            odom_from_chair = tree.of_pose(odometry.pose)
            house_from_odom = tree.chained(chair, tree.inverse(odom_from_chair))
            transforms = [
                mapping.transform_stamped(house_from_odom, stamp, WORLD, ODOM),
                mapping.transform_stamped(odom_from_chair, stamp, ODOM, robot.root),
            ]
        else:
            transforms = [mapping.transform_stamped(chair, stamp, WORLD, robot.root)]
        positions = dict(zip(robot.joints, joints.positions))
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
        for camera in list(self.cameras.values()):
            camera.look()
        if self.seed is not None:
            self.outputs.yield_to_others(self.seed.topics)

    def _diagnose(self, problem: str = "") -> None:
        if not self.outputs.is_wanted("/diagnostics"):
            return
        values = {"commander": self.pilot.name, "refused": str(self.pilot.refused)}
        try:
            status = self.link.ask("status", patience=2.0)
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
        except (Refused, Silent) as silent:
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
        self._subscription.close()
        self._samples.put(("", None))
        self._thread.join(timeout=5)
        for camera in self.cameras.values():
            camera.close()
        self.pilot.close()
        self.link.close()
        self.destroy_node()


__all__ = ["Options", "WheelArmNode", "color_topic", "depth_topic", "info_topic"]
