"""Messages of the node equal the samples of a WheelArm client."""

import array
import math

import numpy as np
import pytest
from geometry_msgs.msg import Pose, PoseStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from peer import until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, Imu, JointState, LaserScan
from std_msgs.msg import Float64, String
from test_types import FRAMES, JOINTS
from tf2_msgs.msg import TFMessage

from wheelarm.ros import mapping, tree
from wheelarm.ros.node import Options, WheelArmNode
from wheelarm.ros.outputs import IMAGES, LATCHED, TRANSFORMS


def stamp(message) -> int:
    return mapping.nanos(message.header.stamp)


def by_stamp(messages) -> dict:
    return {stamp(one): one for one in list(messages)}


def pairs(sent: dict, messages, count=5):
    """Pairs of the client's samples and the ROS messages with the same timestamp."""

    def find():
        received = by_stamp(messages)
        common = sorted(set(sent) & received.keys())
        return [(sent[one], received[one]) for one in common] if len(common) >= count else None

    return until(find, "ROS and the WheelArm client have no timestamps in common")


@pytest.mark.parametrize("encoding", ["32FC1", "16UC1"])
def test_images_equal_those_of_a_wheelarm_client(server, bridge, peer, probe, encoding):
    endpoint = server("--camera", "*=64x36@10")
    bridge(endpoint, "--seed-topics", "--ros-args", "-p", f"depth_encoding:={encoding}")
    client_probe, sent, received = probe(endpoint), {}, {}
    for camera in ("gen3", "wheelchair"):
        sent[camera] = client_probe.subscribe_camera(camera)
        topics = {
            "color": (f"camera/{camera}/color/image_raw", Image),
            "depth": (f"camera/{camera}/depth/image_raw", Image),
            "info": (f"camera/{camera}/depth/camera_info", CameraInfo),
            "seed_color": (f"processed_data/cameras/rgb/{camera}", Image),
            "seed_depth": (f"processed_data/cameras/depth/{camera}", Image),
        }
        received[camera] = {
            name: peer.subscribe(topic, kind, IMAGES) for name, (topic, kind) in topics.items()
        }
    for camera, topics in received.items():
        for frame, image in pairs(sent[camera], topics["color"]):
            assert (image.encoding, image.is_bigendian) == ("rgb8", 0)
            assert (image.height, image.width, image.step) == (36, 64, 3 * 64)
            assert image.header.frame_id == f"{camera}_optical_frame"
            assert image.data.tobytes() == frame.color.tobytes()
            assert len(set(image.data)) > 10, "an empty image proves nothing"
        for frame, image in pairs(sent[camera], topics["depth"]):
            assert (image.encoding, image.is_bigendian) == (encoding, 0)
            if encoding == "32FC1":
                assert image.step == 4 * 64
                assert image.data.tobytes() == frame.depth.tobytes()
            else:
                millimetres = np.frombuffer(image.data.tobytes(), "<u2").reshape(36, 64)
                hit = np.isfinite(frame.depth)
                assert np.all(np.abs(millimetres[hit] / 1e3 - frame.depth[hit]) <= 0.51e-3)
                assert np.all(millimetres[~hit] == 0)
        for frame, image in pairs(sent[camera], topics["seed_color"]):
            assert image.data.tobytes() == frame.color.tobytes()
        for frame, image in pairs(sent[camera], topics["seed_depth"]):
            assert (image.encoding, image.data.tobytes()) == ("32FC1", frame.depth.tobytes())
        for frame, info in pairs(sent[camera], topics["info"]):
            lens = frame.intrinsics
            assert (info.height, info.width, info.distortion_model) == (36, 64, "plumb_bob")
            assert list(info.d) == [0.0] * 5
            assert list(info.k) == [lens.fx, 0, lens.cx - 0.5, 0, lens.fy, lens.cy - 0.5, 0, 0, 1]
            assert list(info.p) == [
                *(lens.fx, 0, lens.cx - 0.5, 0),
                *(0, lens.fy, lens.cy - 0.5, 0),
                *(0, 0, 1, 0),
            ]
            assert info.header.frame_id == f"{camera}_optical_frame"


