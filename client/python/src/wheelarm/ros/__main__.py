"""``python -m wheelarm.ros``: the node as a program."""

from __future__ import annotations

import argparse
import dataclasses
import sys


def arguments(words: list[str]) -> argparse.Namespace:
    """The program's own arguments; those behind ``--ros-args`` are not among them."""
    parser = argparse.ArgumentParser(
        prog="python -m wheelarm.ros",
        description="Speaks for a WheelArm server in ROS 2.",
        epilog="Every option is a parameter of the node as well, and remappings work as "
        "usual: --ros-args -p cmd_vel_stamped:=true -r cmd_vel:=/teleop/cmd_vel",
    )
    parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="endpoint of the server")
    parser.add_argument("--sim", default="sim", help="name of the server")
    parser.add_argument("--commander", default="ros", help="name under which it commands")
    parser.add_argument(
        "--take", action="store_true", help="take control over from whoever holds it"
    )
    parser.add_argument(
        "--seed-topics",
        action="store_true",
        help="also publish the 39 topics of WheelArm-Sim's recorder",
    )
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> int:
    """Runs until it is interrupted; 1 when it could not begin."""
    try:
        import rclpy
        from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
        from rclpy.utilities import remove_ros_args
    except ImportError as problem:
        print(
            f"rclpy cannot be imported ({problem}): this node runs with the Python of a ROS 2 "
            "installation (Humble or newer); source its setup file first, for example "
            "`source /opt/ros/jazzy/setup.bash`",
            file=sys.stderr,
        )
        return 1
    words = sys.argv if words is None else ["wheelarm.ros", *words]
    chosen = arguments(remove_ros_args(words)[1:])
    from ..errors import WheelArmError
    from .node import Options, WheelArmNode

    rclpy.init(args=words)
    node = None
    try:
        node = WheelArmNode(dataclasses.replace(Options(), **vars(chosen)))
        executor = MultiThreadedExecutor(num_threads=4)
        executor.add_node(node)
        node.get_logger().info(
            f"speaks for {node.options.sim!r} at {node.options.endpoint}: "
            f"{node.robot.name}, cameras {', '.join(node.cameras) or 'none'}"
        )
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (WheelArmError, ValueError) as problem:
        print(problem, file=sys.stderr)
        return 1
    finally:
        if node is not None:
            node.close()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
