"""``python -m wheelarm.ros``: the node as a program."""

from __future__ import annotations

import argparse
import dataclasses
import sys


def arguments(words: list[str]) -> argparse.Namespace:
    """Arguments of the program, without those after ``--ros-args``."""
    parser = argparse.ArgumentParser(
        prog="python -m wheelarm.ros",
        description="A ROS 2 node for a WheelArm server.",
        epilog="Every option is also a parameter of the node, and remappings work: "
        "--ros-args -p cmd_vel_stamped:=true -r cmd_vel:=/teleop/cmd_vel",
    )
    parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="endpoint of the server")
    parser.add_argument("--sim", default="sim", help="name of the server")
    parser.add_argument("--commander", default="ros", help="name of this commander")
    parser.add_argument(
        "--take", action="store_true", help="take control over from the client that holds it"
    )
    parser.add_argument(
        "--seed-topics",
        action="store_true",
        help="also publish the 39 topics of WheelArm-Sim's recorder",
    )
    return parser.parse_args(words)


def main(words: list[str] | None = None) -> int:
    """Runs until it is interrupted; returns 1 when the start fails."""
    try:
        import rclpy
        from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
        from rclpy.utilities import remove_ros_args
    except ImportError as error:
        print(
            f"cannot import rclpy: {error}; this node needs the Python of a ROS 2 installation "
            "(Humble or newer): source its setup file first, for example "
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
            f"connected to {node.options.sim!r} at {node.options.endpoint}: "
            f"{node.robot.name}, cameras {', '.join(node.cameras) or 'none'}"
        )
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (WheelArmError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    finally:
        if node is not None:
            node.close()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
