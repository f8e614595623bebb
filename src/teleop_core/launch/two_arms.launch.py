"""Two masters and two slaves: ``ros2 launch teleop_core two_arms.launch.py``."""

from launch import LaunchDescription
from teleop_core.nodes.launching import TWO_ARMS, describe


def generate_launch_description() -> LaunchDescription:
    return describe(TWO_ARMS)
