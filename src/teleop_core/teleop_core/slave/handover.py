"""Handover: the effort that a control law loses when its gains change.

An integrator holds more than a load: of a joint that moves it also holds what the derivative takes
off. Gains that change at once would leave that alone, and the arm, nothing to hold it back, would
run away. So the integrator takes over the difference, and the effort makes no step.

Source:
    Åström and Hägglund 1995, PID Controllers, chapter 3 (bumpless parameter changes).
"""

from typing import Any

import numpy as np

from teleop_core.kernels import Array, kernel
from teleop_core.slave.arm import Arm

_NO_LIMIT = 1e6  # times a drive's: what would be cut off counts as well
_TICKS = 20  # after which a derivative's filter has forgotten the noise of one difference


def missing_effort(arm: Arm, speed: Array, before: Array, dt: float, ticks: int = _TICKS) -> Array:
    """Effort (n,) of the gains ``before``, less that of the present gains [N·m or N].

    Both are asked for an arm that goes on evenly as it moves; nothing of the arm is changed.

    Args:
        arm: The arm; its gains are the new ones.
        speed: Of its joints, shape (n,) [rad/s or m/s].
        before: Gains until now, shape (n, k).
        dt: Tick [s].
        ticks: How many it goes on; 0 compiles what is needed, and calls no law.
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
    """Write the effort for an arm that moved on evenly for some ticks."""
    for _ in range(ticks):
        for i in range(speed.shape[0]):
            setpoint[i] += speed[i] * dt
            measured[i] += speed[i] * dt
        control(gains, memory, setpoint, measured, feedforward, limit, dt, effort)
