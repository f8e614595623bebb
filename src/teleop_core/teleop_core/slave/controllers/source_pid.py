"""Source PID: the published controller, as printed; its gains follow from a rule stated here.

Proportional, integral and differential action on the error alone: the derivative is not filtered, so it reacts to
every encoder count. Only axes whose gravity is not fed forward have integral action, as the published rest positions
show.

One thing differs from the printed controller: the integral is bounded by the drive's limit. Without this bound the
integral winds up at each stop of joint 3 from more than about 50 mm/s. The loop, which has three equal poles, then
becomes unstable although the setpoint stands still.

Source:
    Vongbunyong 2008, eqs. 6.1-6.4, with u_I(k-1) in place of the printed u(k-1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, kernel
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Controller, drives_and_poles, fields, per_joint
from teleop_core.slave.controllers.pid import critically_damped_gains


@dataclass(frozen=True, kw_only=True)
class SourcePidParameters:
    """Gains; empty lists are filled by the rule, from the robot's drive table."""

    bandwidth: tuple[float, ...] = fields.bandwidth(
        "double, or with integral action triple,",
        "assumed: the source prints no gains; critically damped, as it says they were",
    )
    kp: tuple[float, ...] = parameter((), Within(0.0), "proportional gain of each joint [N·m/rad or N/m]")
    ki: tuple[float, ...] = parameter((), Within(0.0), "integral gain of each joint [N·m/(rad·s) or N/(m·s)]")
    kd: tuple[float, ...] = parameter((), Within(0.0), "derivative gain of each joint [N·m·s/rad or N·s/m]")


# Columns of the table of gains.
_KP, _KI, _KD = range(3)
# Columns of the memory.
_INTEGRAL, _LAST = range(2)


@kernel
def source_pid_control(
    gains: Array,
    memory: Array,
    setpoint: Array,
    measured: Array,
    feedforward: Array,
    limit: Array,
    dt: float,
    effort: Array,
) -> None:
    """Write ``Kp e + Ki ∫e + Kd Δe / dt + feedforward``; memory: integral effort, last error.

    The integral effort stays within ±limit; see the module.
    """
    for i in range(effort.shape[0]):
        error = setpoint[i] - measured[i]
        # Without integral action no effort holds the arm's weight at the start, as later.
        integral = memory[i, _INTEGRAL] + gains[i, _KI] * dt * error if gains[i, _KI] > 0.0 else 0.0
        memory[i, _INTEGRAL] = min(max(integral, -limit[i]), limit[i])
        change = (error - memory[i, _LAST]) / dt
        memory[i, _LAST] = error
        effort[i] = gains[i, _KP] * error + memory[i, _INTEGRAL] + gains[i, _KD] * change + feedforward[i]


def loaded_axes(robot: Robot) -> NDArray[np.bool_]:
    """Axes (n,) that gravity loads at home and whose gravity the published controller does not compensate."""
    assert robot.dynamics is not None
    effort = np.zeros(robot.n)
    robot.dynamics.gravity(robot.home.copy(), robot.dynamics.parameters.copy(), effort)
    return np.asarray((np.abs(effort) > 1e-9) & ~robot.dynamics.compensated)


def source_pid_gains(parameters: SourcePidParameters, robot: Robot, viscous: Array) -> Array:
    """Kp, Ki, Kd of each joint, (n, 3), from the parameters or by the rule.

    The rule gives the characteristic polynomial: ``inertia (s + bandwidth)²`` for axes without integral action, and
    ``inertia (s + bandwidth)³`` for :func:`loaded_axes`, which have integral action.

    Raises:
        ParameterError: The length of a list is not the robot's number of joints.
    """
    drives, pole = drives_and_poles(robot, "source_pid", parameters.bandwidth)
    double = pole**2 * drives.inertia, np.zeros(robot.n), 2.0 * pole * drives.inertia - viscous
    triple = critically_damped_gains(drives.inertia, viscous, pole)
    loaded = loaded_axes(robot)
    designed = [np.where(loaded, b, a).clip(min=0.0) for a, b in zip(double, triple, strict=True)]
    given = (("kp", parameters.kp), ("ki", parameters.ki), ("kd", parameters.kd))
    columns = [
        per_joint(robot, f"controller.source_pid.{name}", values, default)
        for (name, values), default in zip(given, designed, strict=True)
    ]
    return np.stack(columns, axis=1)


def begin(memory: Array, measured: Array, effort: Array) -> None:
    """Start at rest: the integrals of axes with integral action hold the arm."""
    memory[:, _INTEGRAL] = effort


def shift(memory: Array, effort: Array) -> None:
    """Do nothing: axes without integral action cannot replace the missing feedforward."""


SOURCE_PID = Controller("source_pid", SourcePidParameters, source_pid_gains, source_pid_control, 2, begin, shift)
