"""Builds the two interface packages that the wheels of rclpy on PyPI lack.

Every ROS 2 installation has ``tf2_msgs`` and offers ``simulation_interfaces``. The tests run
on wheels without them, so this program writes the fields that the node uses, and builds the
packages into the virtual environment of the Python that runs it. ``test_types.py`` compares
the hash of each type with that of the published package.

Use: VENV/bin/python interfaces.py [PACKAGE...]     default: all packages
"""

import os
import re
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

RESULT = "Result result"
FILTERS = "EntityFilters filters"

# Package -> (dependencies, file -> lines).
PACKAGES = {
    "tf2_msgs": (
        ["geometry_msgs"],
        {"msg/TFMessage.msg": ["geometry_msgs/TransformStamped[] transforms"]},
    ),
    "simulation_interfaces": (
        ["builtin_interfaces", "std_msgs", "geometry_msgs"],
        {
            "msg/Result.msg": [
                *(
                    f"uint8 RESULT_{name}={value}"
                    for value, name in enumerate(
                        [
                            "FEATURE_UNSUPPORTED",
                            "OK",
                            "NOT_FOUND",
                            "INCORRECT_STATE",
                            "OPERATION_FAILED",
                        ]
                    )
                ),
                "uint8 result",
                "string error_message",
            ],
            "msg/SimulationState.msg": [
                *(
                    f"uint8 STATE_{name}={value}"
                    for value, name in enumerate(
                        ["STOPPED", "PLAYING", "PAUSED", "QUITTING", "NO_WORLD", "LOADING_WORLD"]
                    )
                ),
                "uint8 state",
            ],
            "msg/SimulatorFeatures.msg": [
                *(
                    f"uint8 {name}={value}"
                    for name, value in {
                        "ENTITY_TAGS": 4,
                        "ENTITY_BOUNDS_BOX": 6,
                        "ENTITY_BOUNDS_CONVEX": 7,
                        "ENTITY_CATEGORIES": 8,
                        "ENTITY_STATE_GETTING": 10,
                        "SIMULATION_RESET": 20,
                        "SIMULATION_RESET_TIME": 21,
                        "SIMULATION_RESET_STATE": 22,
                        "SIMULATION_STATE_GETTING": 24,
                        "SIMULATION_STATE_SETTING": 25,
                        "SIMULATION_STATE_PAUSE": 26,
                        "STEP_SIMULATION_SINGLE": 31,
                        "STEP_SIMULATION_MULTIPLE": 32,
                    }.items()
                ),
                "uint16[] features",
                "string[] spawn_formats",
                "string custom_info",
            ],
            "msg/EntityCategory.msg": [
                *(
                    f"uint8 CATEGORY_{name}={value}"
                    for name, value in {
                        "OBJECT": 0,
                        "ROBOT": 1,
                        "HUMAN": 2,
                        "DYNAMIC_OBJECT": 4,
                        "STATIC_OBJECT": 5,
                    }.items()
                ),
                "uint8 category",
            ],
            "msg/TagsFilter.msg": [
                "uint8 FILTER_MODE_ANY=0",
                "uint8 FILTER_MODE_ALL=1",
                "string[] tags",
                "uint8 filter_mode",
            ],
            "msg/Bounds.msg": [
                "uint8 TYPE_EMPTY=0",
                "uint8 TYPE_BOX=1",
                "uint8 TYPE_CONVEX_HULL=2",
                "uint8 TYPE_SPHERE=3",
                "uint8 type",
                "geometry_msgs/Vector3[] points",
            ],
            "msg/EntityFilters.msg": [
                "string filter",
                "EntityCategory[] categories",
                "TagsFilter tags",
                "Bounds bounds",
            ],
            "msg/EntityState.msg": [
                "std_msgs/Header header",
                "geometry_msgs/Pose pose",
                "geometry_msgs/Twist twist",
                "geometry_msgs/Accel acceleration",
            ],
            "srv/GetSimulatorFeatures.srv": ["---", "SimulatorFeatures features"],
            "srv/GetSimulationState.srv": ["---", "SimulationState state", RESULT],
            "srv/SetSimulationState.srv": [
                "SimulationState state",
                "---",
                "uint8 ALREADY_IN_TARGET_STATE=101",
                "uint8 STATE_TRANSITION_ERROR=102",
                "uint8 INCORRECT_TRANSITION=103",
                RESULT,
            ],
            "srv/ResetSimulation.srv": [
                "uint8 SCOPE_DEFAULT=0",
                "uint8 SCOPE_TIME=1",
                "uint8 SCOPE_STATE=2",
                "uint8 SCOPE_SPAWNED=4",
                "uint8 SCOPE_ALL=255",
                "uint8 scope",
                "---",
                RESULT,
            ],
            "srv/StepSimulation.srv": ["uint64 steps 1", "---", RESULT],
            "srv/GetEntities.srv": [FILTERS, "---", RESULT, "string[] entities"],
            "srv/GetEntityState.srv": ["string entity", "---", RESULT, "EntityState state"],
            "srv/GetEntitiesStates.srv": [
                FILTERS,
                "---",
                RESULT,
                "string[] entities",
                "EntityState[] states",
            ],
        },
    ),
}


