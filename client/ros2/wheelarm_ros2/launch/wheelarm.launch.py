"""Starts the node for a WheelArm server.

    ros2 launch wheelarm_ros2 wheelarm.launch.py endpoint:=tcp/127.0.0.1:7447

An argument overrides the parameter of that name in `params_file`;
`ros2 launch wheelarm_ros2 wheelarm.launch.py --show-args` lists all arguments.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# Parameter: its meaning; its type is that of the default in config/wheelarm.yaml.
TEXTS = {
    "endpoint": "endpoint of the server, in Zenoh's notation",
    "sim": "name of the server",
    "commander": "name of this commander",
    "depth_encoding": "32FC1 (metres) or 16UC1 (millimetres)",
    "mesh_folder": "URI prefix of the mesh paths in /robot_description",
}
SWITCHES = {
    "take": "take control over from the client that holds it",
    "seed_topics": "publish the 39 topics of WheelArm-Sim's recorder too",
    "cmd_vel_stamped": "cmd_vel is a TwistStamped",
    "publish_tf": "publish /tf and /tf_static",
    "odom_frame": "the chair is below odom (REP 105); off: below house",
}
NUMBERS = {
    "cmd_vel_timeout": "seconds without cmd_vel after which the chair stops",
    "lease_timeout": "seconds without a command after which control is released; 0 keeps it",
    "play_rate": "simulated seconds per second in lock-step; 0 for unlimited",
}


def parse_switch(name: str, text: str) -> bool:
    """Parses `true` or `false` in any case."""
    if text.lower() not in ("true", "false"):
        raise ValueError(f"invalid {name}:={text}: give true or false")
    return text.lower() == "true"


def parse_number(name: str, text: str) -> float:
    """Parses the number of the argument `name`."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"invalid {name}:={text}: give a number") from None


def make_node(context):
    """The node with the given arguments; the file has the other parameters."""
    given = {}
    kinds = [(TEXTS, lambda _, text: text), (SWITCHES, parse_switch), (NUMBERS, parse_number)]
    for names, parse in kinds:
        for name in names:
            text = LaunchConfiguration(name).perform(context)
            if text:
                given[name] = parse(name, text)
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
    """The entry point of `ros2 launch`."""
    share = FindPackageShare("wheelarm_ros2")
    defaults = PathJoinSubstitution([share, "config", "wheelarm.yaml"])
    arguments = [
        DeclareLaunchArgument("namespace", default_value="", description="namespace of node and topics"),
        DeclareLaunchArgument(
            "params_file", default_value=defaults, description="file of parameters"
        ),
    ]
    for name, text in {**TEXTS, **SWITCHES, **NUMBERS}.items():
        arguments.append(DeclareLaunchArgument(name, default_value="", description=text))
    return LaunchDescription([*arguments, OpaqueFunction(function=make_node)])
