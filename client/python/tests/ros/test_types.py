"""Types of every topic and service, by the hash that DDS compares."""

import json
import sys
from pathlib import Path

import pytest
from peer import until

SHARE = Path(sys.prefix) / "share"

# Printed by Jazzy and Kilted, which agree.
MESSAGES = {
    "sensor_msgs/msg/Image": "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    "sensor_msgs/msg/CameraInfo": "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "sensor_msgs/msg/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "geometry_msgs/msg/TwistStamped": "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    "geometry_msgs/msg/Pose": "d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa",
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/msg/TransformStamped": "0a241f87d04668d94099cbb5ba11691d5ad32c2f29682e4eb5653424bd275206",
    "geometry_msgs/msg/QuaternionStamped": "381add86c6c3160644d228ca342182c7fd6c7fab11c7a85ad817a9cc22dbac6e",
    "geometry_msgs/msg/Vector3Stamped": "d4829622288cbb443886e7ea94ea5671a3b1be6bab4ad04224432a65f7d7887a",
    "rosgraph_msgs/msg/Clock": "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
    "trajectory_msgs/msg/JointTrajectory": "179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "std_msgs/msg/Header": "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
# From the published package, version 2.1.0.
SIMULATION_INTERFACES = {
    "simulation_interfaces/msg/Bounds": "e8624fe51f0f5548197542697d924c5699ac7198f1e4c68e50c3ca2af73f5b3f",
    "simulation_interfaces/msg/EntityCategory": "43bdf7933fddf75f6970f7a8fe7078524355d821d390b3954bb46ac36c03dfe1",
    "simulation_interfaces/msg/EntityFilters": "8e7b12e8ea062f14c55de4877221fe1b7cd9749665a7ad8a4ab855fc4b148303",
    "simulation_interfaces/msg/EntityState": "2e0464a85eb80a939025075d6c20761eca6a4cb9d6baf2c0ba373467c8b598d0",
    "simulation_interfaces/msg/Result": "cf43a306adff3337a0a47143d8f5689933bc70a30478f13b077dc1fe3bc5ad17",
    "simulation_interfaces/msg/SimulationState": "bb9f87ccdd98fba113052a512d9801e84ce732d0a2b3c2b0cb281828de36e415",
    "simulation_interfaces/msg/SimulatorFeatures": "8b101c8529bc0ea3dcf056078254768f39832b9ef0adaf93bd5cea96c0de3305",
    "simulation_interfaces/msg/TagsFilter": "5c3efc51e8ed04c266c09cb4691ec95b964cd410558e01d8c83646b038826b45",
    "simulation_interfaces/srv/GetEntities": "cb90004c48cd50f37732fb008e22c34c261dd680a723bf0f85d8437ea4498bf7",
    "simulation_interfaces/srv/GetEntitiesStates": "0a76170d0c1c90e1eaf805cfab78ea801d1f82df309a28c1f0fae4b570f19754",
    "simulation_interfaces/srv/GetEntityState": "749c91f2a2353d98367b64f2995a0f5842ce92a08ec1ffb3e185540a91557fb5",
    "simulation_interfaces/srv/GetSimulationState": "3362dcebee4b1afebbf9c4beee5c79c1455385aded62092a892d61fde8644f30",
    "simulation_interfaces/srv/GetSimulatorFeatures": "abb9439c8cf196722a469fb6c68b44b484f198c2a1356ac38849a29c2a20a794",
    "simulation_interfaces/srv/ResetSimulation": "4ce285d7ff9b8ac70dcc95161f32bf54c05a6f4b13427990e41ab40c36c39646",
    "simulation_interfaces/srv/SetSimulationState": "a868b916dce49974f637ba252141258c4b07b0c06858b88af560e3eb6bfbcb30",
    "simulation_interfaces/srv/StepSimulation": "913fe0653690ce6bf8f09f316e6a626747012e9fca31e26719910d417aa8565c",
}


def test_hashes_equal_those_of_the_published_packages():
    found = {}
    for path in SHARE.glob("*/*/*.json"):
        described = json.loads(path.read_text())
        if "type_hashes" in described:
            found |= {one["type_name"]: one["hash_string"] for one in described["type_hashes"]}
    for name, digest in {**MESSAGES, **SIMULATION_INTERFACES}.items():
        assert found[name] == f"RIHS01_{digest}", name


TOPICS = {
    "/clock": "rosgraph_msgs/msg/Clock",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/imu/data": "sensor_msgs/msg/Imu",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/robot_description": "std_msgs/msg/String",
    "/camera/gen3/color/image_raw": "sensor_msgs/msg/Image",
    "/camera/gen3/color/camera_info": "sensor_msgs/msg/CameraInfo",
    "/camera/gen3/depth/image_raw": "sensor_msgs/msg/Image",
    "/camera/gen3/depth/camera_info": "sensor_msgs/msg/CameraInfo",
    "/camera/wheelchair/color/image_raw": "sensor_msgs/msg/Image",
    "/camera/wheelchair/depth/image_raw": "sensor_msgs/msg/Image",
}
INPUTS = {
    "/joint_command": "sensor_msgs/msg/JointState",
    "/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
    "/desired_pose": "geometry_msgs/msg/PoseStamped",
}
JOINTS = [
    *(f"{side}_wheel_joint" for side in ("back_left", "back_right", "front_left", "front_right")),
    *(f"joint_{number}" for number in range(1, 7)),
    "left_inner_knuckle_finger_tip_joint",
    "right_inner_knuckle_finger_tip_joint",
    "robotiq_85_left_finger_tip_joint",
    "robotiq_85_left_knuckle_joint",
    "robotiq_85_right_finger_tip_joint",
    "robotiq_85_right_knuckle_joint",
]
FRAMES = [
    "wheelchair",
    "shoulder",
    "bicep",
    "forearm",
    "spherical_wrist_1",
    "spherical_wrist_2",
    "end_effector",
]
#: Topics to which WheelArm-Sim's recorder subscribes.
SEED_TOPICS = {
    **{f"/processed_data/joint_state/{joint}": "sensor_msgs/msg/JointState" for joint in JOINTS},
    **{
        f"/processed_data/cartesian_pose/{frame}": "geometry_msgs/msg/PoseStamped"
        for frame in FRAMES
    },
    **{
        f"/processed_data/cartesian_velocity/{frame}": "geometry_msgs/msg/TwistStamped"
        for frame in FRAMES
    },
    "/processed_data/imu/orientation": "geometry_msgs/msg/QuaternionStamped",
    "/processed_data/imu/linear_acceleration": "geometry_msgs/msg/Vector3Stamped",
    "/processed_data/imu/angular_velocity": "geometry_msgs/msg/Vector3Stamped",
    **{
        f"/processed_data/cameras/{kind}/{camera}": "sensor_msgs/msg/Image"
        for kind in ("rgb", "depth")
        for camera in ("gen3", "wheelchair")
    },
    "/processed_data/timesteps": "rosgraph_msgs/msg/Clock",
    "/processed_data/desired_pose": "geometry_msgs/msg/Pose",
}


@pytest.mark.parametrize("stamped", [False, True])
def test_node_offers_every_topic_with_its_type(server, bridge, peer, stamped):
    endpoint = server("--camera", "*=64x36@10")
    arguments = ["--ros-args", "-p", f"cmd_vel_stamped:={str(stamped).lower()}"]
    bridge(endpoint, "--seed-topics", *arguments)
    assert len(SEED_TOPICS) == 39
    twist = "geometry_msgs/msg/TwistStamped" if stamped else "geometry_msgs/msg/Twist"

    def types_of(topic, list_endpoints):
        found = [one for one in list_endpoints(topic) if one.node_name == "wheelarm"]
        return [(one.topic_type, str(one.topic_type_hash)) for one in found]

    node = peer.node
    for expected, list_endpoints in (
        ({**TOPICS, **SEED_TOPICS}, node.get_publishers_info_by_topic),
        ({**INPUTS, "/cmd_vel": twist}, node.get_subscriptions_info_by_topic),
    ):
        for topic, kind in expected.items():
            found = until(lambda: types_of(topic, list_endpoints), f"the node lacks {topic}")
            assert found == [(kind, f"RIHS01_{MESSAGES[kind]}")], topic
