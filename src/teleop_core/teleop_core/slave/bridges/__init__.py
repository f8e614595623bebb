"""Bridges: the message by which a real arm's controller takes commands, one file per kind.

A kind fills one ROS message from the joints that the arm is to hold, in the arm's own names, order and signs. Names,
checks, the start and every hold are the same for all (:mod:`teleop_core.slave.bridges.arm_bridge`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from teleop_core.base.registry import Registry, part_check, places
from teleop_core.kernels.geometry import Array

__all__ = ["BRIDGES", "Bridge", "Command", "register_bridge", "write_time"]


@dataclass(frozen=True, eq=False)
class Command:
    """What the arm is to do, as its controller counts.

    Attributes:
        names: The arm's joints, in the order of the command.
        position: Where they are to be, shape (n,) [rad or m].
        velocity: How fast they go there, shape (n,) [rad/s or m/s].
        period: Time until the next command [s].
        stamp_ns: Time [ns].
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
        name: What ``--set arm_bridge.kind=`` calls it.
        parameters: Its parameter group.
        message: ROS type of its commands, such as ``std_msgs/msg/Float64MultiArray``.
        command_topic: Where it takes them, if nothing else is said.
        state_topic: Where the arm says in a JointState where it is, if nothing else is said.
        write: ``write(message, command, parameters, make)`` fills an empty message with a
            :class:`Command`. ``make("trajectory_msgs/msg/JointTrajectoryPoint")`` makes an empty
            message of that type, for those that hold others.
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
"""All kinds by name."""

register_bridge = BRIDGES.register
"""Adds one of yours under its own name; see :meth:`Registry.register`."""
