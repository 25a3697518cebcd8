"""Rows equal those of the crate wheelarm-policy: the same cases as in its tests."""

from __future__ import annotations

import numpy as np
import pytest

from wheelarm import rows, v1

RNG = np.random.default_rng(0)


def robot():
    return v1.RobotDescription(
        joints=[
            v1.RobotJoint(name=f"joint_{i + 1}", role=v1.JOINT_ROLE_ARM, arm_index=i)
            for i in reversed(range(6))
        ],
        drive=v1.DriveDescription(
            wheel_radius=0.2, track=0.5, forward_speed=1.0, backward_speed=0.5, turn_rate=2.0
        ),
        gripper=v1.GripperDescription(max_knuckle=0.8),
    )


def yawed(x, y, yaw):
    return [x, y, 0.0, 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)]


def test_names_equal_those_of_exports():
    names = rows.state_names(rows.arm_joint_names(robot()))
    assert len(names) == rows.STATE and names[0] == "joint_1.position"
    assert names[12:15] == ["knuckle.position", "knuckle.velocity", "hand.x"]
    assert names[17:] == [
        *(f"hand.{s}" for s in rows.SIX),
        *(f"odometry.{s}" for s in ("x", "y", "cos", "sin")),
    ]
    for kind, size in rows.KINDS.items():
        assert len(rows.action_names(kind)) == size
    assert rows.action_names()[9:] == ["knuckle.target", "chair.linear", "chair.angular"]
    with pytest.raises(ValueError, match="next-pose"):
        rows.action_names("next")


def test_odometry_is_relative_to_the_first_row():
    row = rows.state(
        [1, 2, 3, 4, 5, 6],
        [0.1] * 6,
        [0.3, 0.4],
        [0.5, 0.6, 0.7, 0, 0, 0, 1],
        yawed(2.0, 5.0, 2.5),
        yawed(2.0, 3.0, np.pi / 2),
    )
    assert row[:6].tolist() == [1, 2, 3, 4, 5, 6]
    assert row[12:17].tolist() == [0.3, 0.4, 0.5, 0.6, 0.7]
    assert row[17:23].tolist() == [1, 0, 0, 0, 1, 0]
    # Two metres in front of a chair that faced +y.
    turned = 2.5 - np.pi / 2
    assert np.allclose(row[23:], [2.0, 0.0, np.cos(turned), np.sin(turned)], atol=1e-12)


def test_six_numbers_represent_every_rotation():
    for _ in range(200):
        q = RNG.normal(size=4)
        q /= np.linalg.norm(q)
        six = rows.to_six(q)
        back = rows.from_six(six)
        assert abs(abs(back @ q) - 1.0) < 1e-12 and back[3] >= 0.0
        # The columns of a network's output are neither unit vectors nor orthogonal.
        rough = np.concatenate([six[:3] * 3.0, six[3:] + 0.2 * six[:3]])
        assert abs(abs(rows.from_six(rough) @ q) - 1.0) < 1e-12
    for bad in ([0.0] * 6, [1, 0, 0, 2, 0, 0], [np.nan, 0, 0, 0, 1, 0]):
        assert rows.from_six(bad) is None


def test_quaternions_from_rotation_vectors_rotate_by_their_length():
    half = rows.from_vector([0.0, 0.0, np.pi / 2])
    assert np.allclose(rows.multiply(half, half), [0, 0, 1, 0])
    assert np.allclose(rows.from_vector([1e-12, 0, 0]), [5e-13, 0, 0, 1])


def test_every_kind_of_row_is_one_command_until_the_next_image():
    pose = rows.Player("next-pose", robot(), 10.0).command(
        [0.1, 0.2, 0.3, 1, 0, 0, 0, 1, 0, 0.4, 0.5, 0.6]
    )
    assert pose.over_ticks == 6 and pose.device == v1.DEVICE_POLICY
    assert (pose.base.linear, pose.base.angular) == (0.5, 0.6)
    assert pose.arm.pose.pose.orientation.w == 1.0 and pose.arm.pose.pose.position.x == 0.1
    assert pose.gripper.knuckle == 0.4 and not pose.gripper.HasField("max_force")
    nine = [1, 2, 3, 4, 5, 6, 0.4, 0.5, 0.6]
    joints = rows.Player("next-joints", robot(), 10.0).command(nine)
    assert list(joints.arm.joints.positions) == nine[:6]
    wheels = rows.Player("applied", robot(), 10.0).command(nine)
    assert abs(wheels.base.linear - 0.09) < 1e-12 and abs(wheels.base.angular - 0.04) < 1e-12


def test_values_slightly_beyond_the_limits_are_clipped():
    player = rows.Player("next-joints", robot(), 10.0)

    def clip(*rest):
        command = player.command([0.0] * 6 + list(rest))
        return [command.gripper.knuckle, command.base.linear, command.base.angular]

    assert clip(-0.01, 1.1, -2.1) == [0.0, 1.0, -2.0]
    assert clip(0.81, -0.6, 2.1) == [0.8, -0.5, 2.0]
    assert clip(0.4, 0.3, 0.2) == [0.4, 0.3, 0.2]


def test_invalid_row_raises():
    player = rows.Player("next-pose", robot(), 10.0)
    row = np.zeros(12)
    with pytest.raises(ValueError, match="spans no plane"):
        player.command(row)
    for value, text in ((np.inf, "not finite"), (np.nan, "not finite"), (1e9, "100")):
        row[11] = value
        with pytest.raises(ValueError, match=text):
            player.command(row)
    with pytest.raises(ValueError, match="12"):
        player.command(row[:9])
    with pytest.raises(ValueError, match="divide"):
        rows.Player("next-pose", robot(), 7.0)
