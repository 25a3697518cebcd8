"""The ROS 2 package of WheelArm: `ros2 launch wheelarm_ros2 wheelarm.launch.py`."""
