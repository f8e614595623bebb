"""Joint states as commands and as measurements, for simulator bridges and topic-based hardware interfaces.

``joint_state_topic_hardware_interface`` of ros2_control does not pass on steps smaller than its
``trigger_joint_command_threshold``, 1e-5 by default: set it to -1. Our default topics are those of that interface.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from teleop_core.base.parameters import parameter
from teleop_core.slave.bridges import Bridge, Command, write_time


@dataclass(frozen=True, kw_only=True)
class JointStateParameters:
    """Parameters of commands as joint states."""

    has_velocity: bool = parameter(False, doc="whether commands contain velocities too")


def write_joint_state(
    message: Any, command: Command, parameters: JointStateParameters, _: Callable[[str], Any]
) -> None:
    """Fill a ``sensor_msgs/JointState``."""
    write_time(message.header.stamp, command.stamp_ns)
    message.name, message.position = list(command.names), command.position.tolist()
    if parameters.has_velocity:
        message.velocity = command.velocity.tolist()


JOINT_STATE = Bridge(
    "joint_state",
    JointStateParameters,
    "sensor_msgs/msg/JointState",
    "/robot_joint_command",
    "/robot_joint_states",
    write_joint_state,
)
