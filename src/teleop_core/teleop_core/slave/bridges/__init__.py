"""Bridges: the ROS messages that controllers of real arms take as commands, one file per kind of controller.

Each kind fills one ROS message from the commanded joints, in the arm's own names, order and signs. All kinds share the
mapping of names, the checks, the start, and the rules when the arm must stop
(:mod:`teleop_core.slave.bridges.arm_bridge`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from teleop_core.base.registry import Registry, part_check, places
from teleop_core.kernels.geometry import Array

__all__ = ["BRIDGES", "Bridge", "Command", "register_bridge", "write_time"]


@dataclass(frozen=True, eq=False)
class Command:
    """One command to a real arm, in the signs and offsets of its controller.

    Attributes:
        names: The arm's joints, in the order of the command.
        position: Commanded joint positions, shape (n,) [rad or m].
        velocity: Joint velocities of the commanded motion, shape (n,) [rad/s or m/s].
        period: Time until the next command [s].
        stamp_ns: Time of the command [ns].
    """

    names: tuple[str, ...]
    position: Array
    velocity: Array
    period: float
    stamp_ns: int


@dataclass(frozen=True)
class Bridge:
    """A kind of controller.

    Attributes:
        name: Name of the kind in ``--set arm_bridge.kind=``.
        parameters: Parameter group of the kind.
        message: ROS type of the commands, such as ``std_msgs/msg/Float64MultiArray``.
        command_topic: Default topic of the commands.
        state_topic: Default topic of the arm's measured joints, a JointState.
        write: ``write(message, command, parameters, make)`` fills an empty message with a :class:`Command`.
            ``make("trajectory_msgs/msg/JointTrajectoryPoint")`` makes an empty message of that type, for messages that
            contain other messages.
    """

    name: str
    parameters: type
    message: str
    command_topic: str
    state_topic: str
    write: Callable[[Any, Command, Any, Callable[[str], Any]], None]


def write_time(message: Any, time_ns: int) -> None:
    """Fill a message ``Time`` or ``Duration`` with a time [ns]."""
    message.sec, message.nanosec = divmod(time_ns, 1_000_000_000)


BRIDGES: Registry[Bridge] = Registry(
    "bridge",
    "bridges",
    places("teleop_core.slave.bridges", "joint_state forward_command joint_trajectory crtk"),
    part_check("bridge", Bridge, "write"),
)
"""All kinds of bridge by name."""

register_bridge = BRIDGES.register
"""Adds your bridge under its own name; see :meth:`Registry.register`."""
