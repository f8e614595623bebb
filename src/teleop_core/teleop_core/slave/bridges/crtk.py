"""CRTK arms, such as those of the dVRK: ``servo_jp`` out, ``measured_js`` in.

The bridge does not change the arm's operating state: power and home the arm in its own console first.
"""

from collections.abc import Callable
from typing import Any

from teleop_core.base.parameters import NoParameters
from teleop_core.slave.bridges import Bridge, Command, write_time


def write_servo_jp(message: Any, command: Command, _: object, make: Callable[[str], Any]) -> None:
    """Fill a ``sensor_msgs/JointState`` with positions alone."""
    write_time(message.header.stamp, command.stamp_ns)
    message.name, message.position = list(command.names), command.position.tolist()


CRTK = Bridge("crtk", NoParameters, "sensor_msgs/msg/JointState", "/PSM1/servo_jp", "/PSM1/measured_js", write_servo_jp)
