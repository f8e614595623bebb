"""Handover: the effort that a control law loses when its gains change.

An integrator holds more than a load. While a joint moves, it also balances the effort that the derivative subtracts.
After a sudden change of gains this balance is lost, and the arm would run away. So the integrator takes over the
difference, and the effort makes no step.

Source:
    Åström and Hägglund 1995, PID Controllers, chapter 3 (bumpless parameter changes).
"""

from typing import Any

import numpy as np

from teleop_core.kernels import Array, kernel
from teleop_core.slave.arm import Arm

_NO_LIMIT = 1e6  # times a drive's limit: effort that the limit would cut off counts as well
_TICKS = 20  # ticks after which a derivative's filter has forgotten the noise of one difference


def missing_effort(arm: Arm, speed: Array, before: Array, dt: float, ticks: int = _TICKS) -> Array:
    """Effort (n,) of the gains ``before``, less that of the present gains [N·m or N].

    Both efforts are computed for an arm that continues at its present, constant speed. The arm itself is not changed.

    Args:
        arm: The arm; its gains are the new ones.
        speed: Joint speeds, shape (n,) [rad/s or m/s].
        before: Gains until now, shape (n, k).
        dt: Tick [s].
        ticks: Number of ticks at constant speed; 0 compiles the kernels, and calls no control law.
    """
    efforts = np.zeros((2, len(speed)))
    for gains, effort in zip((before, arm.gains), efforts, strict=True):
        spare = (arm.memory.copy(), arm.setpoint.copy(), arm.measured.copy())
        limit = _NO_LIMIT * arm.limit
        _go_on(arm.control, gains, *spare, speed, arm.feedforward, limit, dt, ticks, effort)
    return np.array(efforts[0] - efforts[1])


@kernel
def _go_on(
    control: Any, gains: Array, memory: Array, setpoint: Array, measured: Array, speed: Array,
    feedforward: Array, limit: Array, dt: float, ticks: int, effort: Array,
) -> None:  # fmt: skip
    """Write the effort for an arm that moved on at constant speed for some ticks."""
    for _ in range(ticks):
        for i in range(speed.shape[0]):
            setpoint[i] += speed[i] * dt
            measured[i] += speed[i] * dt
        control(gains, memory, setpoint, measured, feedforward, limit, dt, effort)
