"""Builds tf2_msgs for the rclpy of the virtual environment whose Python runs it.

Every installation of ROS 2 has this package; the wheels on PyPI that the tests
take have all others. Its one message is written here, the wheels' own generators
do the rest.

Usage: VENV/bin/python build_tf2_msgs.py
"""

import importlib.util
import os
import re
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

SOURCES = {
    "msg/TFMessage.msg": "geometry_msgs/TransformStamped[] transforms\n",
    "CMakeLists.txt": """cmake_minimum_required(VERSION 3.20)
project(tf2_msgs)
find_package(ament_cmake REQUIRED)
find_package(geometry_msgs REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(tf2_msgs msg/TFMessage.msg DEPENDENCIES geometry_msgs)
ament_package()
""",
    "package.xml": """<package format="3">
  <name>tf2_msgs</name>
  <version>0.0.1</version>
  <description>Made for tests</description>
  <maintainer email="tests@example.com">tests</maintainer>
  <license>BSD-3-Clause</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>geometry_msgs</depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>
""",
}


def relocate(prefix):
    """The wheels' CMake files name the Python that they were built with."""
    import numpy

    python = sysconfig.get_paths()
    for path in (prefix / "share").glob("*/cmake/*.cmake"):
        text = path.read_text()
        found = re.sub(r"/opt/python/[^/;\"]+/include/python[\d.]+", python["include"], text)
        found = re.sub(r"/opt/python/[^;\"]+/numpy/(?:_core|core)/include", numpy.get_include(), found)
        if found != text:
            path.write_text(found)


def main():
    if importlib.util.find_spec("tf2_msgs"):
        return
    prefix = Path(sys.prefix)
    relocate(prefix)
    places = {name: str(prefix) for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")}
    libraries = os.pathsep.join([str(prefix / "lib"), os.environ.get("LD_LIBRARY_PATH", "")])
    programs = os.pathsep.join([str(prefix / "bin"), os.environ["PATH"]])
    environment = {**os.environ, **places, "LD_LIBRARY_PATH": libraries, "PATH": programs}
    packages = os.path.relpath(sysconfig.get_paths()["purelib"], prefix)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in SOURCES.items():
            path = Path(folder, name)
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        for arguments in (
            ["-S", folder, "-B", f"{folder}/build", "-G", "Ninja", "-DBUILD_TESTING=OFF",
             f"-DCMAKE_INSTALL_PREFIX={prefix}", f"-DPython3_EXECUTABLE={sys.executable}",
             f"-DPYTHON_INSTALL_DIR={packages}"],
            ["--build", f"{folder}/build", "--target", "install"],
        ):
            done = subprocess.run(["cmake", *arguments], env=environment, text=True,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
            if done.returncode:
                sys.exit(f"tf2_msgs cannot be built: cmake {' '.join(arguments)}\n{done.stdout}")
    print(f"built tf2_msgs into {prefix}")


main()