def test_scans_equal_those_of_a_wheelarm_client(server, bridge, peer, probe):
    endpoint = server("--no-cameras", "--scan-rate-hz", "10", "--sensor", "scanner")
    bridge(endpoint)
    sent = probe(endpoint).subscribe("scan", "sensed_scan")
    received = {
        "scan": peer.subscribe("scan", LaserScan),
        "sensed_scan": peer.subscribe("sensed/scan", LaserScan),
    }
    static = peer.subscribe("/tf_static", TFMessage, LATCHED)
    for stream, messages in received.items():
        for sample, message in pairs(sent[stream], messages):
            assert message.header.frame_id == "scanner_link"
            assert message.ranges == array.array("f", sample.ranges)
            turn = message.angle_max - message.angle_min + message.angle_increment
            assert math.isclose(turn, math.tau, rel_tol=1e-5)
            assert math.isclose(message.scan_time, 0.1, rel_tol=1e-6)
            assert math.isclose(message.range_max, 12.0)
    transforms = until(lambda: list(static) and static[-1].transforms, "no static transforms")
    mounts = [one for one in transforms if one.child_frame_id == "scanner_link"]
    assert [one.header.frame_id for one in mounts] == ["wheelchair_root"]


def test_maps_equal_those_of_a_wheelarm_client(server, bridge, peer, probe):
    endpoint = server("--no-cameras")
    bridge(endpoint)
    home = probe(endpoint).client.map(without_objects=True)
    for topic, layer in {"map": home.occupied, "map/free": home.free}.items():
        messages = peer.subscribe(topic, OccupancyGrid, LATCHED)
        grid = until(lambda found=messages: list(found) and found[-1], f"no {topic}")
        assert grid.header.frame_id == "house"
        assert (grid.info.width, grid.info.height) == (home.width, home.height)
        assert (grid.info.origin.position.x, grid.info.origin.position.y) == (home.x, home.y)
        assert math.isclose(grid.info.resolution, 0.05, rel_tol=1e-6)
        assert grid.data.tobytes() == layer
        assert {0, 100} <= set(grid.data) <= {-1, 0, 100}


def test_states_equal_those_of_a_wheelarm_client(server, bridge, peer, probe):
    endpoint = server("--no-cameras")
    bridge(endpoint, "--seed-topics")
    sent = probe(endpoint).subscribe("joint_state", "pose", "imu", "odometry", "clock", "applied")
    joints, imu = peer.subscribe("joint_states", JointState), peer.subscribe("imu/data", Imu, 50)
    seed_imu, odom = peer.subscribe("imu", Imu, 50), peer.subscribe("odom", Odometry)
    clock, steps = (
        peer.subscribe("clock", Clock, 50),
        peer.subscribe("processed_data/timesteps", Clock, 50),
    )
    desired = peer.subscribe("processed_data/desired_pose", Pose)
    one_joint = {
        name: peer.subscribe(f"processed_data/joint_state/{name}", JointState) for name in JOINTS
    }
    poses = {
        name: peer.subscribe(f"processed_data/cartesian_pose/{name}", PoseStamped)
        for name in FRAMES
    }
    twists = {
        name: peer.subscribe(f"processed_data/cartesian_velocity/{name}", TwistStamped)
        for name in FRAMES
    }
    for sample, message in pairs(sent["joint_state"], joints):
        assert list(message.name) == JOINTS
        assert message.position == array.array("d", sample.positions)
        assert message.velocity == array.array("d", sample.velocities)
        assert message.effort == array.array("d", sample.efforts)
    for index, name in enumerate(JOINTS):
        for sample, message in pairs(sent["joint_state"], one_joint[name]):
            assert list(message.name) == [name] and not len(message.effort)
            assert message.position[0] == sample.positions[index]
            assert message.velocity[0] == sample.velocities[index]
    for messages in (imu, seed_imu):
        for sample, message in pairs(sent["imu"], messages):
            assert message.header.frame_id == "imu_link"
            found = message.linear_acceleration
            expected = sample.linear_acceleration
            assert (found.x, found.y, found.z) == (expected.x, expected.y, expected.z)
            assert 9.0 < found.z < 10.6
            assert message.orientation.w == sample.orientation.w
            assert message.angular_velocity.z == sample.angular_velocity.z
    for sample, message in pairs(sent["odometry"], odom):
        assert (message.header.frame_id, message.child_frame_id) == ("odom", "wheelchair_root")
        assert message.pose.pose.position.x == sample.pose.position.x
        assert message.twist.twist.linear.x == sample.twist.linear.x
    for index, name in enumerate(FRAMES):
        parent = "house" if name == "wheelchair" else "base_link"
        for sample, message in pairs(sent["pose"], poses[name]):
            expected, found = sample.frames[index].pose, message.pose
            assert message.header.frame_id == parent
            assert (found.position.x, found.position.z) == (
                expected.position.x,
                expected.position.z,
            )
            assert found.orientation.w == expected.orientation.w
        for sample, message in pairs(sent["pose"], twists[name]):
            assert message.twist.linear.x == sample.frames[index].twist.linear.x
    for messages in (clock, steps):
        until(lambda: len(messages) >= 5)
        times = [mapping.nanos(one.clock) for one in list(messages)]
        assert times == sorted(set(times))
        assert set(times) & set(sent["clock"])
    until(lambda: len(desired) >= 5)
    known = {
        (1e3 * s.desired_pose.position.x, s.desired_pose.orientation.w)
        for s in list(sent["applied"].values())
    }
    assert any((one.position.x, one.orientation.w) in known for one in list(desired))


