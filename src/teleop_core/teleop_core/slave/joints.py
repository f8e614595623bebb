"""Joints: motion of the arm during one control tick, integrated by classical Runge-Kutta steps."""

from typing import Any

import numpy as np

from teleop_core.kernels import Array, inner, kernel
from teleop_core.slave.friction import FrictionRecord, FrictionState, bend, friction
from teleop_core.slave.world.contact import WorldRecord, add_push


class LoadRecord(FrictionRecord, WorldRecord):
    """Fields of a parameter record with the efforts and friction that act on moving joints."""


@inner
def _derivative(
    acceleration: Any,
    dynamics: Array,
    p: LoadRecord,
    s: FrictionState,
    contacts: Any,
    effort: Array,
    start: Array,
    q: Array,
    dq: Array,
    net: Array,
    ddq: Array,
) -> None:
    """Write accelerations (n,) under drive effort minus friction, at ``q``, for a tick that began at ``start``."""
    for i in range(q.shape[0]):
        net[i] = effort[i] - friction(p, s, i, q[i] - start[i], dq[i])
    add_push(p, contacts, q, dq, net)
    acceleration(q, dq, net, dynamics, ddq)


@kernel
def integrate(
    acceleration: Any,
    dynamics: Array,
    p: LoadRecord,
    s: FrictionState,
    contacts: Any,
    steps: int,
    effort: Array,
    q: Array,
    dq: Array,
    dt: float,
) -> None:
    """Advance ``q`` and ``dq`` (n,) by one tick under constant drive effort.

    Args:
        acceleration: Pointer to the robot's rigid-body model.
        dynamics: Parameter row of the model.
        p: Parameters.
        s: State; written.
        contacts: :class:`~teleop_core.slave.world.contact.ContactState` of each point (N,).
        steps: Number of equal Runge-Kutta steps, >= 1.
        effort: Drive effort (n,) [N·m or N].
        q: Joint positions (n,) [rad or m]; written.
        dq: Joint speeds (n,) [rad/s or m/s]; written.
        dt: Tick [s].
    """
    n = q.shape[0]
    h = dt / steps
    k, net, start = np.empty((4, n)), np.empty(n), np.empty(n)
    position, speed = np.empty(n), np.empty(n)
    for _ in range(steps):
        for i in range(n):
            start[i] = q[i]
        _derivative(acceleration, dynamics, p, s, contacts, effort, start, q, dq, net, k[0])
        for stage in range(1, 4):
            # Positions of the Runge-Kutta stages follow from the speeds of the previous stages.
            share = h if stage == 3 else 0.5 * h
            for i in range(n):
                slope = dq[i] if stage == 1 else speed[i]
                position[i] = q[i] + share * slope
            for i in range(n):
                speed[i] = dq[i] + share * k[stage - 1, i]
            _derivative(acceleration, dynamics, p, s, contacts, effort, start, position, speed, net, k[stage])
        for i in range(n):
            # Sum of the speeds of the four stages, expressed by the accelerations of the stages.
            q[i] += h * dq[i] + h * h / 6.0 * (k[0, i] + k[1, i] + k[2, i])
            dq[i] += h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
            bend(p, s, i, q[i] - start[i])
