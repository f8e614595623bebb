"""A search of scipy's finds no assembly of legs that ours calls unassemblable."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from teleop_core.kernels.geometry import Array
from teleop_core.robots import FkStatus, load_robot
from teleop_machines.stewart import PAIRED

# Error of a leg or of a loop equation at which scipy's answer counts as closed.
FOUND = 1e-10
STARTS = 16


def platform_gaps(x: Any, legs: Any) -> Any:
    ends = x[:3] + PAIRED.platform @ Rotation.from_rotvec(x[3:]).as_matrix().T
    return np.linalg.norm(ends - PAIRED.base, axis=1) - legs


def ball_joint_gaps(angles: Any, legs: Any, b: float = 1.0, a: float = 0.5) -> Any:
    headings = 2.0 * math.pi / 3.0 * np.arange(3)
    out = b - legs * np.cos(angles)
    S = np.column_stack((out * np.cos(headings), out * np.sin(headings), legs * np.sin(angles)))
    return np.linalg.norm(np.roll(S, -1, axis=0) - S, axis=1) - math.sqrt(3.0) * a


def any_platform(rng: Any) -> Array:
    return np.concatenate((rng.uniform([-0.2, -0.2, 0.0], [0.2, 0.2, 0.35]), rng.normal(0, 1.2, 3)))


def any_angles(rng: Any) -> Any:
    return rng.uniform(-math.pi, math.pi, 3)


# Random sets inside the strokes; of the 3-RPS, whose legal triples all assemble, in a wider range.
SEARCHES = {"stewart": (platform_gaps, any_platform, 1.0), "rps3": (ball_joint_gaps, any_angles, 2.0)}


def finds(name: str, legs: Any, rng: np.random.Generator) -> bool:
    """Whether Newton steps of MINPACK close the loops from some random start."""
    gaps, start, _ = SEARCHES[name]
    for _ in range(STARTS):
        _, info, _, _ = fsolve(gaps, start(rng), args=(legs,), full_output=True)
        if np.abs(info["fvec"]).max() < FOUND:
            return True
    return False


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The iteration is not making good progress")
@pytest.mark.parametrize("name", SEARCHES)
def test_what_is_called_open_is_closed_by_no_other_search(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(21)
    share = SEARCHES[name][2]
    lower = np.maximum(robot.home + share * (robot.lower - robot.home), 0.05)
    upper = robot.home + share * (robot.upper - robot.home)
    q = rng.uniform(lower, upper, (2000, robot.n))
    status = robot.solve_fk(q).status
    opened, closed = q[status == FkStatus.NOT_CLOSED], q[status < FkStatus.NOT_CLOSED]
    assert len(opened) > 100
    assert len(closed) > 100
    assert not any(finds(name, legs, rng) for legs in opened[:100])
    # The other search is worth asking: it finds nearly all that ours does.
    assert np.mean([finds(name, legs, rng) for legs in closed[:40]]) > 0.9
