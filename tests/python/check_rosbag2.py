"""Decodes every message of bags with third-party readers and compares every field with the
recordings, which are read with h5py alone.

Usage: check_rosbag2.py READER BAGS RECORDING.h5 [RECORDING.h5 …]
READER is rclpy (of the ROS 2 installation of this Python), rosbags or mcap-ros2; BAGS is the
output folder of `dataset export --format rosbag2`.
"""

import collections
import importlib
import json
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

import h5py
import numpy as np

# Topics with one JSON object per sample of a stream.
JSON_TOPICS = {
    "/evaluation": "streams/evaluation",
    "/phase": "streams/phase",
    "/contact": "streams/contact",
    "/command": "streams/command",
    "/disturbance": "streams/disturbance",
    "/person": "streams/person",
    "/state_hash": "streams/state_hash",
    "/events": "events",
}


def nanos(time):
    return time.sec * 1_000_000_000 + time.nanosec


def equal(found, wanted, what):
    """Checks equality to the last bit; NaN equals NaN."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    assert found.shape == wanted.shape, f"{what}: shape {found.shape}, expected {wanted.shape}"
    same = np.array_equal(found, wanted, equal_nan=wanted.dtype.kind == "f")
    assert same, f"{what}: {found}, expected {wanted}"


def near(found, wanted, what, tolerance):
    worst = np.abs(np.asarray(found) - np.asarray(wanted)).max()
    assert worst <= tolerance, f"{what}: error {worst}"


def xyz(v):
    return [v.x, v.y, v.z]


def seven(pose):
    return [*xyz(pose.position), pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w]


def six(twist):
    return [*xyz(twist.linear), *xyz(twist.angular)]


def header(message, frame, stamp, what):
    assert message.header.frame_id == frame, f"{what}: in {message.header.frame_id}, expected {frame}"
    assert nanos(message.header.stamp) == stamp, f"{what}: {nanos(message.header.stamp)}, expected {stamp}"


class Topics:
    """Expected messages of every topic: timestamps of the log, and a check of message i."""

    def __init__(self, file):
        self.file, self.streams = file, file["streams"]
        self.robot = dict(file["robot"].attrs)
        self.chair, self.base = self.robot["root_link"], self.robot["arm_base_link"]
        self.start = min(int(s[0]) for s in self.stamps_of_all() if len(s))
        # Topic -> [(stamps, check)], one entry for each source.
        self.wanted = collections.defaultdict(list)
        self.transforms = collections.defaultdict(list)
        self.add_topics()

    def stamps_of_all(self):
        found = [self.file["events/stamp_nanos"][...]]
        self.streams.visititems(
            lambda name, item: found.append(item[...]) if name.endswith("/stamp_nanos") else None
        )
        return found

    def put(self, topic, stream, check, stamps=None):
        stamps = self.streams[stream]["stamp_nanos"][...] if stamps is None else stamps
        if len(stamps):
            self.wanted[topic].append((stamps, check))

    def columns(self, stream, *names):
        return [self.streams[stream][name][...] for name in names]

    def add_topics(self):
        self.once()
        self.put("/clock", "clock", lambda m, i, t: equal(nanos(m.clock), t, "clock"))
        self.joints("/joint_states", "joint_state", self.names("joint_state", "position"))
        self.joints("/sensed/joint_states", "sensed_joint", self.names("sensed_joint", "position"))
        self.joints("/furniture/joint_states", "furniture_joint", self.names("furniture_joint", "position"))
        self.imu("/imu/data", "imu")
        self.imu("/sensed/imu/data", "sensed_imu")
        self.scan("/scan", "scan")
        self.scan("/sensed/scan", "sensed_scan")
        self.odometry("/odom", "odometry")
        self.odometry("/sensed/odom", "sensed_odometry")
        self.poses()
        self.applied()
        self.tree()
        self.skin()
        for camera in self.streams["camera"]:
            self.camera(camera)
        for sensor in self.streams.get("sensor", []):
            self.sensor(sensor)
        for topic, place in JSON_TOPICS.items():
            if place in self.file:
                self.json_objects(topic, self.file[place])

    def names(self, stream, column):
        return list(self.streams[stream][column].attrs["names"])

    def once(self):
        legend = self.file["initial_state/instances"]
        ids = {str(i): n.decode() for i, n in zip(legend["id"][...], legend["name"][...])}
        stamps = np.array([self.start], dtype=np.uint64)
        instruction = self.file.attrs["instruction"]
        self.put("/instruction", None, lambda m, i, t: equal(m.data, instruction, "instruction"), stamps)
        self.put("/instance_ids", None, lambda m, i, t: equal(json.loads(m.data) == ids, True, "legend"), stamps)
        self.put("/robot_description", None, self.robot_description, stamps)
        self.put("/furniture_description", None, self.furniture_description, stamps)
        self.put("/tf_static", None, self.still, stamps)

    def robot_description(self, message, i, t):
        self.urdf = xml.fromstring(message.data)
        assert "<mesh" not in message.data and self.urdf.tag == "robot"

    def furniture_description(self, message, i, t):
        recorded = bytes(self.file["initial_state/furniture_urdf"][...]).decode()
        equal(message.data == recorded, True, "furniture description")
        self.furniture = xml.fromstring(message.data)

    def still(self, message, i, t):
        for transform in message.transforms:
            assert nanos(transform.header.stamp) == t
            self.take(transform)

    def take(self, transform):
        pose = [*xyz(transform.transform.translation), *(getattr(transform.transform.rotation, k) for k in "xyzw")]
        entry = (nanos(transform.header.stamp), transform.header.frame_id, pose)
        self.transforms[transform.child_frame_id].append(entry)

    def joints(self, topic, stream, names):
        members = self.streams[stream]
        position, velocity = members["position"][...], members["velocity"][...]
        effort = members["effort"][...] if "effort" in members else np.empty((len(position), 0))

        def check(m, i, t):
            header(m, "", t, topic)
            assert list(m.name) == names, f"{topic}: {m.name}"
            equal(m.position, position[i], topic)
            equal(m.velocity, velocity[i], topic)
            equal(m.effort, effort[i], topic)

        self.put(topic, stream, check)

    def imu(self, topic, stream):
        turn, speed = self.columns(stream, "angular_velocity", "linear_acceleration")
        members = self.streams[stream]
        orientation = members["orientation"][...] if "orientation" in members else None
        covariance = np.zeros(9)
        covariance[0] = 0.0 if orientation is not None else -1.0

        def check(m, i, t):
            header(m, "imu_link", t, topic)
            if orientation is not None:
                equal([getattr(m.orientation, k) for k in "xyzw"], orientation[i], topic)
            equal(m.orientation_covariance, covariance, topic)
            equal(xyz(m.angular_velocity), turn[i], topic)
            equal(xyz(m.linear_acceleration), speed[i], topic)
            for unknown in (m.angular_velocity_covariance, m.linear_acceleration_covariance):
                equal(unknown, np.zeros(9), topic)

        self.put(topic, stream, check)

    def scan(self, topic, stream):
        if stream not in self.streams:
            return
        (ranges,) = self.columns(stream, "ranges")

        def check(m, i, t):
            header(m, "scanner_link", t, topic)
            equal(m.ranges, ranges[i].astype("f4"), topic)
            turn = m.angle_max - m.angle_min + m.angle_increment
            near(np.array([turn, m.scan_time]), np.array([2 * np.pi, 0.1]), topic, 1e-5)
            assert m.range_min < m.range_max and len(m.intensities) == 0
            near(np.array([len(m.ranges) * m.angle_increment]), np.array([turn]), topic, 1e-4)

        self.put(topic, stream, check)

    def odometry(self, topic, stream):
        pose, twist = self.columns(stream, "pose", "twist")

        def check(m, i, t):
            header(m, "odom", t, topic)
            assert m.child_frame_id == self.chair
            equal(seven(m.pose.pose), pose[i], topic)
            equal(six(m.twist.twist), twist[i], topic)
            equal(m.pose.covariance, np.zeros(36), topic)
            equal(m.twist.covariance, np.zeros(36), topic)

        self.put(topic, stream, check)

    def poses(self):
        pose, twist = self.columns("pose", "pose", "twist")
        for k, name in enumerate(self.names("pose", "pose")):
            frame = self.robot["frame_parents"][k]

            def pose_check(m, i, t, k=k, frame=frame):
                header(m, frame, t, "pose")
                equal(seven(m.pose), pose[i, k], "pose")

            def twist_check(m, i, t, k=k, frame=frame):
                header(m, frame, t, "twist")
                equal(six(m.twist), twist[i, k], "twist")

            self.put(f"/pose/{name}", "pose", pose_check)
            self.put(f"/twist/{name}", "pose", twist_check)

    def applied(self):
        names = ("joint_position", "joint_velocity", "wheel_velocity", "knuckle", "desired_pose")
        position, velocity, wheels, knuckle, desired = self.columns("applied", *names)
        roles = dict(zip(self.robot["joint_roles"], self.robot["joints"]))
        arm = list(self.robot["arm_joints"])
        driven = [roles["JOINT_ROLE_WHEEL_LEFT"], roles["JOINT_ROLE_WHEEL_RIGHT"]]
        nothing = np.empty((len(knuckle), 0))

        def joints(names, position, velocity):
            def check(m, i, t):
                header(m, "", t, "applied")
                assert list(m.name) == names, m.name
                equal(m.position, position[i], "applied position")
                equal(m.velocity, velocity[i], "applied velocity")
                assert len(m.effort) == 0

            return check

        def pose(m, i, t):
            header(m, self.base, t, "desired pose")
            equal(seven(m.pose), desired[i], "desired pose")

        self.put("/applied/arm", "applied", joints(arm, position, velocity))
        self.put("/applied/wheels", "applied", joints(driven, nothing, wheels))
        self.put("/applied/gripper", "applied", joints([roles["JOINT_ROLE_KNUCKLE"]], knuckle[:, None], nothing))
        self.put("/applied/desired_pose", "applied", pose)

    def tree(self):
        """The sources of /tf, whose transforms are checked at the end."""

        def take(count, stamps):
            def check(m, i, t):
                assert len(m.transforms) == count, f"/tf: {len(m.transforms)}, expected {count}"
                assert {nanos(transform.header.stamp) for transform in m.transforms} <= {int(stamps[i])}
                for transform in m.transforms:
                    self.take(transform)

            return check

        def source(stream, count, exposed="stamp_nanos"):
            if len(self.streams[stream]["stamp_nanos"]):
                self.put("/tf", stream, take(count, self.streams[stream][exposed][...]))

        source("joint_state", len(self.names("joint_state", "position")))
        source("pose", 1)
        source("object_pose", len(self.file.attrs["objects"]))
        source("furniture_joint", len(self.names("furniture_joint", "position")))
        for camera in self.streams["camera"]:
            source(f"camera/{camera}", 1)
        for sensor in self.streams.get("sensor", []):
            source(f"sensor/{sensor}", 1, "exposure_nanos")

    def skin(self):
        vertices = self.streams["deformable/vertex"][...]

        def check(m, i, t):
            header(m, "house", t, "skin")
            count = vertices.shape[1]
            assert [(f.name, f.offset, f.datatype, f.count) for f in m.fields] == [("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1)]
            assert (m.height, m.width, m.point_step, m.row_step) == (1, count, 12, 12 * count)
            assert not m.is_bigendian and m.is_dense
            found = np.frombuffer(bytes(m.data), "<f4").reshape(count, 3)
            equal(found, vertices[i].astype("<f4"), "skin")

        self.put("/deformable/points", "deformable", check)

    def image(self, topic, stream, plane, frame, exposed):
        data = self.streams[stream][plane]
        height, width = data.shape[1:3]
        encoding = {("uint8", 4): "rgb8", ("float32", 3): "32FC1", ("uint16", 3): "16UC1"}[data.dtype.name, data.ndim]

        def check(m, i, t):
            header(m, frame, int(exposed[i]), topic)
            image = np.ascontiguousarray(data[i])
            assert (m.height, m.width, m.encoding, m.is_bigendian) == (height, width, encoding, 0), topic
            assert m.step == image.nbytes // height, f"{topic}: {m.step}"
            assert bytes(m.data) == image.tobytes(), f"{topic}: image {i} differs"

        self.put(topic, stream, check)

    def camera_info(self, topic, stream, frame, exposed):
        intrinsics = self.streams[stream]["intrinsics"][...]

        def check(m, i, t):
            header(m, frame, int(exposed[i]), topic)
            width, height, fx, fy, cx, cy = intrinsics[i]
            cx, cy = cx - 0.5, cy - 0.5
            assert (m.width, m.height, m.distortion_model) == (width, height, "plumb_bob")
            equal(m.d, np.zeros(5), topic)
            equal(m.k, np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1]), topic)
            equal(m.r, np.eye(3).ravel(), topic)
            equal(m.p, np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]), topic)
            roi = m.roi
            rest = (m.binning_x, m.binning_y, roi.x_offset, roi.y_offset, roi.height, roi.width, roi.do_rectify)
            assert not any(rest), f"{topic}: {rest}"

        self.put(topic, stream, check)

    def camera(self, name):
        stream, frame = f"camera/{name}", f"{name}_optical_frame"
        exposed = self.streams[stream]["stamp_nanos"][...]
        if not len(exposed):
            return
        for plane, place in (("rgb", "color"), ("depth", "depth"), ("ids", "instances")):
            self.image(f"/camera/{name}/{place}/image_raw", stream, plane, frame, exposed)
        for place in ("color", "depth"):
            self.camera_info(f"/camera/{name}/{place}/camera_info", stream, frame, exposed)

    def sensor(self, name):
        stream, frame = f"sensor/{name}", f"{name}_optical_frame"
        exposed = self.streams[stream]["exposure_nanos"][...]
        if not len(exposed):
            return
        plane = "rgb" if "rgb" in self.streams[stream] else "depth"
        self.image(f"/sensor/{name}/image_raw", stream, plane, frame, exposed)
        self.camera_info(f"/sensor/{name}/camera_info", stream, frame, exposed)

    def json_objects(self, topic, group):
        def plain(value, names=()):
            if isinstance(value, np.ndarray):
                parts = [plain(part) for part in value]
                return dict(zip(names, parts)) if len(names) == len(parts) and len(names) else parts
            if isinstance(value, bytes):
                return value.decode()
            if isinstance(value, np.uint8):
                return bool(value)
            value = value.item()
            return value if value == value else None

        columns = {name: data for name, data in group.items() if name not in ("stamp_nanos", "sequence", "tick", "message")}
        rows = {name: data[...] for name, data in columns.items()}

        def check(m, i, t):
            found = json.loads(m.data)
            for name, data in columns.items():
                wanted = plain(rows[name][i], list(data.attrs.get("names", ())))
                assert found.pop(name) == wanted, f"{topic}/{name} of sample {i}"
            assert not found, f"{topic}: {found}"

        self.put(topic, None, check, group["stamp_nanos"][...])

    def take_frame(self, child, parent):
        """Timestamps and poses of a frame, in order of time."""
        entries = self.transforms.pop(child)
        assert {entry[1] for entry in entries} == {parent}, f"{child} in {[e[1] for e in entries][:3]}"
        return np.array([entry[0] for entry in entries]), np.array([entry[2] for entry in entries])

    def check_links(self, urdf, stream, links):
        """Checks the transforms of a description: recorded positions move its joints."""
        names = self.names(stream, "position")
        position, stamps = self.columns(stream, "position", "stamp_nanos")
        described = {j.get("name"): j for j in urdf.iter("joint") if j.find("child") is not None}
        assert set(names) <= set(described), set(names) - set(described)
        units = list(self.streams[stream]["position"].attrs.get("units_by_name", ()))
        for name, unit in zip(names, units):
            wanted = {"m": "prismatic", "rad": "revolute"}[unit]
            assert described[name].get("type") == wanted, f"{name} is in {unit}"
        for name, joint in described.items():
            child, parent = joint.find("child").get("link"), joint.find("parent").get("link")
            moves = name in names and joint.get("type") != "fixed"
            found_stamps, found = self.take_frame(child, parent)
            wanted = joint_pose(joint, position[:, names.index(name)] if moves else np.zeros(1))
            if moves:
                equal(found_stamps, stamps.astype(found_stamps.dtype), child)
            near(matrices(found), wanted, child, 1e-12)
            links[child] = (parent, matrices(found))

    def check_transforms(self):
        """Checks every transform: recorded poses bit for bit, links with the joints of the description."""
        frames = len(self.transforms)

        def recorded(child, stamps, poses):
            found_stamps, found = self.take_frame(child, "house")
            equal(found_stamps, stamps.astype(found_stamps.dtype), child)
            equal(found, poses, child)

        stamps, (poses,) = self.streams["pose/stamp_nanos"][...], self.columns("pose", "pose")
        recorded(self.chair, stamps, poses[:, 0])
        for k, name in enumerate(self.file.attrs["objects"]):
            recorded(name, self.streams["object_pose/stamp_nanos"][...], self.streams["object_pose/pose"][:, k])
        for kind, exposed in (("camera", "stamp_nanos"), ("sensor", "exposure_nanos")):
            for name in self.streams.get(kind, []):
                group = self.streams[kind][name]
                if len(group["stamp_nanos"]):
                    recorded(f"{name}_optical_frame", group[exposed][...], group["pose"][...])
        # Origin of the odometry: its first pose is the first pose of the chair.
        (_,), (odometry,) = self.take_frame("odom", "house")
        chair = matrices(odometry[None]) @ matrices(self.streams["odometry/pose"][:1])
        near(chair, matrices(poses[:1, 0]), "house from odom", 1e-12)

        if "scan" in self.streams and len(self.streams["scan/stamp_nanos"]):
            (_,), (mount,) = self.take_frame("scanner_link", self.chair)
            equal(mount[3:], [0, 0, 0, 1], "the scanner's axes")
        links = {}
        for urdf, stream in ((self.urdf, "joint_state"), (self.furniture, "furniture_joint")):
            self.check_links(urdf, stream, links)
        assert not self.transforms, f"unexpected frames: {list(self.transforms)}"
        chain, link = np.eye(4)[None], self.robot["end_effector_link"]
        while link != self.base:
            link, step = links[link]
            chain = step @ chain
        hand = matrices(poses[:, self.names("pose", "pose").index("end_effector")])
        # Physics has poses in single precision in the house frame.
        near(chain, hand, "the hand through /tf", 1e-4)
        return frames, np.abs(chain - hand).max()


def matrices(poses):
    """x y z qx qy qz qw, one row each, as 4x4 matrices."""
    poses = np.asarray(poses)
    x, y, z, w = poses[:, 3:].T
    out = np.zeros((len(poses), 4, 4))
    out[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], 1)
    out[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], 1)
    out[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], 1)
    out[:, :3, 3] = poses[:, :3]
    out[:, 3, 3] = 1
    return out


def axis_rotations(axis, angles):
    """Rotations about a unit axis, by Rodrigues' formula, 4x4 each."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out = np.tile(np.eye(4), (len(angles), 1, 1))
    s, c = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    out[:, :3, :3] += s * cross + (1 - c) * (cross @ cross)
    return out


