"""Build of the package with colcon (ament_python)."""

from setuptools import setup

NAME = "wheelarm_ros2"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/wheelarm.launch.py"]),
        (f"share/{NAME}/config", ["config/wheelarm.yaml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    author="WheelArm",
    maintainer="WheelArm",
    maintainer_email="wheelarm@users.noreply.github.com",
    description="A ROS 2 node for a WheelArm server",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"node = {NAME}.node:main"]},
)
