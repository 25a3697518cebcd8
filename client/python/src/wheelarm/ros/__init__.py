"""A ROS 2 node for a WheelArm server: ``python -m wheelarm.ros``.

Sensors become standard topics, standard commands drive the robot, and the services of
``simulation_interfaces`` control time if that package is installed. ``rclpy`` is part of
ROS 2 (Humble or newer); it is not on PyPI under this name.

``mapping`` converts messages, ``tree`` computes the frames of a URDF, ``robot`` and
``entities`` store the scene, ``command`` merges the commands of the topics, ``controller``
requests control and sends commands, ``simulation`` controls time and episodes. Only
``outputs``, ``seed``, ``services`` and ``node`` import rclpy.
"""
