"""Joints: how the arm moves on during one control tick, by classical Runge-Kutta steps."""

import math
from typing import Any

import numpy as np

from teleop_core.geometry import Array
from teleop_core.kernels import inner, kernel


@inner
def _derivative(
    acceleration: Any,
    dynamics: Array,
    viscous: Array,
    coulomb: Array,
    friction_speed: Array,
    effort: Array,
    q: Array,
    dq: Array,
    net: Array,
    ddq: Array,
) -> None:
    """Write accelerations (n,) under the drive effort less friction.

    Dry friction grows smoothly through zero speed, ``coulomb v / sqrt(v² + friction_speed²)``, so
    that the integrator sees no step.
    """
    for i in range(q.shape[0]):
        v = dq[i]
        smooth = v / math.sqrt(v * v + friction_speed[i] * friction_speed[i])
        net[i] = effort[i] - viscous[i] * v - coulomb[i] * smooth
    acceleration(q, dq, net, dynamics, ddq)


@kernel
def integrate(
    acceleration: Any,
    dynamics: Array,
    viscous: Array,
    coulomb: Array,
    friction_speed: Array,
    steps: int,
    effort: Array,
    q: Array,
    dq: Array,
    dt: float,
) -> None:
    """Move ``q`` and ``dq`` (n,) on by one tick under constant drive effort.

    Args:
        acceleration: Pointer to the robot's rigid-body model.
        dynamics: Its parameter row.
        viscous: Viscous friction (n,) [N·m·s/rad or N·s/m].
        coulomb: Dry friction (n,) [N·m or N].
        friction_speed: Speed at which dry friction has 71 % of its value (n,) [rad/s or m/s].
        steps: Number of equal Runge-Kutta steps, >= 1.
        effort: Drive effort (n,) [N·m or N].
        q: Joint positions (n,) [rad or m]; written.
        dq: Joint speeds (n,) [rad/s or m/s]; written.
        dt: Tick [s].
    """
    n = q.shape[0]
    h = dt / steps
    k, net = np.empty((4, n)), np.empty(n)
    position, speed = np.empty(n), np.empty(n)
    for _ in range(steps):
        _derivative(
            acceleration, dynamics, viscous, coulomb, friction_speed, effort, q, dq, net, k[0]
        )
        for stage in range(1, 4):
            # Positions of the stages follow from the speeds of the stages before.
            share = h if stage == 3 else 0.5 * h
            for i in range(n):
                slope = dq[i] if stage == 1 else speed[i]
                position[i] = q[i] + share * slope
            for i in range(n):
                speed[i] = dq[i] + share * k[stage - 1, i]
            _derivative(
                acceleration, dynamics, viscous, coulomb, friction_speed, effort, position, speed,
                net, k[stage],
            )  # fmt: skip
        for i in range(n):
            # Sum of the four stage speeds, written with the accelerations they came from.
            q[i] += h * dq[i] + h * h / 6.0 * (k[0, i] + k[1, i] + k[2, i])
            dq[i] += h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
