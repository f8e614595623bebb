"""Poses for a calibration: random inside the limits, or the most informative ones (D-optimality)."""

from collections.abc import Sequence

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot
from teleop_lab.calibration.model import ChainModel

CANDIDATES = 400
"""Number of random poses from which the best poses are chosen."""
_START = 1e-6  # prior information about each entry before the first pose


def random_poses(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """Joint vectors (count, n), uniformly distributed inside the limits [rad, m]."""
    return rng.uniform(robot.lower, robot.upper, (count, robot.n))


def optimal_poses(model: ChainModel, count: int, names: Sequence[str], rng: np.random.Generator) -> Array:
    """Joint vectors (count, n) at which points of the tip are most informative about the named entries.

    Of :data:`CANDIDATES` random poses, each step chooses the pose that increases the determinant of the information
    matrix JᵀJ most. A pose is chosen again only after all other poses were chosen.

    Args:
        model: Model of the nominal arm.
        count: Number of poses.
        names: Entries that can be distinguished.
        rng: Random generator of the candidates.

    Source:
        Fedorov 1972, Theory of optimal experiments: forward steps; for calibration Borm and Menq 1991.
    """
    pool = random_poses(model.robot, max(CANDIDATES, 2 * count), rng)
    J = model.jacobian(pool, np.zeros(len(model.names)))
    J = J[:, :, [model.names.index(name) for name in names]]
    J = J / np.sqrt((J**2).sum(axis=(0, 1)))
    # The determinant of M + JᵀJ is the product of the determinants of M and of I + J M⁻¹ Jᵀ (3, 3).
    inverse, chosen = np.eye(len(names)) / _START, list[int]()
    for _ in range(count):
        spread = np.einsum("nij,jk,nlk->nil", J, inverse, J, optimize=True)
        gain = np.linalg.slogdet(np.eye(3) + spread)[1]
        gain[chosen] = -np.inf
        best = int(np.argmax(gain))
        chosen.append(best)
        part = inverse @ J[best].T
        inverse -= part @ np.linalg.solve(np.eye(3) + spread[best], part.T)
    return np.asarray(pool[chosen])
