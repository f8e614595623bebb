"""Rank: the number of directions in which a tip can move at once, and the choice of the controlled directions.

An arm of five joints cannot reach every pose. If it has to control all six directions, its tip follows the goal well in
none of them. Candidates are the sets of directions in which the tip can move at once. Of these, the sets with the most
position directions are kept. The chosen set needs the least joint motion in its worst direction: the median over
postures spread evenly within the limits.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import DIRECTIONS
from teleop_core.robots import arm, freedom

_POSTURES = 128  # number of postures that are examined
_FEW = 4  # number of postures that suffice if the rank is full at one of them
_NONE = 1e-6  # in a direction with a smaller singular value the tip cannot move
_POOR = 1e-3  # a set of directions is useless if the median of its least singular value is below this


class Directions(NamedTuple):
    """Number of directions in which a tip can move at once, and the names of the directions to control."""

    rank: int
    best: tuple[str, ...]


def directions_of(robot: arm.Arm, lever: float) -> Directions:
    """Directions that a robot can control, of all six, whatever its own task mask is.

    Args:
        robot: The arm.
        lever: Distance [m] that counts as much as a radian.

    Source:
        The least singular value as a measure of dexterity: Klein and Blaho 1987, IJRR 6(2).
    """
    postures = freedom.samples(robot)[:_POSTURES]
    if _rank(_jacobians(robot, postures[:_FEW], lever)) == len(DIRECTIONS):
        return Directions(len(DIRECTIONS), DIRECTIONS)
    jacobians = _jacobians(robot, postures, lever)
    rank = _rank(jacobians)
    kept: dict[tuple[int, ...], float] = {}
    for some in combinations(range(len(DIRECTIONS)), rank):
        least = np.linalg.svd(jacobians[:, list(some)], compute_uv=False)[:, -1]
        kept[some] = round(float(np.median(least)), 6)
    useful = [some for some in kept if kept[some] > _POOR] or list(kept)
    best = max(useful, key=lambda some: (sum(i < 3 for i in some), kept[some]))
    return Directions(rank, tuple(DIRECTIONS[i] for i in best))


def _rank(jacobians: Array) -> int:
    """Largest rank of several Jacobians (k, 6, n); the full rank if a number is not finite."""
    if not np.isfinite(jacobians).all():
        return len(DIRECTIONS)
    return int((np.linalg.svd(jacobians, compute_uv=False) > _NONE).sum(axis=1).max())


def _jacobians(robot: arm.Arm, postures: Array, lever: float) -> Array:
    """Jacobians (k, 6, n) at postures (k, n), with linear rows divided by the lever."""
    found, row = np.empty((len(postures), 6, robot.n)), robot.geometry_row
    for q, jacobian in zip(postures, found, strict=True):
        robot.kernels.jacobian(q.copy(), row, jacobian)
    found[:, :3] /= lever or 1.0  # the lever of a tip that only rotates is 0
    return found
