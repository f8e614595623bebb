"""Controllers: from setpoint and measurement to drive effort, one file per law.

A controller works on all joints of an arm at once, tick by tick. Its gains are a table with a row
per joint, which the parameters and the robot's drives give; its memory is another. Gravity that the
source compensates, limits of the drives and encoders belong to the slave, not to the law.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import types

from teleop_core.errors import ParameterError, PartError
from teleop_core.geometry import Array
from teleop_core.kernels import pointer
from teleop_core.registry import Registry
from teleop_core.robots.robot import Robot

__all__ = ["CONTROLLERS", "Controller", "per_joint", "register_controller"]

_ROW, _TABLE = types.float64[::1], types.float64[:, ::1]
CONTROL = types.void(_TABLE, _TABLE, _ROW, _ROW, _ROW, _ROW, types.float64, _ROW)
"""Signature of a control kernel, so that one compiled slave serves every law."""


def _nothing(memory: Array, measured: Array, effort: Array) -> None:
    """Keep the memory as it is."""


def _no_shift(memory: Array, effort: Array) -> None:
    """Keep the memory as it is."""


@dataclass(frozen=True)
class Controller:
    """A control law.

    Attributes:
        name: What ``--set controller=`` calls it.
        parameters: Its parameter group.
        gains: ``gains(parameters, robot, viscous)`` gives the table (n, k) that ``control`` takes;
            ``viscous`` (n,) is the friction in force [N·m·s/rad or N·s/m].
        memory: Numbers that it remembers of each joint, zero at the start.
        control: ``control(gains, memory, setpoint, measured, feedforward, limit, dt, effort)``, a
            kernel or a plain function over all joints. Setpoint and measured position [rad or m],
            feedforward and limit [N·m or N] are (n,), ``memory`` (n, m) is its own to write, and
            ``effort`` (n,) gets the drive efforts; they are cut at ±limit afterwards.
        begin: ``begin(memory, measured, effort)`` prepares the memory for an arm at rest at
            ``measured`` that needs ``effort`` to stay there.
        shift: ``shift(memory, effort)`` lets it give so much more from now on, because the
            feedforward gives so much less.
    """

    name: str
    parameters: type
    gains: Callable[[Any, Robot, Array], Array]
    control: Callable[[Array, Array, Array, Array, Array, Array, float, Array], None]
    memory: int = 0
    begin: Callable[[Array, Array, Array], None] = _nothing
    shift: Callable[[Array, Array], None] = _no_shift

    @cached_property
    def control_pointer(self) -> Any:
        """The law as an argument for kernels."""
        return pointer(self.control, CONTROL)


def per_joint(robot: Robot, name: str, values: tuple[float, ...], default: Array) -> Array:
    """One number per joint (n,): the given ones, or the robot's if none are given.

    Raises:
        ParameterError: There are more or fewer than joints.
    """
    if not values:
        return default
    if len(values) != robot.n:
        raise ParameterError(f"slave_sim.{name}", values, f"empty or {robot.n} values")
    return np.array(values)


def _checked(name: str, part: object) -> Controller:
    if not isinstance(part, Controller):
        raise PartError("controller", name, f"a Controller, not a {type(part).__name__}")
    for field in ("gains", "control", "begin", "shift"):
        if not callable(getattr(part, field)):
            raise PartError("controller", name, f"one whose {field} can be called")
    return part


def _try(part: Controller) -> None:
    """Try it once on two joints, so that a wrong signature is told before anything runs."""
    from teleop_core.robots import load_robot

    robot = load_robot("scara")
    n = robot.n
    try:
        gains = np.ascontiguousarray(part.gains(part.parameters(), robot, np.zeros(n)), np.float64)
        zero, effort, memory = np.zeros(n), np.zeros(n), np.zeros((n, max(part.memory, 1)))
        part.begin(memory, zero, zero)
        part.control(gains, memory, zero, zero, zero, np.ones(n), 1e-3, effort)
    except Exception as error:
        reason = " ".join(str(error).split())
        raise PartError(
            "controller", part.name,
            "one with gains(parameters, robot, viscous) -> (n, k) and control(gains, memory, "
            "setpoint, measured, feedforward, limit, dt, effort), and parameters that all have "
            f"defaults; it raises {type(error).__name__}: {reason}",
        ) from error  # fmt: skip
    if gains.ndim != 2 or len(gains) != n:
        text = f"one whose gains have a row per joint ({n}, k), not {gains.shape}"
        raise PartError("controller", part.name, text)


CONTROLLERS: Registry[Controller] = Registry(
    "controller",
    "controllers",
    {"pid": "teleop_core.controllers.pid:PID", "pd": "teleop_core.controllers.pd:PD"},
    _checked,
    _try,
)
"""All control laws by name."""


def register_controller(controller: Controller, *, replace: bool = False) -> Controller:
    """Add a law under its own name for the rest of the program; see :meth:`Registry.add`."""
    return CONTROLLERS.add(controller.name, controller, replace=replace)
