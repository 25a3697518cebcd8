"""`ros2 run wheelarm_ros2 node`: the node of the Python package `wheelarm`."""

import sys


def main() -> int:
    """Runs until it is interrupted; returns 1 when the start fails."""
    try:
        from wheelarm.ros.__main__ import main as run
    except ImportError as error:
        print(
            f"cannot import the Python package wheelarm: {error}; install its wheel "
            f"for {sys.executable}, for example "
            "`pip install --break-system-packages wheelarm-*-py3-none-any.whl`",
            file=sys.stderr,
        )
        return 1
    return run()


if __name__ == "__main__":
    sys.exit(main())
