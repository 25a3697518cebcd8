"""Commands of one control tick, without server, node and clock."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wheelarm import v1
from wheelarm.ros import mapping, tree
from wheelarm.ros.command import BadCommandError, PendingCommands, TickCommand
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
def pending():
    one = PendingCommands(ROBOT, timeout=0.5)
    one.targets = ([0.0] * 6, 0.1)
    return one


def twist(linear=0.0, angular=0.0, **more):
    message = Twist()
    message.linear.x, message.angular.z = linear, angular
    for name, value in more.items():
        setattr(message.linear, name, value)
    return message


def test_cmd_vel_is_repeated_and_ends_with_one_stop(pending):
    pending.twist(twist(0.3, -0.2), wall=10.0, nanos=0)
    for wall in (10.0, 10.25, 10.5):
        assert pending.command_at(wall, 0).base == (0.3, -0.2)
    assert pending.command_at(10.51, 0).base == (0.0, 0.0)
    assert not pending.command_at(10.52, 0) and not pending.is_waiting


def test_silence_counts_in_simulation_time_in_lock_step(pending):
    pending.in_simulation_time = True
    pending.twist(twist(0.3), wall=10.0, nanos=SECOND)
    assert pending.command_at(99.0, SECOND + SECOND // 2).base == (0.3, 0.0)
    assert pending.command_at(99.0, SECOND + SECOND // 2 + 1).base == (0.0, 0.0)


@pytest.mark.parametrize("bad", [twist(math.nan), twist(0.1, math.inf), twist(0.1, y=0.2)])
def test_invalid_twist_keeps_the_valid_one(pending, bad):
    pending.twist(twist(0.3), wall=10.0, nanos=0)
    with pytest.raises(BadCommandError):
        pending.twist(bad, wall=10.1, nanos=0)
    assert pending.command_at(10.2, 0).base == (0.3, 0.0)


def test_goals_are_part_of_one_tick_and_other_joints_keep_their_goal(pending):
    pending.joint_command(JointState(name=["joint_1"], position=[0.5]))
    assert pending.command_at(0.0, 0).joints == [0.5, 0, 0, 0, 0, 0]
    assert not pending.command_at(0.0, 0)
    # The targets in force have not reached the first goal yet.
    pending.targets = ([0.01] + [0.0] * 5, 0.1)
    pending.joint_command(JointState(name=["joint_3", "right"], position=[0.7, -0.3]))
    command = pending.command_at(0.0, 0)
    assert command.joints == [0.5, 0, 0.7, 0, 0, 0] and command.knuckle == 0.3


def test_two_messages_before_one_tick_are_merged(pending):
    pending.joint_command(JointState(name=["joint_1"], position=[0.5]))
    pending.joint_command(JointState(name=["left"], position=[0.2]))
    pending.joint_command(JointState(name=["joint_2"], position=[0.6]))
    command = pending.command_at(0.0, 0)
    assert command.joints == [0.5, 0.6, 0, 0, 0, 0] and command.knuckle == 0.2


def test_message_with_some_joints_needs_known_targets():
    pending = PendingCommands(ROBOT)
    with pytest.raises(BadCommandError, match="send it again"):
        pending.joint_command(JointState(name=["joint_1"], position=[0.5]))
    pending.joint_command(JointState(name=list(ARM), position=[0.5] * 6))
    assert pending.command_at(0.0, 0).joints == [0.5] * 6


def planned(names, *rows, stamp=0):
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp = mapping.time(stamp)
    for seconds, positions, velocities in rows:
        point = JointTrajectoryPoint(positions=positions, velocities=velocities)
        point.time_from_start.sec = int(seconds)
        point.time_from_start.nanosec = round(seconds % 1 * SECOND)
        message.points.append(point)
    return message


def test_trajectory_is_linear_and_ends_with_its_last_point(pending):
    message = planned(["joint_2", "right"], (1.0, [1.0, -0.5], []), (2.0, [3.0, -0.5], []))
    pending.trajectory(message, 5 * SECOND, mapping.nanos)
    for after, joint, knuckle in (
        (0.0, 0.0, 0.1),
        (0.5, 0.5, 0.3),
        (1.5, 2.0, 0.5),
        (2.5, 3.0, 0.5),
    ):
        command = pending.command_at(0.0, 5 * SECOND + round(after * SECOND))
        assert command.joints == pytest.approx([0, joint, 0, 0, 0, 0])
        assert command.knuckle == pytest.approx(knuckle)
    assert not pending.command_at(0.0, 8 * SECOND)


def test_trajectory_with_velocities_is_smooth(pending):
    message = planned(["joint_1"], (1.0, [1.0], [2.0]), (2.0, [2.0], [0.0]))
    pending.trajectory(message, 0, mapping.nanos)
    command = np.array([pending.command_at(0.0, round(t * 1e6)).joints[0] for t in range(0, 1999)])
    speeds = np.diff(command) / 1e-3
    assert abs(speeds[0]) < 0.01 and abs(speeds[-1]) < 0.01
    assert abs(speeds[1000] - 2.0) < 0.01
    assert np.abs(np.diff(speeds)).max() < 0.02, "no speed jumps"


def test_empty_trajectory_holds_the_arm(pending):
    pending.trajectory(planned(["joint_1"], (1.0, [1.0], [])), 0, mapping.nanos)
    pending.command_at(0.0, 0)
    pending.targets = ([0.4] + [0.0] * 5, 0.1)
    pending.trajectory(JointTrajectory(), SECOND // 2, mapping.nanos)
    assert pending.command_at(0.0, SECOND // 2).joints == [0.4, 0, 0, 0, 0, 0]
    assert not pending.command_at(0.0, SECOND)


@pytest.mark.parametrize(
    "message, text",
    [
        (planned(["joint_1"], (1.0, [1.0, 2.0], [])), "2 positions for 1"),
        (planned(["joint_1"], (1.0, [1.0], []), (1.0, [2.0], [])), "times must increase"),
        (planned(["joint_1"], (1.0, [math.inf], [])), "finite"),
        (planned(["joint_1", "joint_2"], (1.0, [1.0, 2.0], [0.0])), "1 velocities for 2"),
        (planned(["wheel"], (1.0, [1.0], [])), "cmd_vel"),
        (planned(["joint_1"], (1.0, [1.0], []), stamp=SECOND), "use_sim_time"),
    ],
)
def test_invalid_trajectory_raises_and_the_old_one_stays(pending, message, text):
    now = 5 * SECOND
    pending.trajectory(planned(["joint_6"], (1.0, [1.0], [])), now, mapping.nanos)
    with pytest.raises(BadCommandError, match=text):
        pending.trajectory(message, now, mapping.nanos)
    assert pending.command_at(0.0, now + SECOND // 2).joints == pytest.approx([0, 0, 0, 0, 0, 0.5])


def test_pose_is_commanded_in_its_frame(pending):
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
        pending.desired_pose(message)
        command = v1.Command()
        pending.command_at(0.0, 0).fill(command)
        assert command.arm.pose.frame == frame
        assert command.arm.pose.pose.position.x == 0.4
        assert command.arm.pose.pose.orientation.w == 1.0
        assert not command.HasField("base") and not command.HasField("gripper")
    message.header.frame_id = "map"
    with pytest.raises(BadCommandError, match=r"'map'.*house"):
        pending.desired_pose(message)


def test_stop_is_a_present_group_of_zeros():
    command = v1.Command()
    TickCommand(base=(0.0, 0.0), opening=0.0).fill(command)
    read = v1.Command.FromString(command.SerializeToString())
    assert read.HasField("base") and read.gripper.WhichOneof("target") == "opening"


def test_depth_in_millimetres_is_0_beyond_its_range():
    depth = np.array([[0.5004, 1.0006, np.inf, 65.535, 66.0, 0.0]], np.float32)
    image = mapping.depth_image(depth, "16UC1", 0, "frame")
    assert np.frombuffer(image.data, "<u2").tolist() == [500, 1001, 0, 65535, 0, 0]
    with pytest.raises(ValueError, match="float32"):
        mapping.depth_image(depth.astype(np.float64), "32FC1", 0, "frame")


def test_timestamp_of_many_seconds_keeps_its_nanoseconds():
    stamp = mapping.time(12_345_678_901)
    assert (stamp.sec, stamp.nanosec) == (12, 345_678_901)
    assert mapping.nanos(stamp) == 12_345_678_901


def test_error_for_an_invalid_urdf_names_the_cause():
    for urdf, text in (
        ("<robot", "cannot be read"),
        (
            "<robot><joint name='a' type='ball'><parent link='x'/><child link='y'/></joint></robot>",
            "ball",
        ),
        ("<robot><joint name='a' type='fixed'/></robot>", "lacks its parent"),
    ):
        with pytest.raises(ValueError, match=text):
            tree.joints(urdf)


def test_known_link_poses_override_joint_positions():
    urdf = """<robot>
      <joint name="a" type="revolute"><parent link="base"/><child link="one"/>
        <origin xyz="0 0 1"/><axis xyz="0 0 1"/></joint>
      <joint name="b" type="fixed"><parent link="one"/><child link="two"/>
        <origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/></joint>
      <joint name="c" type="prismatic"><parent link="two"/><child link="three"/>
        <axis xyz="0 1 0"/></joint></robot>"""
    joints = tree.joints(urdf)
    plain = dict(
        (joint.name, place) for joint, place in tree.moving_transforms(joints, {"a": 0.3, "c": 0.2})
    )
    assert plain["a"] == ((0, 0, 1), tree.axis_rotation((0, 0, 1), 0.3))
    assert plain["c"][0] == pytest.approx((0, 0.2, 0))
    known = ((0.9, 0.3, 1.001), tree.axis_rotation((0, 0, 1), 1.9))
    found = dict(
        (joint.name, place)
        for joint, place in tree.moving_transforms(
            joints, {"a": 0.3, "c": 0.2}, "base", {"two": known}
        )
    )
    two = tree.compose(found["a"], joints[1].origin)
    assert two[0] == pytest.approx(known[0]) and two[1] == pytest.approx(known[1])
    assert found["c"] == plain["c"]


def test_absent_orientation_is_the_identity():
    empty = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)
    assert mapping.quaternion(empty).w == 1.0
