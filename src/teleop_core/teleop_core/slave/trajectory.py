"""Trajectory: joint-space cubics for autonomous moves; all joints start and stop together, at rest."""

import math

import numpy as np

from teleop_core.base.errors import ParameterError, ShapeError
from teleop_core.kernels.geometry import Array


def cubic_move(start: Array, end: Array, move_time: float, times: Array) -> tuple[Array, Array]:
    """Joint positions and speeds of a move whose joints start, run and stop together.

    ``q = a0 + a2 t² + a3 t³`` with ``a2 = 3 (end - start) / T²``, ``a3 = -2 (end - start) / T³``. Before time 0 the
    arm rests at the start; after ``move_time`` it rests at the end. The path is a straight line in joint space.

    Args:
        start: Joint vector (n,) [rad or m].
        end: Joint vector (n,) [rad or m].
        move_time: Time of the move [s], > 0; 0 when start and end are the same.
        times: Times (N,) since the start of the move [s].

    Returns:
        Positions (N, n) [rad or m] and speeds (N, n) [rad/s or m/s].

    Raises:
        ShapeError: Start and end have different lengths.
        ParameterError: The time of the move is negative, not finite, or zero for a real move.

    Source:
        Vongbunyong 2008, appendix A.2; its a3 is printed with T² in place of T³.
    """
    travel = _travel(start, end)
    if not (math.isfinite(move_time) and move_time >= 0.0) or (move_time == 0.0 and travel.any()):
        raise ParameterError("move_time", move_time, "finite and > 0 s")
    if move_time == 0.0:
        still = np.zeros((len(times), len(travel)))
        return still + end, still
    share = np.clip(np.asarray(times, dtype=np.float64) / move_time, 0.0, 1.0)[:, None]
    position = start + travel * (share * share * (3.0 - 2.0 * share))
    return position, travel / move_time * (6.0 * share * (1.0 - share))


def shortest_move_time(start: Array, end: Array, speed_limit: Array) -> float:
    """Shortest time of :func:`cubic_move` [s] in which no joint exceeds its speed limit.

    The peak speed, in the middle of the move, is 1.5 times the mean speed. The time is 0 if start and end are equal.

    Args:
        start: Joint vector (n,) [rad or m].
        end: Joint vector (n,) [rad or m].
        speed_limit: Largest speeds (n,) [rad/s or m/s], > 0.

    Raises:
        ShapeError: The vectors have different lengths.
        ParameterError: A speed limit is not positive.
    """
    travel = _travel(start, end)
    limit = np.asarray(speed_limit, dtype=np.float64)
    if limit.shape != travel.shape:
        raise ShapeError("speed_limit", travel.shape, limit.shape)
    if not (limit > 0.0).all():
        raise ParameterError("speed_limit", limit.tolist(), "> 0 for every joint")
    return float(np.max(1.5 * np.abs(travel) / limit))


def _travel(start: Array, end: Array) -> Array:
    begin, finish = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    if begin.ndim != 1 or begin.shape != finish.shape:
        raise ShapeError("end", begin.shape, finish.shape)
    return finish - begin
