"""Chains: serial arms from any source, converted to a chain of links, as drawn and as built."""

import math
from typing import Any

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import dh_kernels
from teleop_core.robots.arms import dh, rcrt1
from teleop_core.robots.link_errors import Chain, LinkErrors
from teleop_core.robots.robot import Robot


def chain_of(robot: Robot) -> Chain | None:
    """The robot as a chain; None for a parallel robot, and for a robot with followers."""
    if "motions" in robot.geometry:
        return None
    if robot.kernels.fk is rcrt1.fk:
        row = dh.robot_from_table(_table(robot)).geometry_row
    elif robot.kernels.fk is dh_kernels.fk:
        row = robot.geometry_row
    else:
        return None
    n = robot.n
    fixed = np.tile(np.eye(4), (n + 1, 1, 1))
    fixed[:, :3] = row[n + 7 : n + 7 + 12 * (n + 1)].reshape(n + 1, 3, 4)
    return Chain(kinds=row[:n].copy(), fixed=fixed, row=row)


def true_chain(robot: Robot, errors: LinkErrors) -> Array | None:
    """Geometry row of the arm as built, for the kernels of chains.

    Args:
        robot: The arm as drawn.
        errors: Errors of its n links.

    Returns:
        The row, a new array. With it, ``dh_kernels.fk`` takes the robot's own joint vectors. None for a robot that is
        not a chain.

    Raises:
        ParameterError: The errors are for a different number of links.
    """
    if errors.n != robot.n:
        raise ParameterError("errors", f"for {errors.n} links", f"for {robot.n}, as {robot.name}")
    chain = chain_of(robot)
    return None if chain is None else chain.built(errors)


def _table(robot: Robot) -> dict[str, Any]:
    """Denavit-Hartenberg table of the RCRT-1, which has kernels of its own."""
    g, right, turn = robot.geometry, 0.5 * math.pi, {"theta": "q"}
    rows: list[dict[str, Any]] = [
        turn | {"alpha": -right},
        turn | {"alpha": right, "d": g["d2"]},
        {"d": "q"},
        turn | {"alpha": -right},
        turn | {"alpha": right},
        turn | {"d": g["L6"]},
    ]
    for row, name, lower, upper in zip(
        rows, robot.joint_names, robot.lower.tolist(), robot.upper.tolist(), strict=True
    ):
        row |= {"name": name, "lower": lower, "upper": upper}
    return {"name": robot.name, "convention": "standard", "rows": rows}
