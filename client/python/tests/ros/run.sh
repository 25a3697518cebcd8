#!/usr/bin/env bash
# Runs the tests of the ROS 2 node with the real rclpy of Kilted and Jazzy.
#   run.sh [PYTEST ARGUMENTS]
# The environments are .venv-ros-DISTRO in the checkout, or in the folder WHEELARM_ROS_ENVS.
# A distribution whose wheels cannot be installed is skipped with a message.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../../.." && pwd)
# Variables of another such environment would select its libraries.
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH AMENT_PREFIX_PATH PYTHONPATH
export PYTHONPATH=$root/client/python/src
status=0 ran=0
for distro in ${WHEELARM_ROS_DISTROS:-kilted jazzy}; do
    folder=${WHEELARM_ROS_ENVS:-$root}/.venv-ros-$distro
    "$here/setup.sh" "$distro" "$folder"
    case $? in
    0) ;;
    3)
        echo "############ SKIPPED: ROS 2 $distro ############" >&2
        continue
        ;;
    *) exit 1 ;;
    esac
    echo "ROS 2 $distro: rclpy $("$folder/bin/python" -c 'from importlib.metadata import version; print(version("ros-rclpy"))')"
    "$folder/bin/python" -m pytest -q -p no:cacheprovider "$here" "$@" || status=1
    ran=$((ran + 1))
done
[ "$ran" -gt 0 ] || echo "############ NOTHING WAS TESTED: the wheels of rclpy cannot be installed ############" >&2
exit $status
