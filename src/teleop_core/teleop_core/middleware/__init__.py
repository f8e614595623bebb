"""Middleware: one interface for everything that nodes use of ROS, time and threads.

``platform`` defines the interface; ``ros`` implements it with rclpy and the system's clock. A second implementation, in
memory and in simulated time, is in ``teleop_drill.simulation``. No other folder of this package imports rclpy.
"""
