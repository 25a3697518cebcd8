"""What is asked at a control tick, without server, node and clock."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wheelarm import v1
from wheelarm.ros import mapping, tree
from wheelarm.ros.command import BadCommand, Wanted, Wishes
from wheelarm.ros.robot import Robot

SECOND = 1_000_000_000
ARM = tuple(f"joint_{number}" for number in range(1, 7))
ROBOT = Robot(
    name="robot",
    joints=("wheel", *ARM, "left", "right", "tip"),
    arm=ARM,
    knuckle="left",
    knuckle_right="right",
    wheels=frozenset({"wheel"}),
    frames=(),
    root="root",
    arm_base="base",
    end_effector="hand",
    imu="imu",
    tree=[],
    urdf="",
)


@pytest.fixture
def wishes():
    one = Wishes(ROBOT, timeout=0.5)
    one.targets = ([0.0] * 6, 0.1)
    return one


def twist(linear=0.0, angular=0.0, **more):
    message = Twist()
    message.linear.x, message.angular.z = linear, angular
    for name, value in more.items():
        setattr(message.linear, name, value)
    return message


def test_cmd_vel_is_repeated_and_ends_with_one_stop(wishes):
    wishes.twist(twist(0.3, -0.2), wall=10.0, nanos=0)
    for wall in (10.0, 10.25, 10.5):
        assert wishes.at(wall, 0).base == (0.3, -0.2)
    assert wishes.at(10.51, 0).base == (0.0, 0.0)
    assert not wishes.at(10.52, 0) and not wishes.is_waiting


def test_in_lock_step_silence_counts_in_simulation_time(wishes):
    wishes.in_simulation_time = True
    wishes.twist(twist(0.3), wall=10.0, nanos=SECOND)
    assert wishes.at(99.0, SECOND + SECOND // 2).base == (0.3, 0.0)
    assert wishes.at(99.0, SECOND + SECOND // 2 + 1).base == (0.0, 0.0)


@pytest.mark.parametrize("bad", [twist(math.nan), twist(0.1, math.inf), twist(0.1, y=0.2)])
def test_a_bad_twist_leaves_the_good_one(wishes, bad):
    wishes.twist(twist(0.3), wall=10.0, nanos=0)
    with pytest.raises(BadCommand):
        wishes.twist(bad, wall=10.1, nanos=0)
    assert wishes.at(10.2, 0).base == (0.3, 0.0)


def test_goals_are_asked_once_and_what_is_not_named_keeps_its_goal(wishes):
    wishes.joint_command(JointState(name=["joint_1"], position=[0.5]))
    assert wishes.at(0.0, 0).joints == [0.5, 0, 0, 0, 0, 0]
    assert not wishes.at(0.0, 0)
    # The targets in force are still on their way to the first goal.
    wishes.targets = ([0.01] + [0.0] * 5, 0.1)
    wishes.joint_command(JointState(name=["joint_3", "right"], position=[0.7, -0.3]))
    wanted = wishes.at(0.0, 0)
    assert wanted.joints == [0.5, 0, 0.7, 0, 0, 0] and wanted.knuckle == 0.3


def test_two_messages_before_one_tick_are_one_wish(wishes):
    wishes.joint_command(JointState(name=["joint_1"], position=[0.5]))
    wishes.joint_command(JointState(name=["left"], position=[0.2]))
    wishes.joint_command(JointState(name=["joint_2"], position=[0.6]))
    wanted = wishes.at(0.0, 0)
    assert wanted.joints == [0.5, 0.6, 0, 0, 0, 0] and wanted.knuckle == 0.2


def test_some_joints_alone_need_known_targets():
    wishes = Wishes(ROBOT)
    with pytest.raises(BadCommand, match="send it again"):
        wishes.joint_command(JointState(name=["joint_1"], position=[0.5]))
    wishes.joint_command(JointState(name=list(ARM), position=[0.5] * 6))
    assert wishes.at(0.0, 0).joints == [0.5] * 6


def planned(names, *rows, stamp=0):
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp = mapping.time(stamp)
    for seconds, positions, velocities in rows:
        point = JointTrajectoryPoint(positions=positions, velocities=velocities)
        point.time_from_start.sec = int(seconds)
        point.time_from_start.nanosec = round(seconds % 1 * SECOND)
        message.points.append(point)
    return message


def test_a_trajectory_goes_straight_and_ends_with_its_last_point(wishes):
    message = planned(["joint_2", "right"], (1.0, [1.0, -0.5], []), (2.0, [3.0, -0.5], []))
    wishes.trajectory(message, 5 * SECOND, mapping.nanos)
    for after, joint, knuckle in (
        (0.0, 0.0, 0.1),
        (0.5, 0.5, 0.3),
        (1.5, 2.0, 0.5),
        (2.5, 3.0, 0.5),
    ):
        wanted = wishes.at(0.0, 5 * SECOND + round(after * SECOND))
        assert wanted.joints == pytest.approx([0, joint, 0, 0, 0, 0])
        assert wanted.knuckle == pytest.approx(knuckle)
    assert not wishes.at(0.0, 8 * SECOND)


def test_with_velocities_a_trajectory_is_smooth(wishes):
    message = planned(["joint_1"], (1.0, [1.0], [2.0]), (2.0, [2.0], [0.0]))
    wishes.trajectory(message, 0, mapping.nanos)
    wanted = np.array([wishes.at(0.0, round(t * 1e6)).joints[0] for t in range(0, 1999)])
    speeds = np.diff(wanted) / 1e-3
    assert abs(speeds[0]) < 0.01 and abs(speeds[-1]) < 0.01
    assert abs(speeds[1000] - 2.0) < 0.01
    assert np.abs(np.diff(speeds)).max() < 0.02, "no speed jumps"


def test_an_empty_trajectory_holds_where_the_arm_is(wishes):
    wishes.trajectory(planned(["joint_1"], (1.0, [1.0], [])), 0, mapping.nanos)
    wishes.at(0.0, 0)
    wishes.targets = ([0.4] + [0.0] * 5, 0.1)
    wishes.trajectory(JointTrajectory(), SECOND // 2, mapping.nanos)
    assert wishes.at(0.0, SECOND // 2).joints == [0.4, 0, 0, 0, 0, 0]
    assert not wishes.at(0.0, SECOND)


@pytest.mark.parametrize(
    "message, words",
    [
        (planned(["joint_1"], (1.0, [1.0, 2.0], [])), "2 positions for 1"),
        (planned(["joint_1"], (1.0, [1.0], []), (1.0, [2.0], [])), "times must grow"),
        (planned(["joint_1"], (1.0, [math.inf], [])), "finite"),
        (planned(["joint_1", "joint_2"], (1.0, [1.0, 2.0], [0.0])), "1 velocities for 2"),
        (planned(["wheel"], (1.0, [1.0], [])), "cmd_vel"),
        (planned(["joint_1"], (1.0, [1.0], []), stamp=SECOND), "use_sim_time"),
    ],
)
def test_a_bad_trajectory_is_refused_and_the_old_one_stays(wishes, message, words):
    now = 5 * SECOND
    wishes.trajectory(planned(["joint_6"], (1.0, [1.0], [])), now, mapping.nanos)
    with pytest.raises(BadCommand, match=words):
        wishes.trajectory(message, now, mapping.nanos)
    assert wishes.at(0.0, now + SECOND // 2).joints == pytest.approx([0, 0, 0, 0, 0, 0.5])


def test_a_pose_names_its_frame_and_fills_a_command(wishes):
    message = PoseStamped()
    message.pose.position.x, message.pose.orientation.w = 0.4, 1.002
    for name, frame in (
        ("", v1.COMMAND_FRAME_BASE_LINK),
        ("base", v1.COMMAND_FRAME_BASE_LINK),
        ("root", v1.COMMAND_FRAME_WHEELCHAIR),
        ("house", v1.COMMAND_FRAME_HOUSE),
        ("/hand", v1.COMMAND_FRAME_END_EFFECTOR),
    ):
        message.header.frame_id = name
        wishes.desired_pose(message)
        command = v1.Command()
        wishes.at(0.0, 0).fill(command)
        assert command.arm.pose.frame == frame
        assert command.arm.pose.pose.position.x == 0.4
        assert command.arm.pose.pose.orientation.w == 1.0
        assert not command.HasField("base") and not command.HasField("gripper")
    message.header.frame_id = "map"
    with pytest.raises(BadCommand, match=r"'map'.*house"):
        wishes.desired_pose(message)


def test_a_stop_is_told_as_zeros():
    command = v1.Command()
    Wanted(base=(0.0, 0.0), opening=0.0).fill(command)
    read = v1.Command.FromString(command.SerializeToString())
    assert read.HasField("base") and read.gripper.WhichOneof("target") == "opening"


def test_depth_in_millimetres_has_no_wrong_numbers():
    depth = np.array([[0.5004, 1.0006, np.inf, 65.535, 66.0, 0.0]], np.float32)
    image = mapping.depth_image(depth, "16UC1", 0, "frame")
    assert np.frombuffer(image.data, "<u2").tolist() == [500, 1001, 0, 65535, 0, 0]
    with pytest.raises(ValueError, match="float32"):
        mapping.depth_image(depth.astype(np.float64), "32FC1", 0, "frame")


def test_a_stamp_of_many_seconds_keeps_its_nanoseconds():
    stamp = mapping.time(12_345_678_901)
    assert (stamp.sec, stamp.nanosec) == (12, 345_678_901)
    assert mapping.nanos(stamp) == 12_345_678_901


def test_a_urdf_that_cannot_be_read_is_told():
    for text, words in (
        ("<robot", "cannot be read"),
        (
            "<robot><joint name='a' type='ball'><parent link='x'/><child link='y'/></joint></robot>",
            "ball",
        ),
        ("<robot><joint name='a' type='fixed'/></robot>", "no parent"),
    ):
        with pytest.raises(ValueError, match=words):
            tree.joints(text)


def test_links_that_are_known_stand_where_they_are_told():
    text = """<robot>
      <joint name="a" type="revolute"><parent link="base"/><child link="one"/>
        <origin xyz="0 0 1"/><axis xyz="0 0 1"/></joint>
      <joint name="b" type="fixed"><parent link="one"/><child link="two"/>
        <origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/></joint>
      <joint name="c" type="prismatic"><parent link="two"/><child link="three"/>
        <axis xyz="0 1 0"/></joint></robot>"""
    joints = tree.joints(text)
    plain = dict((joint.name, place) for joint, place in tree.moving(joints, {"a": 0.3, "c": 0.2}))
    assert plain["a"] == ((0, 0, 1), tree.about((0, 0, 1), 0.3))
    assert plain["c"][0] == pytest.approx((0, 0.2, 0))
    told = ((0.9, 0.3, 1.001), tree.about((0, 0, 1), 1.9))
    found = dict(
        (joint.name, place)
        for joint, place in tree.moving(joints, {"a": 0.3, "c": 0.2}, "base", {"two": told})
    )
    two = tree.chained(found["a"], joints[1].origin)
    assert two[0] == pytest.approx(told[0]) and two[1] == pytest.approx(told[1])
    assert found["c"] == plain["c"]


def test_a_message_without_an_orientation_is_no_rotation():
    empty = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)
    assert mapping.quaternion(empty).w == 1.0
