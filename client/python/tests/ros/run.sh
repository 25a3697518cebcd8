#!/usr/bin/env bash
# The tests of the ROS 2 node against the real rclpy of Kilted and Jazzy.
#   run.sh [PYTEST ARGUMENTS]
# Environments are kept in .venv-ros-DISTRO of the checkout, or where WHEELARM_ROS_ENVS
# says. A distribution whose wheels cannot be had is skipped, loudly.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../../.." && pwd)
# Of another such environment: it would take the libraries of that one.
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
[ "$ran" -gt 0 ] || echo "############ NOTHING WAS TESTED: no wheels of rclpy ############" >&2
exit $status
