"""Stability: whether a slave's loop, as it is set, lets small errors die away at its rate."""

from typing import Any

import numpy as np

from teleop_core.errors import ParameterError
from teleop_core.geometry import Array
from teleop_core.kernels import bound, records
from teleop_core.operation.states import State
from teleop_core.slave.step import Arm, slave_step

_TICKS, _LAST = 400, 100
# So many times larger than at the start no error is after _TICKS. Laws that learn may let errors
# grow for a while, within bounds; loops that run away pass it by orders of magnitude.
_GROWTH = 100.0
# Error at the start, in encoder steps, and what is left of those steps meanwhile.
_ERROR, _FINE = 1e-2, 1e-6


def check_stable(name: str, p: Any, s: Any, arm: Arm, row: Any, dt: float) -> None:
    """Refuse a loop in which a small error of a joint grows.

    Two copies of the arm are held at the present setpoint, one of them with a small error of all
    joints; encoders are fine and dry friction is left out, so that the difference of the two is
    that of a linear loop. After 0.4 s it must not be a hundred times what it was.

    Args:
        name: Name of the control law, for the message.
        p: Parameter record of the slave.
        s: State record.
        arm: Its arrays.
        row: Signals.
        dt: Tick [s].

    Raises:
        ParameterError: It grows, or runs away.
    """
    error = _ERROR * np.array(p["encoder_step"])
    calm, shaken = (_held(p, s, arm, row, dt, by) for by in (0.0 * error, error))
    with np.errstate(all="ignore"):
        growth = np.max(np.abs(shaken - calm) / error, axis=0)
    if not (growth <= _GROWTH).all():
        joint = int(np.flatnonzero(~(growth <= _GROWTH))[0])
        fold = f"{growth[joint]:.1g}-fold" if np.isfinite(growth[joint]) else "without bound"
        needed = (
            f"stable at {1.0 / dt:g} Hz: an error of joint {joint + 1} grows {fold} in "
            f"{_TICKS * dt:g} s; lower its gains or friction, or raise integration_steps"
        )
        raise ParameterError("slave_sim.controller.kind", name, needed)


def _held(p: Any, s: Any, arm: Arm, row: Any, dt: float, by: Array) -> Array:
    """Positions (N, n) in the last ticks of an arm that is held ``by`` (n,) off its setpoint."""
    p, s, row = (_copy(record) for record in (p, s, row))
    arm = Arm(*(np.array(part) if isinstance(part, np.ndarray) else part for part in arm))
    s["state"], p["brakes"], p["event_count"], p["heartbeat_ns"] = State.PAUSED, 0, 0, 0
    p["reported"] = 1
    for name in ("encoder_step", "effort_step"):
        p[name] *= _FINE
    p["coulomb"], p["wander"] = 0.0, 0.0
    arm.q[:] += by
    found, step = np.empty((_LAST, len(arm.q))), bound(slave_step, p, s, arm, row, dt)
    for k in range(_TICKS):
        row["now_ns"] += round(dt * 1e9)
        step()
        found[k % _LAST] = arm.q
    return found


def _copy(record: Any) -> Any:
    copied = records(record.dtype)
    copied[0] = record
    return copied[0]
