"""Handover: the effort that a control law loses when its gains change.

An integrator holds more than a load. While a joint moves, it also balances the effort that the derivative subtracts.
After a sudden change of gains this balance is lost, and the arm would run away. So the difference is added to the
integrator, and the effort is continuous.

Source:
    Åström and Hägglund 1995, PID Controllers, chapter 3 (bumpless parameter changes).
"""

from typing import Any

import numpy as np

from teleop_core.kernels import Array, kernel
from teleop_core.slave.arm import ArmParts

_NO_LIMIT = 1e6  # factor on the drives' limits, so that the compared efforts are not clipped
_TICKS = 20  # number of ticks after which the filter of a derivative has forgotten one difference


def missing_effort(arm: ArmParts, speed: Array, before: Array, dt: float, ticks: int = _TICKS) -> Array:
    """Effort (n,) with the gains ``before`` minus the effort with the present gains [N·m or N].

    Both efforts are computed for an arm that continues at its present, constant speed. The arm itself is not changed.

    Args:
        arm: The arm; it has the new gains.
        speed: Joint speeds, shape (n,) [rad/s or m/s].
        before: Previous gains, shape (n, k).
        dt: Tick [s].
        ticks: Number of ticks at constant speed. With 0, the kernels are compiled, but no control law is called.
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
    """Write the effort for an arm that continues at constant speed for some ticks."""
    for _ in range(ticks):
        for i in range(speed.shape[0]):
            setpoint[i] += speed[i] * dt
            measured[i] += speed[i] * dt
        control(gains, memory, setpoint, measured, feedforward, limit, dt, effort)
