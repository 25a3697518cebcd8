#!/usr/bin/env bash
# Creates a virtual environment with the real rclpy of a ROS 2 distribution from wheels on
# PyPI, and builds the two interface packages that they lack.
#   setup.sh kilted|jazzy FOLDER
# The wheels are by a third party. Exit code 3: they cannot be installed on this machine.
set -euo pipefail
distro=$1 folder=$2
here=$(cd "$(dirname "$0")" && pwd)

# The wheels exist for CPython 3.10 to 3.13 on x86-64 Linux.
find_python() {
    local one
    for one in python3.11 python3.12 python3.13 python3.10 python3; do
        if "$one" -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 14))' 2>/dev/null; then
            command -v "$one"
            return
        fi
    done
    echo "PATH has no Python 3.10 to 3.13: install one" >&2
    return 3
}

case $distro in
kilted) prefix=ros- extra=(ros-ament-cmake-ros-core) ;;
jazzy)
    prefix=ros-jazzy-
    extra=(ros-jazzy-ament-cmake-ros ros-jazzy-ament-cmake-gmock ros-jazzy-ament-cmake-gtest ros-jazzy-ament-cmake-pytest)
    ;;
*)
    echo "unknown distribution $distro; available: kilted, jazzy" >&2
    exit 2
    ;;
esac
packages=("${prefix}rclpy[fastrtps]")
for name in sensor-msgs nav-msgs trajectory-msgs rosgraph-msgs diagnostic-msgs std-srvs \
    rosidl-default-generators rosidl-core-generators ament-package python-cmake-module \
    fastrtps-cmake-module ament-cmake ament-cmake-core ament-cmake-python \
    ament-cmake-libraries ament-cmake-include-directories ament-cmake-target-dependencies \
    ament-cmake-test ament-cmake-version ament-cmake-gen-version-h; do
    packages+=("$prefix$name")
done

[ -x "$folder/bin/python" ] || "$(find_python)" -m venv "$folder"
# The mark avoids a second installation of the same packages.
mark="$folder/wheelarm-$distro.txt"
wanted="$(printf '%s\n' "${packages[@]}" "${extra[@]}")"
if [ "$(cat "$mark" 2>/dev/null)" != "$wanted" ]; then
    if ! "$folder/bin/pip" install --quiet --disable-pip-version-check \
        "${packages[@]}" "${extra[@]}" catkin_pkg 'setuptools<80' 'cmake<4' ninja \
        'eclipse-zenoh>=1.10,<1.11' protobuf numpy pytest; then
        echo "cannot install the wheels of rclpy for $distro: see the errors of pip above" >&2
        exit 3
    fi
    echo "$wanted" >"$mark"
fi
"$folder/bin/python" "$here/interfaces.py"
