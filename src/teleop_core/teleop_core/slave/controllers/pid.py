"""PID: one joint's controller in parallel form, with a filtered derivative and no windup."""

from dataclasses import dataclass

import numpy as np

from teleop_core.base import Within, parameter
from teleop_core.kernels import Array, kernel
from teleop_core.robots.robot import Robot
from teleop_core.slave.controllers import Controller, drives_and_poles, fields, motion_estimates, per_joint

THIRD = 1.0 / 3.0
"""Setpoint weight with which the zero cancels one of three equal poles."""


@dataclass(frozen=True, kw_only=True)
class PidParameters:
    """Gains; empty lists are filled from the robot's drive table, by the rule of three equal poles."""

    bandwidth: tuple[float, ...] = fields.bandwidth("triple", "assumed: the drive table's")
    kp: tuple[float, ...] = parameter((), Within(0.0), "proportional gain of each joint [N·m/rad or N/m]")
    ki: tuple[float, ...] = parameter((), Within(0.0), "integral gain of each joint [N·m/(rad·s) or N/(m·s)]")
    kd: tuple[float, ...] = parameter((), Within(0.0), "derivative gain of each joint [N·m·s/rad or N·s/m]")
    setpoint_weight: float = parameter(
        1.0,
        Within(0.0, 1.0),
        "share of the setpoint in the proportional action; at 1/3 no step overshoots",
        source="assumed: 1 tracks best, and overshoots steps that pass no filter by a quarter",
    )


def critically_damped_gains(inertia: Array, viscous: Array, bandwidth: Array) -> tuple[Array, Array, Array]:
    """Gains that put all three closed-loop poles of an inertia with friction at one real place.

    The loop ``inertia q'' + viscous q' = Kp (b r - q) + Ki ∫(r - q) - Kd q'`` has the characteristic polynomial
    ``inertia (s + bandwidth)³``. It is critically damped: disturbances decay without oscillation. Its response to the
    setpoint r is ``bandwidth² (3 b s + bandwidth) / (s + bandwidth)³``. With the whole setpoint in the proportional
    action, b = 1, the zero makes a step overshoot by 25 % in continuous time and by 20 % at 1 kHz. The overshoot is
    smaller if the setpoint moves no faster than the drive. With b = 1/3 the zero cancels a pole. The response is then
    ``bandwidth² / (s + bandwidth)²``, and no step overshoots.

    Args:
        inertia: Inertias (n,) [kg·m² or kg], > 0.
        viscous: Viscous friction (n,) [N·m·s/rad or N·s/m], >= 0.
        bandwidth: Triple pole (n,) [rad/s], > 0.

    Returns:
        Kp, Ki, Kd, each (n,). Kd is 0 where friction alone gives more damping than wanted.

    Source:
        Åström and Hägglund 1995, PID Controllers, section 3.4 (setpoint weighting).
    """
    kp = 3.0 * bandwidth**2 * inertia
    ki = bandwidth * bandwidth**2 * inertia
    kd = (3.0 * bandwidth * inertia - viscous).clip(min=0.0)
    return kp, ki, kd


# Columns of the table of gains.
_KP, _KI, _KD, _WEIGHT = range(4)
# Columns of the memory.
_INTEGRAL, _LAST, _SPEED, _LAGGED = range(4)


@kernel
def pid_step(
    setpoint: float, measured: float, gains: Array, memory: Array, feedforward: float, limit: float, dt: float
) -> float:
    """Drive effort for one tick, within ±limit; updates the memory.

    The integral stays constant while the drive is saturated and the error would increase the effort further
    (conditional integration). The derivative acts on the measured position alone, through a first-order filter of two
    ticks. So a step of the setpoint causes no derivative kick.

    Args:
        setpoint: Wanted position [rad or m].
        measured: Measured position [rad or m].
        gains: Kp, Ki, Kd.
        memory: Integral effort, last measured position, filtered speed (3,); written.
        feedforward: Effort added before the limit.
        limit: Largest effort of the drive.
        dt: Tick [s], > 0.

    Returns:
        Effort [N·m or N].
    """
    memory[_SPEED] += ((measured - memory[_LAST]) / dt - memory[_SPEED]) / 2.0
    memory[_LAST] = measured
    error = setpoint - measured
    free = gains[_KP] * error - gains[_KD] * memory[_SPEED] + feedforward
    integral = memory[_INTEGRAL] + gains[_KI] * error * dt
    effort = free + integral
    if abs(effort) <= limit or effort * error < 0.0:
        memory[_INTEGRAL] = integral
    else:
        effort = free + memory[_INTEGRAL]
    return min(max(effort, -limit), limit)


