"""Joint trajectories of one point, the commands of ``joint_trajectory_controller`` of ros2_control.

Each message replaces the previous trajectory. Its point is at least two periods ahead. So if one message is late, the
arm does not reach the end of its trajectory and stop.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from teleop_core.base.parameters import Within, parameter
from teleop_core.slave.bridges import Bridge, Command, write_time

_POINT = "trajectory_msgs/msg/JointTrajectoryPoint"


@dataclass(frozen=True, kw_only=True)
class JointTrajectoryParameters:
    """Parameters of trajectories of one point."""

    ahead: int = parameter(
        2,
        Within(2, 100, "periods"),
        "time_from_start of the trajectory's point; the arm lags behind the setpoint by this time",
        source="assumed",
    )
    velocity: str = parameter(
        "none",
        choices=("none", "zero", "setpoint"),
        doc="velocities of the trajectory's point: none, zeros, or those of the setpoint; a "
        "controller that also commands velocities needs them",
    )


def write_trajectory(
    message: Any, command: Command, parameters: JointTrajectoryParameters, make: Callable[[str], Any]
) -> None:
    """Fill a ``trajectory_msgs/JointTrajectory``; its stamp stays 0, which means at once."""
    point = make(_POINT)
    point.positions = command.position.tolist()
    if parameters.velocity != "none":
        share = 1.0 if parameters.velocity == "setpoint" else 0.0
        point.velocities = (share * command.velocity).tolist()
    write_time(point.time_from_start, round(parameters.ahead * command.period * 1e9))
    message.joint_names, message.points = list(command.names), [point]


JOINT_TRAJECTORY = Bridge(
    "joint_trajectory",
    JointTrajectoryParameters,
    "trajectory_msgs/msg/JointTrajectory",
    "/joint_trajectory_controller/joint_trajectory",
    "/joint_states",
    write_trajectory,
)