def write(folder: Path, package: str) -> None:
    """Writes the sources of ``package`` into ``folder``."""
    needs, files = PACKAGES[package]
    for name, lines in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n")
    found = "\n".join(f"find_package({need} REQUIRED)" for need in needs)
    names = "\n  ".join(f'"{name}"' for name in files)
    (folder / "CMakeLists.txt").write_text(
        f"""cmake_minimum_required(VERSION 3.12)
project({package})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{found}
rosidl_generate_interfaces(${{PROJECT_NAME}}
  {names}
  DEPENDENCIES {" ".join(needs)})
ament_package()
"""
    )
    depends = "\n".join(f"  <depend>{need}</depend>" for need in needs)
    (folder / "package.xml").write_text(
        f"""<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>0.0.0</version>
  <description>Fields of {package}, for tests.</description>
  <maintainer email="tests@example.com">tests</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""
    )


def rewrite_paths(prefix: Path) -> None:
    """Replaces the paths of the machine that built the wheels with those of this machine."""
    import numpy

    here = {
        r"/[\w./-]*/cp\d+-cp\d+/include/python3\.\d+": sysconfig.get_paths()["include"],
        r"/[\w./-]*/cp\d+-cp\d+/lib/python3\.\d+/site-packages/numpy/_?core/include": numpy.get_include(),
        r"/[\w./-]*/cp\d+-cp\d+": sys.base_prefix,
    }
    for path in (prefix / "share").glob("*/cmake/*.cmake"):
        text = rewritten = path.read_text()
        for pattern, replacement in here.items():
            rewritten = re.sub(pattern, replacement, rewritten)
        if rewritten != text:
            path.write_text(rewritten)


def build(prefix: Path, package: str) -> None:
    """Builds and installs ``package`` into ``prefix``."""
    env = {
        **os.environ,
        "AMENT_PREFIX_PATH": str(prefix),
        "CMAKE_PREFIX_PATH": str(prefix),
        "LD_LIBRARY_PATH": str(prefix / "lib"),
        "PATH": f"{prefix / 'bin'}:{os.environ['PATH']}",
    }
    with tempfile.TemporaryDirectory() as folder:
        source, output = Path(folder, "source"), Path(folder, "build")
        source.mkdir()
        write(source, package)
        configure = [
            f"-DCMAKE_INSTALL_PREFIX={prefix}",
            f"-DPython3_EXECUTABLE={sys.executable}",
            f"-DPYTHON_INSTALL_DIR={os.path.relpath(sysconfig.get_paths()['purelib'], prefix)}",
            "-DBUILD_TESTING=OFF",
            "-GNinja",
        ]
        for command in (
            ["cmake", *configure, "-S", source, "-B", output],
            ["cmake", "--build", output, "--target", "install"],
        ):
            done = subprocess.run(command, env=env, capture_output=True, text=True)
            if done.returncode:
                sys.exit(f"{package}: {' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}")


def main() -> None:
    prefix = Path(sys.prefix)
    wanted = sys.argv[1:] or list(PACKAGES)
    unknown = set(wanted) - set(PACKAGES)
    if unknown:
        sys.exit(f"unknown package {', '.join(sorted(unknown))}; available: {', '.join(PACKAGES)}")
    rewrite_paths(prefix)
    for package in wanted:
        mark = prefix / "share" / package / "package.xml"
        source = prefix / "share" / package / "written_by_tests.txt"
        text = repr(PACKAGES[package])
        if mark.exists() and source.exists() and source.read_text() == text:
            continue
        build(prefix, package)
        source.write_text(text)
        print(f"built {package} into {prefix}")


if __name__ == "__main__":
    main()
