"""Starts the node beside a WheelArm server.

    ros2 launch wheelarm_ros2 wheelarm.launch.py endpoint:=tcp/127.0.0.1:7447

An argument that is given goes before the parameter of that name in `params_file`;
`ros2 launch wheelarm_ros2 wheelarm.launch.py --show-args` lists them.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# Parameter: what it is; its type is that of the default in config/wheelarm.yaml.
TEXTS = {
    "endpoint": "endpoint of the server, as Zenoh writes it",
    "sim": "name of the server",
    "commander": "name under which it commands",
    "depth_encoding": "32FC1 (metres) or 16UC1 (millimetres)",
    "mesh_folder": "URI before the paths of meshes in /robot_description",
}
SWITCHES = {
    "take": "take control over from whoever holds it",
    "seed_topics": "also the 39 topics of WheelArm-Sim's recorder",
    "cmd_vel_stamped": "cmd_vel is a TwistStamped",
    "publish_tf": "publish /tf and /tf_static",
    "odom_frame": "the chair hangs below odom (REP 105); off: below house",
}
NUMBERS = {
    "cmd_vel_timeout": "seconds of silence after which the chair stops",
    "lease_timeout": "seconds without a command after which control is given back; 0 keeps it",
    "play_rate": "simulated seconds per second in lock-step; 0 is no limit",
}


def switch(name: str, text: str) -> bool:
    """`true` or `false`, as ROS writes them."""
    if text.lower() not in ("true", "false"):
        raise ValueError(f"{name}:={text} is neither true nor false")
    return text.lower() == "true"


def number(name: str, text: str) -> float:
    """A number of `name`."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name}:={text} is no number") from None


def node(context):
    """The node with what was given; what was not is left to the file."""
    given = {}
    kinds = [(TEXTS, lambda _, text: text), (SWITCHES, switch), (NUMBERS, number)]
    for names, read in kinds:
        for name in names:
            text = LaunchConfiguration(name).perform(context)
            if text:
                given[name] = read(name, text)
    return [
        Node(
            package="wheelarm_ros2",
            executable="node",
            name="wheelarm",
            namespace=LaunchConfiguration("namespace"),
            parameters=[LaunchConfiguration("params_file"), *([given] if given else [])],
            output="screen",
            emulate_tty=True,
        )
    ]


def generate_launch_description():
    """What `ros2 launch` asks for."""
    share = FindPackageShare("wheelarm_ros2")
    defaults = PathJoinSubstitution([share, "config", "wheelarm.yaml"])
    arguments = [
        DeclareLaunchArgument("namespace", default_value="", description="of node and topics"),
        DeclareLaunchArgument(
            "params_file", default_value=defaults, description="file of parameters"
        ),
    ]
    for name, words in {**TEXTS, **SWITCHES, **NUMBERS}.items():
        arguments.append(DeclareLaunchArgument(name, default_value="", description=words))
    return LaunchDescription([*arguments, OpaqueFunction(function=node)])
