"""Transmission: what lies between encoders and joints: play and coupled tendons."""

from typing import Any

from teleop_core.geometry import Array
from teleop_core.kernels import inner


@inner
def follow_encoders(p: Any, s: Any, q: Array, coupling: Array, tip: Array) -> None:
    """Write the true joint positions (n,) of motors at ``q`` (n,) [rad or m].

    A joint stays where it is until its motor has crossed the play, and is dragged then. By how
    much an earlier joint lags behind its motor moves those that its tendons pass by.

    Args:
        p: Record with ``play`` (n,).
        s: Record with ``carried`` (n,), the joints as the motors left them; written.
        q: Where the motors are, seen through their gears.
        coupling: (n, n), below its diagonal.
        tip: Written.
    """
    for i in range(q.shape[0]):
        pull = q[i]
        for j in range(i):
            if coupling[i, j] != 0.0:
                pull += coupling[i, j] * (q[j] - s.carried[j])
        s.carried[i] = min(max(s.carried[i], pull - p.play[i]), pull + p.play[i])
        tip[i] = s.carried[i]
