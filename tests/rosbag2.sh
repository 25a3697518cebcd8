#!/usr/bin/env bash
# Records short episodes, exports them as bags, decodes every message with third-party readers
# (rclpy of ROS 2 Jazzy and of Kilted, rosbags, mcap-ros2-support), and compares the messages
# with the recordings.
#   WHEELARM_ROS   folder of the virtual environments, default .venv-ros
#   WHEELARM_BAGS  folder for recordings and bags, which are kept; default a temporary one
# The wheels of rclpy are one person's work (ros-python-wheels). When the index no longer has
# them, this prints a warning and continues with the other readers.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
venvs=${WHEELARM_ROS:-$root/.venv-ros}
built=${CARGO_TARGET_DIR:-$root/target}/release
export PIP_NO_CACHE_DIR=1
# The wheels are made for Python 3.10 to 3.13 on x86-64.
python=
for candidate in python3.11 python3.12 python3.13 python3.10 "$HOME"/.pyenv/versions/3.1[0-3]*/bin/python3; do
    "$candidate" -c 'import venv, ensurepip' 2>/dev/null && python=$candidate && break
done
[ -n "$python" ] || { echo "the wheels of rclpy need Python 3.10 to 3.13 with venv: apt-get install -y python3-venv" >&2; exit 1; }

pip() { # environment, packages
    local venv=$venvs/$1
    shift
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$@"
}

# Packages that tf2_msgs is built with; Jazzy's wheels have another name where they differ from
# those of the other distributions.
shared=(catkin_pkg 'setuptools<80' 'cmake<4' ninja mcap h5py ros-rmw-implementation-cmake)
for name in definitions dependencies include-directories interfaces libraries link-flags targets; do
    shared+=("ros-ament-cmake-export-$name")
done
own() { # prefix, packages that only this distribution needs
    local name prefix=$1
    shift
    for name in "$@" "rclpy[fastrtps]" sensor-msgs nav-msgs rosgraph-msgs ament-package ament-cmake \
        ament-cmake-core ament-cmake-gen-version-h ament-cmake-include-directories \
        ament-cmake-libraries ament-cmake-python ament-cmake-target-dependencies \
        ament-cmake-test ament-cmake-version rosidl-core-generators \
        rosidl-default-generators python-cmake-module fastrtps-cmake-module; do
        echo "$prefix-$name"
    done
}

distributions=()
for distribution in jazzy kilted; do
    venv=$venvs/$distribution
    case $distribution in
    jazzy) wheels=(ros-jazzy ament-cmake-ros ament-cmake-gtest ament-cmake-gmock ament-cmake-pytest) ;;
    *) wheels=(ros ament-cmake-ros-core) ;;
    esac
    if ! "$venv/bin/python" -c 'import rclpy, tf2_msgs.msg, mcap, h5py' 2>/dev/null; then
        mapfile -t packages < <(own "${wheels[@]}")
        [ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
        if ! pip $distribution "${shared[@]}" "${packages[@]}"; then
            echo "!!!!!!!! no rclpy of $distribution from this index: its readers are NOT run !!!!!!!!" >&2
            continue
        fi
        "$venv/bin/python" client/python/tests/ros/interfaces.py tf2_msgs
    fi
    distributions+=("$distribution")
done
readers=$venvs/readers
[ -x "$readers/bin/python" ] || "$python" -m venv "$readers"
"$readers/bin/python" -c 'import h5py, rosbags.rosbag2, mcap_ros2' 2>/dev/null ||
    pip readers h5py rosbags==0.11.9 mcap-ros2-support==0.6.0

folder=${WHEELARM_BAGS:-$(mktemp -d)}
[ -n "${WHEELARM_BAGS:-}" ] || trap 'rm -rf "$folder"' EXIT
export PATH=$built:$PATH WHEELARM_ASSETS=$root/assets
mkdir -p "$folder"
cd "$folder"
if [ ! -e recordings ]; then
    # Sensors, a deformable object and disturbances, so that every kind of message occurs.
    wheelarm demo --seed 0 --width 160 --height 90 --no-sheet --out recordings \
        --sensor kinova_vision@gen3 --sensor chair_stereo@wheelchair --sensor encoders \
        --sensor odometry --sensor imu >/dev/null
    wheelarm demo --task place_teddy_bear --seed 0 --width 96 --height 54 --no-sheet --out recordings >/dev/null
    wheelarm evaluate --task pick_mustard --seeds 1..2 --disturb 2 --record --camera gen3=64x36@5 --out hindered >/dev/null
    mv hindered/*.h5 recordings
fi
rm -rf bags
wheelarm-dataset export --format rosbag2 recordings --out bags
check=$root/tests/python/check_rosbag2.py
for distribution in "${distributions[@]}"; do
    # Its environment restarts itself with variables that no other reader may get.
    "$venvs/$distribution/bin/python" "$check" rclpy bags recordings/*.h5
done
for reader in rosbags mcap-ros2; do
    "$readers/bin/python" "$check" $reader bags recordings/*.h5
done