def chain(transforms: dict, frame: str, root: str = "house"):
    """Pose of `frame` in `root`, from a tree of child -> (parent, transform)."""
    found = tree.IDENTITY
    while frame != root:
        parent, step = transforms[frame]
        found, frame = tree.compose(step, found), parent
    return found


def from_message(message):
    place, turn = message.transform.translation, message.transform.rotation
    return (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)


def difference(first, second) -> float:
    """Largest difference of two transforms; the sign of a quaternion does not count."""
    sign = 1.0 if sum(a * b for a, b in zip(first[1], second[1], strict=False)) > 0 else -1.0
    turns = [a - sign * b for a, b in zip(first[1], second[1], strict=False)]
    places = [a - b for a, b in zip(first[0], second[0], strict=False)]
    return max(map(abs, turns + places))


@pytest.mark.parametrize("odom", [True, False])
def test_chain_of_tf_equals_the_recorded_pose(server, bridge, peer, probe, odom):
    endpoint = server("--camera", "*=64x36@10", "--calibration-seed", "5")
    bridge(endpoint, "--ros-args", "-p", f"odom_frame:={str(odom).lower()}")
    client_probe = probe(endpoint)
    sent = client_probe.subscribe("pose")["pose"]
    images = {camera: client_probe.subscribe_camera(camera) for camera in ("gen3", "wheelchair")}
    robot = client_probe.client.scene().robot
    moving, static = (
        peer.subscribe("tf", TFMessage, TRANSFORMS),
        peer.subscribe("tf_static", TFMessage, LATCHED),
    )
    # Chair, arm and gripper move during the test.
    drive, arm = peer.publisher("cmd_vel", Twist), peer.publisher("joint_command", JointState)
    gripper = peer.publisher("gripper", Float64)
    until(lambda: static and len(moving) > 2)
    begin = len(moving)
    arm.publish(JointState(name=["joint_1", "joint_6"], position=[0.3, -1.0]))
    gripper.publish(Float64(data=0.03))
    twist = Twist()
    twist.linear.x, twist.angular.z = 0.2, 0.3

    def enough():
        drive.publish(twist)
        return len(moving) > begin + 90

    until(enough)
    fixed = {t.child_frame_id: (t.header.frame_id, from_message(t)) for t in static[-1].transforms}
    names = [frame.name for frame in robot.frames]
    mount, worst, count, travelled = tree.from_pose(robot.arm_mount), 0.0, 0, set()
    lens_worst, lenses = 0.0, 0
    for message in list(moving):
        at = stamp(message.transforms[0])
        if at not in sent:
            continue
        transforms = dict(fixed)
        for one in message.transforms:
            assert stamp(one) == at
            assert one.child_frame_id not in transforms, "a frame has two parents"
            transforms[one.child_frame_id] = (one.header.frame_id, from_message(one))
        poses = {n: tree.from_pose(f.pose) for n, f in zip(names, sent[at].frames, strict=False)}
        base = tree.compose(poses["wheelchair"], mount)
        for frame in robot.frames:
            want = poses[frame.name]
            if frame.parent != "house":
                want = tree.compose(base, want)
            worst = max(worst, difference(chain(transforms, frame.link), want))
        for camera, frames in images.items():
            if at in frames:
                expected = tree.from_pose(frames[at].pose)
                found = chain(transforms, f"{camera}_optical_frame")
                lens_worst, lenses = max(lens_worst, difference(found, expected)), lenses + 1
        travelled.add(round(poses["wheelchair"][0][0], 4))
        count += 1
    print(f"{count} timestamps, worst {worst:.3g}; {lenses} images, worst {lens_worst:.3g}")
    assert count >= 60 and lenses >= 5 and len(travelled) > 10
    assert worst < 1e-9
    assert lens_worst < 1e-9
    assert ("odom" in transforms) == odom


