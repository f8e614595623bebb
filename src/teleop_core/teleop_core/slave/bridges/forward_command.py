"""Forward commands: the plain array that ``forward_command_controller`` of ros2_control takes.

The array has no names. Its order is that of the controller's parameter ``joints``, which
``arm_bridge.order`` must repeat where it differs from the robot's.
"""

from collections.abc import Callable
from typing import Any

from teleop_core.base.parameters import NoParameters
from teleop_core.slave.bridges import Bridge, Command


def write_array(message: Any, command: Command, _: object, make: Callable[[str], Any]) -> None:
    """Fill a ``std_msgs/Float64MultiArray``."""
    message.data = command.position.tolist()


FORWARD_COMMAND = Bridge(
    "forward_command",
    NoParameters,
    "std_msgs/msg/Float64MultiArray",
    "/forward_position_controller/commands",
    "/joint_states",
    write_array,
)
