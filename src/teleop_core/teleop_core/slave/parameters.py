"""Parameters of the arm's server."""

import math
from dataclasses import dataclass, field

import numpy as np

from teleop_core.base import ParameterError, Within, fixed, parameter
from teleop_core.kernels import Array
from teleop_core.robots.robot import Robot
from teleop_core.robots.selection import RobotParameters
from teleop_core.slave.interpolation import INTERPOLATIONS
from teleop_core.slave.operation import OperationParameters

_FILTER_SOURCE = "published: Vongbunyong 2008, eq. 6.2.8"


@dataclass(frozen=True, kw_only=True)
class ReferenceFilterParameters:
    """First-order lag on every joint reference; at rest its output is its input."""

    is_on: bool = parameter(True, doc="whether joint references pass through the reference filter")
    gain: float = parameter(
        0.1, Within(0.0, 1.0), "gain of the reference filter at high frequencies", source=_FILTER_SOURCE
    )
    zero: float = parameter(100.0, Within(0.0, 1000.0, "rad/s"), "zero of the reference filter", source=_FILTER_SOURCE)
    pole: float = parameter(10.0, Within(0.01, 1000.0, "rad/s"), "pole of the reference filter", source=_FILTER_SOURCE)

    def __post_init__(self) -> None:
        if not math.isclose(self.gain * self.zero, self.pole, rel_tol=1e-9):
            needed = f"one for which gain ({self.gain}) * zero = pole ({self.pole})"
            raise ParameterError("reference_filter.zero", self.zero, needed)


@dataclass(frozen=True, kw_only=True)
class SlaveParameters(RobotParameters):
    """Parameters of :class:`~teleop_core.slave.slave.Slave`."""

    command_timeout: float = parameter(
        0.1, Within(0.002, 5.0, "s"), "if no command arrives for this time, the slave holds the last reference"
    )
    start: tuple[float, ...] = fixed(
        (),
        Within(unit="rad or m"),
        "joint positions to which the slave moves from home before it follows; empty: the robot's start",
    )
    starts_at_home: bool = fixed(
        False,
        doc="whether the slave stays at home before it follows, if start is empty; no effect for a "
        "robot from a URDF, which states no home",
    )
    start_speed: float = fixed(
        0.5, Within(0.01, 1.0), "share of the joints' speed limits that the move from home to the start uses"
    )
    interpolation: str = parameter(
        "linear",
        choices=INTERPOLATIONS,
        doc="interpolation between commands that arrive less often than once a tick; it delays the "
        "motion by one period of the commands",
    )
    reference_filter: ReferenceFilterParameters = field(default_factory=ReferenceFilterParameters)
    operation: OperationParameters = field(default_factory=OperationParameters)

    def start_of(self, robot: Robot) -> Array:
        """Start joints (n,), from which a robot follows commands [rad or m]."""
        if self.start:
            return np.array(self.start, dtype=np.float64)
        is_home = self.starts_at_home and not robot.home_is_assumed
        return robot.home.copy() if is_home else robot.start.copy()
