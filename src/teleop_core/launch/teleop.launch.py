"""A whole session on a full ROS 2 installation: ``ros2 launch teleop_core teleop.launch.py``."""

from launch import LaunchDescription
from teleop_core.nodes.launching import ONE_ARM, describe


def generate_launch_description() -> LaunchDescription:
    return describe(ONE_ARM)