def joint_pose(joint, positions):
    """Poses of a URDF joint's child in its parent at positions, 4x4 each."""
    attributes = joint.find("origin")
    attributes = {} if attributes is None else attributes.attrib
    place, rpy = ([float(v) for v in attributes.get(k, "0 0 0").split()] for k in ("xyz", "rpy"))
    origin = np.eye(4)
    for axis, angle in zip(np.eye(3), rpy):
        origin = axis_rotations(axis, np.array([angle]))[0] @ origin
    origin[:3, 3] = place
    axis = joint.find("axis")
    axis = np.array([1.0, 0, 0] if axis is None else [float(v) for v in axis.get("xyz").split()])
    axis /= np.linalg.norm(axis)
    if joint.get("type") == "prismatic":
        moved = np.tile(np.eye(4), (len(positions), 1, 1))
        moved[:, :3, 3] = positions[:, None] * axis
    else:
        moved = axis_rotations(axis, positions)
    return origin @ moved


def by_rclpy(bag):
    """Messages decoded by this ROS 2, with its own type hashes."""
    from mcap.reader import make_reader
    from rclpy.serialization import deserialize_message

    types, hashes = {}, {}
    with open(bag / f"{bag.name}_0.mcap", "rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if schema.name not in types:
                package, kind, name = schema.name.split("/")
                types[schema.name] = getattr(importlib.import_module(f"{package}.{kind}"), name)
                description = json.loads(Path(sys.prefix, "share", package, kind, f"{name}.json").read_text())
                (found,) = [t["hash_string"] for t in description["type_hashes"] if t["type_name"] == schema.name]
                hashes[schema.name] = found
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            stored = channel.metadata["topic_type_hash"]
            assert stored == hashes[schema.name], f"{schema.name}: {stored}, ROS 2 has {hashes[schema.name]}"
            yield channel.topic, message.log_time, deserialize_message(message.data, types[schema.name])


def by_rosbags(bag):
    """Messages decoded by rosbags through metadata.yaml, with its own types."""
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(bag) as reader:
        assert reader.ros_distro == "jazzy"
        counts, stamps = collections.Counter(), []
        for connection in reader.connections:
            assert connection.digest == store.hash_rihs01(connection.msgtype), connection.msgtype
            check_durability(connection)
        for connection, stamp, data in reader.messages():
            counts[connection.topic] += 1
            stamps.append(stamp)
            yield connection.topic, stamp, store.deserialize_cdr(data, connection.msgtype)
        stored = {connection.topic: connection.msgcount for connection in reader.connections}
        assert stored == counts, "the counts of metadata.yaml differ"
        assert reader.message_count == sum(counts.values())
        # rosbags returns the exclusive end of the interval.
        assert (reader.start_time, reader.end_time) == (min(stamps), max(stamps) + 1)
        assert reader.duration == max(stamps) - min(stamps) + 1
    with Reader(bag / f"{bag.name}_0.mcap") as reader:
        for connection in reader.connections:
            check_durability(connection)
    check_metadata(bag)


def check_durability(connection):
    """Checks that late subscribers receive the topics with a single message."""
    from rosbags.interfaces import QosDurability

    found = [profile.durability for profile in connection.ext.offered_qos_profiles]
    once = ("/tf_static", "/robot_description", "/furniture_description", "/instruction", "/instance_ids")
    wanted = [QosDurability.TRANSIENT_LOCAL] if connection.topic in once else []
    assert found == wanted, f"{connection.topic}: {found}, expected {wanted}"


def check_metadata(bag):
    """Checks the other fields of metadata.yaml, and that the file contains the same."""
    from mcap.reader import make_reader
    from ruamel.yaml import YAML

    stored = YAML(typ="safe").load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    with open(bag / f"{bag.name}_0.mcap", "rb") as stream:
        (record,) = [m for m in make_reader(stream).iter_metadata() if m.name == "rosbag2"]
    assert YAML(typ="safe").load(record.metadata["serialized_metadata"]) == stored
    assert (stored["version"], stored["storage_identifier"]) == (9, "mcap")
    assert stored["relative_file_paths"] == [f"{bag.name}_0.mcap"] == [f["path"] for f in stored["files"]]
    custom = stored["custom_data"]
    # Bags of a world pack have authors and licenses too.
    assert set(custom) - {"world_packs"} == {"label", "instruction", "task", "seed", "success", "complete"}
    assert custom["label"] == bag.name and all(isinstance(value, str) for value in custom.values())


def by_mcap_ros2(bag):
    """Messages decoded with the definitions in the bag."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with open(bag / f"{bag.name}_0.mcap", "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            yield channel.topic, message.log_time, decoded


READERS = {"rclpy": by_rclpy, "rosbags": by_rosbags, "mcap-ros2": by_mcap_ros2}


def check(read, bag, recording):
    with h5py.File(recording) as file:
        topics = Topics(file)
        # Messages of several sources are in order of time; those of one time in any order.
        waiting = {
            topic: sorted((int(t), k, i) for k, (stamps, _) in enumerate(sources) for i, t in enumerate(stamps))
            for topic, sources in topics.wanted.items()
        }
        place, count, last = collections.Counter(), 0, 0
        left = collections.defaultdict(list)
        for topic, stamp, message in read(bag):
            assert topic in waiting, f"{topic} is in the bag and unexpected"
            assert stamp >= last, f"{topic}: not in order of time"
            last = stamp
            count += 1
            if len(topics.wanted[topic]) > 1:
                left[topic].append((stamp, message))
                continue
            wanted, source, sample = waiting[topic][place[topic]]
            place[topic] += 1
            assert stamp == wanted, f"{topic}: {stamp}, expected {wanted}"
            topics.wanted[topic][source][1](message, sample, stamp)
        for topic, messages in left.items():
            check_sources(topic, messages, topics.wanted[topic])
            place[topic] = len(messages)
        for topic, samples in waiting.items():
            assert place[topic] == len(samples), f"{topic}: {place[topic]} messages, expected {len(samples)}"
        frames, off = topics.check_transforms()
    print(
        f"{bag.name}: {count} messages of {len(waiting)} topics, {frames} frames; "
        f"error of the hand through /tf {off:.1e}"
    )


def check_sources(topic, messages, sources):
    """Checks that each message is a sample of exactly one of several sources of a topic."""
    samples = collections.defaultdict(list)
    for k, (stamps, _) in enumerate(sources):
        for i, stamp in enumerate(stamps):
            samples[int(stamp)].append((k, i))
    for stamp, message in messages:
        reasons = []
        for k, i in samples[stamp]:
            try:
                sources[k][1](message, i, stamp)
            except AssertionError as error:
                reasons.append(error)
                continue
            samples[stamp].remove((k, i))
            break
        else:
            raise AssertionError(f"{topic} at {stamp}: {reasons}")


def main():
    reader, folder, *recordings = sys.argv[1:]
    for recording in recordings:
        with h5py.File(recording) as file:
            label = file.attrs["label"]
        check(READERS[reader], Path(folder, label), recording)
    bags = {path.name for path in Path(folder).iterdir()}
    assert len(bags) == len(recordings), f"{bags} of {len(recordings)} recordings"
    print(f"{reader}, Python {sys.version.split()[0]}: {len(recordings)} bags equal the recordings")


main()