@kernel
def weighted_setpoint(setpoint: float, measured: float, gains: Array, memory: Array, room: float, dt: float) -> float:
    """Modified setpoint with which a PID on the error has the setpoint weight b; unchanged for b = 1.

    The modified setpoint is ``b r + (1 - b) x``, where x is the setpoint r after a first-order lag of rate Ki / Kp. At
    every tick the effort equals that of the form ``Kp (b r - y) + Ki ∫(r - y)``. Only the integrals differ: the
    integral here balances the load alone; the integral of that form also contains ``Kp (1 - b) r``.

    A setpoint farther away than ``room / (b Kp)`` counts as nearer, so that the drive can brake: see
    :func:`teleop_core.slave.controllers.motion_estimates.approach`.

    Args:
        setpoint: Wanted position [rad or m].
        measured: Measured position [rad or m].
        gains: Kp, Ki, Kd, b (4,).
        memory: Memory of the joint; its last number is the lagging setpoint; written.
        room: Effort that the drive can give in addition to the feedforward [N·m or N].
        dt: Tick [s], > 0.
    """
    pull, weight, near = gains[_KI] * dt, gains[_WEIGHT], setpoint
    if weight == 1.0 or pull == 0.0:  # without an integral the lag would not change
        memory[_LAGGED] = setpoint
        return setpoint
    linear = room / (max(weight, THIRD) * gains[_KP] + 1e-300)
    if abs(setpoint - measured) > linear:
        near = measured + motion_estimates.approach(setpoint - measured, linear)
    memory[_LAGGED] += (near - memory[_LAGGED]) * (pull / (gains[_KP] + pull))
    return weight * near + (1.0 - weight) * memory[_LAGGED]


@kernel
def pid_control(
    gains: Array,
    memory: Array,
    setpoint: Array,
    measured: Array,
    feedforward: Array,
    limit: Array,
    dt: float,
    effort: Array,
) -> None:
    """Write the efforts of all joints; see :func:`weighted_setpoint`, :func:`pid_step`."""
    for i in range(effort.shape[0]):
        room = max(limit[i] - abs(feedforward[i]), 0.1 * limit[i])
        wanted = weighted_setpoint(setpoint[i], measured[i], gains[i], memory[i], room, dt)
        effort[i] = pid_step(wanted, measured[i], gains[i], memory[i], feedforward[i], limit[i], dt)


def pid_gains(parameters: PidParameters, robot: Robot, viscous: Array) -> Array:
    """Kp, Ki, Kd and setpoint weight of each joint, (n, 4), from the parameters or from the robot's drives.

    Raises:
        ParameterError: The length of a list is not the robot's number of joints.
    """
    drives, bandwidth = drives_and_poles(robot, "pid", parameters.bandwidth)
    designed = critically_damped_gains(drives.inertia, viscous, bandwidth)
    given = (("kp", parameters.kp), ("ki", parameters.ki), ("kd", parameters.kd))
    columns = [
        per_joint(robot, f"controller.pid.{name}", values, default)
        for (name, values), default in zip(given, designed, strict=True)
    ]
    return np.stack((*columns, np.full(robot.n, parameters.setpoint_weight)), axis=1)


def begin(memory: Array, measured: Array, effort: Array) -> None:
    """Initialise the integrators so that they hold the arm at its position."""
    memory[:, _INTEGRAL] = effort
    memory[:, _LAST] = memory[:, _LAGGED] = measured


def shift(memory: Array, effort: Array) -> None:
    """Add the effort that the feedforward no longer contains to the integrators."""
    memory[:, _INTEGRAL] += effort


PID = Controller("pid", PidParameters, pid_gains, pid_control, 4, begin, shift)
