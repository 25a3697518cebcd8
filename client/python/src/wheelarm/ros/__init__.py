"""A ROS 2 node that speaks for a WheelArm server: ``python -m wheelarm.ros``.

Sensors become standard topics, standard commands drive the robot, and the
services of ``simulation_interfaces`` steer time where that package is installed.
``rclpy`` comes with ROS 2 (Humble or newer); it is not on PyPI under this name.

``mapping`` turns messages into messages, ``tree`` places the frames of a URDF,
``robot``, ``entities`` and ``command`` hold what is known and what is wished,
``pilot`` takes control and sends commands, ``simulation`` steers time and
episodes; ``outputs``, ``seed``, ``services`` and ``node`` alone know rclpy.
"""
