"""Middleware: all that nodes ask of ROS, of time and of threads, behind one interface.

``world`` says what there is to ask; ``ros`` answers with rclpy and the system's clock. A second world, in memory and in
simulated time, is that of ``teleop_drill.simulation``. No other room of this package imports rclpy.
"""
