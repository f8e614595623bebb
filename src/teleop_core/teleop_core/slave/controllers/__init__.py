"""Controllers: from setpoint and measurement to drive effort, one file per law.

A controller works on all joints of an arm at once, tick by tick. Its gains are a table with a row per joint, computed
from the parameters and the robot's drives. Its memory is another table. The slave, not the control law, computes the
compensated gravity, the drive limits and the encoders.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from teleop_core.base import ParameterError, PartError, Registry, part_check
from teleop_core.base.registry import places, tried
from teleop_core.graph import DT
from teleop_core.kernels import Array, fenced, is_whole, pointer
from teleop_core.robots.drives import Drives
from teleop_core.robots.robot import Robot

__all__ = ["CONTROLLERS", "Controller", "drives_and_poles", "per_joint", "register_controller"]

_ROW, _TABLE = "float64[::1]", "float64[:, ::1]"
CONTROL = f"void({_TABLE}, {_TABLE}, {_ROW}, {_ROW}, {_ROW}, {_ROW}, float64, {_ROW})"
"""Signature of a control kernel, so that one compiled slave serves every law."""
Begin = Callable[[Array, Array, Array], None]
Shift = Callable[[Array, Array], None]


def _nothing(*_: Array) -> None:
    """Keep the memory as it is."""


@dataclass(frozen=True)
class Controller:
    """A control law.

    Attributes:
        name: Name of the law in ``--set controller=``.
        parameters: Parameter group of the law.
        gains: ``gains(parameters, robot, viscous)`` returns the table (n, k) that ``control`` takes; ``viscous`` (n,)
            is the present viscous friction [N·m·s/rad or N·s/m].
        memory: Number of values that the law remembers for each joint; they are zero at the start.
        control: ``control(gains, memory, setpoint, measured, feedforward, limit, dt, effort)``, a kernel or a plain
            function over all joints. Setpoint and measured position [rad or m], feedforward and limit [N·m or N] are
            (n,). The law may write ``memory`` (n, m). It writes the drive efforts into ``effort`` (n,); the slave then
            clips them to ±limit. The feedforward is the compensated gravity.
        begin: ``begin(memory, measured, effort)`` prepares the memory for an arm at rest at
            ``measured`` that needs ``effort`` to stay there.
        shift: ``shift(memory, effort)`` increases the effort of the law by ``effort`` from now on, because the
            feedforward or new gains decrease it by that amount.
        uses_model: Whether the feedforward is (2 n + n²,). Then the compensated gravity is followed by the model's bias
            (n,) at the measured positions and speeds, and by its inertia matrix (n, n), row by row. The bias contains
            the Coriolis, centrifugal and all gravity efforts. All come from the known model, not from the plant; they
            contain no friction.
    """

    name: str
    parameters: type
    gains: Callable[[Any, Robot, Array], Array]
    control: Callable[[Array, Array, Array, Array, Array, Array, float, Array], None]
    memory: int = 0
    begin: Begin = _nothing
    shift: Shift = _nothing
    uses_model: bool = False

    def feedforward(self, n: int) -> int:
        """Length of the feedforward array of this law, for ``n`` joints."""
        return 2 * n + n * n if self.uses_model else n

    control_pointer = cached_property(lambda self: pointer(self.control, CONTROL))
    """The law as an argument for kernels."""


def per_joint(robot: Robot, name: str, values: tuple[float, ...], default: Array) -> Array:
    """One number per joint (n,): the given numbers, or the robot's if none are given.

    Raises:
        ParameterError: The number of values differs from the number of joints.
    """
    if not values:
        return default
    if len(values) != robot.n:
        raise ParameterError(f"slave_sim.{name}", values, f"empty or {robot.n} values")
    return np.array(values)


def drives_and_poles(robot: Robot, law: str, bandwidth: tuple[float, ...]) -> tuple[Drives, Array]:
    """Drive table of a robot, and the closed-loop poles (n,) [rad/s]: the given ones, or the robot's own.

    Raises:
        ParameterError: The number of poles differs from the number of joints.
    """
    drives = robot.drives
    assert drives is not None
    return drives, per_joint(robot, f"controller.{law}.bandwidth", bandwidth, drives.bandwidth)


_checked_form = part_check("controller", Controller, "gains", "control", "begin", "shift")


def _checked(name: str, part: object) -> Controller:
    controller = _checked_form(name, part)
    if not isinstance(controller.uses_model, bool):
        text = f"one whose uses_model is a bool, not {controller.uses_model!r}"
        raise PartError("controller", name, text)
    return controller


def _try(part: Controller) -> None:
    """Try a control law once on four joints, so that errors are reported before anything runs."""
    from teleop_core.robots import load_robot

    robot = load_robot("scara")
    needs = (
        "one with gains(parameters, robot, viscous) -> (n, k) and control(gains, memory, "
        "setpoint, measured, feedforward, limit, dt, effort), and parameters that all have defaults"
    )
    with tried("controller", part.name, needs):
        gains = np.asarray(part.gains(part.parameters(), robot, np.zeros(robot.n)), np.float64)
        _insist_on_table(part, gains, robot.n)
        effort, is_inside = _tried_effort(part, gains, robot.home)
    if not is_inside:
        text = f"one that writes n efforts and no more memory than it declares, {part.memory}"
        raise PartError("controller", part.name, text)
    if not np.isfinite(effort).all():
        text = f"one whose efforts are finite; at rest at home they are {effort.tolist()}"
        raise PartError("controller", part.name, text)


def _insist_on_table(part: Controller, gains: Array, n: int) -> None:
    """Refuse gains that are not a finite table (n, k)."""
    if gains.ndim != 2 or len(gains) != n or not np.isfinite(gains).all():
        text = f"one whose gains have a row of finite numbers per joint ({n}, k), not {gains.shape}"
        raise PartError("controller", part.name, text)


def _tried_effort(part: Controller, gains: Array, home: Array) -> tuple[Array, bool]:
    """Efforts (n,) at rest at home, and whether the law wrote only to arrays that it may write."""
    n = len(home)
    memory, fence = fenced(np.zeros((n, max(part.memory, 1))))
    effort, after = fenced(np.zeros(n))
    table, _ = fenced(gains)
    zero, one = np.zeros(n), np.ones(n)
    feedforward, _ = fenced(np.zeros(part.feedforward(n)))
    if part.uses_model:
        feedforward[2 * n :] = np.eye(n).ravel()
    part.begin(memory, home.copy(), zero)
    part.shift(memory, zero)
    part.control(table, memory, home.copy(), home.copy(), feedforward, one, DT, effort)
    return effort, is_whole(fence) and is_whole(after)


CONTROLLERS: Registry[Controller] = Registry(
    "controller",
    "controllers",
    places(
        "teleop_core.slave.controllers",
        "pid pd source_pid friction_compensation computed_torque adaptive disturbance_observer",
    ),
    _checked,
    _try,
)
"""All control laws by name."""

register_controller = CONTROLLERS.register
"""Adds your control law under its own name; see :meth:`Registry.register`."""