def test_robot_description_reaches_late_subscribers(server, bridge, peer, probe):
    endpoint = server("--no-cameras")
    bridge(endpoint, "--ros-args", "-p", "mesh_folder:=file:///somewhere")
    received = peer.subscribe("robot_description", String, LATCHED)
    text = until(lambda: received)[0].data
    urdf = probe(endpoint).client.scene().robot.urdf_text
    assert tree.joints(text) == tree.joints(urdf)
    assert 'filename="file:///somewhere/meshes/chair_body.obj"' in text


def test_furniture_is_described_and_its_joints_and_frames_follow_the_samples(
    server, bridge, peer, probe
):
    endpoint = server("--no-cameras")
    bridge(endpoint)
    client_probe = probe(endpoint)
    sent = client_probe.subscribe("furniture_joint")["furniture_joint"]
    described = peer.subscribe("furniture_description", String, LATCHED)
    states = peer.subscribe("furniture/joint_states", JointState)
    moving = peer.subscribe("tf", TFMessage, TRANSFORMS)
    static = peer.subscribe("tf_static", TFMessage, LATCHED)
    text = until(lambda: described)[0].data
    scene = client_probe.client.scene()
    assert text == scene.furniture_urdf
    joints = {joint.name: joint for joint in tree.joints(text)}
    names = [joint.name for joint in scene.joints]
    assert names and all(joints[name].kind == "prismatic" for name in names)
    for sample, message in pairs(sent, states):
        assert list(message.name) == names
        assert message.position == array.array("d", sample.positions)
    until(lambda: static and by_stamp(m.transforms[0] for m in list(moving)).keys() & sent.keys())
    fixed = {t.child_frame_id: (t.header.frame_id, from_message(t)) for t in static[-1].transforms}
    last = [m for m in list(moving) if stamp(m.transforms[0]) in sent][-1]
    frames = {t.child_frame_id: (t.header.frame_id, from_message(t)) for t in last.transforms}
    positions = sent[stamp(last.transforms[0])].positions
    for joint, position in zip(scene.joints, positions, strict=True):
        at, turn = tree.from_pose(joint.rest)
        axis = (joint.axis.x, joint.axis.y, joint.axis.z)
        at = tuple(a + position * part for a, part in zip(at, axis, strict=True))
        assert difference(chain({**fixed, **frames}, joint.body), (at, turn)) < 1e-9


def test_camera_is_received_only_with_a_subscriber(server, peer):
    node = WheelArmNode(Options(endpoint=server("--camera", "*=64x36@10")))
    peer.executor.add_node(node)
    try:
        images = []
        subscription = peer.node.create_subscription(
            Image, "camera/gen3/color/image_raw", images.append, IMAGES
        )
        until(lambda: len(images) >= 3)
        assert node.cameras["gen3"].is_open
        assert not node.cameras["wheelchair"].is_open
        peer.node.destroy_subscription(subscription)
        until(lambda: not node.cameras["gen3"].is_open)
    finally:
        peer.executor.remove_node(node)
        node.close()


def test_transform_and_its_inverse_compose_to_the_identity():
    import random

    generator = random.Random(3)
    for _ in range(100):
        axis = [generator.gauss(0, 1) for _ in range(3)]
        length = math.hypot(*axis)
        turn = tree.axis_rotation(tuple(part / length for part in axis), generator.uniform(-3, 3))
        one = (tuple(generator.uniform(-2, 2) for _ in range(3)), turn)
        assert difference(tree.compose(one, tree.invert(one)), tree.IDENTITY) < 1e-12
