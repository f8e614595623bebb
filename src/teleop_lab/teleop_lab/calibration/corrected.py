"""Corrected arm: the result of a calibration as a Denavit-Hartenberg table for sessions."""

import math
from collections.abc import Iterator, Mapping
from typing import TypeAlias

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import DIRECTIONS
from teleop_core.robots.link_errors import Chain, LinkErrors, next_axis_motion
from teleop_core.robots.robot import Robot

Comparison: TypeAlias = dict[str, float | str]
Table: TypeAlias = dict[str, str | list[str] | list[Comparison] | dict[str, dict[str, float]]]
_STATED = ("inertia", "viscous", "coulomb", "friction_speed", "effort_limit", "speed_limit",
           "encoder_step", "bandwidth")  # fmt: skip


def corrected_table(robot: Robot, errors: LinkErrors) -> Table:
    """Table of the real arm in the standard convention, in radians and metres.

    Joint vectors, limits, postures and drives are equal to those of the nominal robot. Link inertias are lost, because
    a table cannot contain them.

    Raises:
        ParameterError: The robot is not a chain.
    """
    from teleop_lab.calibration.model import ChainModel

    chain = ChainModel.of(robot).chain
    rows = list(_rows(robot, chain, errors))
    table: Table = {"name": f"{robot.name}_calibrated", "convention": "standard"}
    task = [name for name, is_on in zip(DIRECTIONS, robot.task_mask, strict=True) if is_on]
    table |= {"task": task, "rows": rows}
    if robot.drives is not None:
        entries = robot.drives.entries()
        table["drives"] = {
            joint: {name: float(entries[name][i]) for name in _STATED} for i, joint in enumerate(robot.joint_names)
        }
    return table


def _rows(robot: Robot, chain: Chain, errors: LinkErrors) -> Iterator[Comparison]:
    """Rows of all links; further transforms before or after the links add a row at that end of the table."""
    first, S = _links(chain.fixed[0])
    if any(abs(value) > 0.0 for value in first.values()):
        yield dict(first)
    for i in range(chain.n):
        drawn, after = _links(chain.fixed[i + 1])
        row: Comparison = {
            "theta": S[0] + drawn["theta"] + float(errors.theta[i]),
            "d": S[1] + drawn["d"] + float(errors.d[i]),
            "a": drawn["a"] + float(errors.a[i]),
            "alpha": drawn["alpha"] + float(errors.alpha[i]),
        }
        symbol = "d" if abs(chain.kinds[i]) > 1.5 else "theta"
        row[symbol] = _with_joint(float(row[symbol]), chain.kinds[i] < 0.0)
        yield row | _joint(robot, i)
        S = after
    if S != (0.0, 0.0):
        yield {"theta": S[0], "d": S[1]}


def _links(F: Array) -> tuple[Mapping[str, float], tuple[float, float]]:
    """Return the link parameters of one transform, and the remaining rotation and translation along the next axis."""
    S = next_axis_motion(F)
    L = F @ np.linalg.inv(S)
    theta, alpha = math.atan2(L[1, 0], L[0, 0]), math.atan2(L[2, 1], L[2, 2])
    a = float(L[0, 3] * math.cos(theta) + L[1, 3] * math.sin(theta))
    link = {"theta": theta, "d": float(L[2, 3]), "a": a, "alpha": alpha}
    return link, (math.atan2(S[1, 0], S[0, 0]), float(S[2, 3]))


def _with_joint(constant: float, is_against: bool) -> str:
    text = "-q" if is_against else "q"
    if constant == 0.0:
        return text
    # Expressions of a table cannot contain exponents.
    return f"{text} {'-' if constant < 0.0 else '+'} {np.format_float_positional(abs(constant))}"


def _joint(robot: Robot, i: int) -> Comparison:
    return {
        "name": robot.joint_names[i],
        "lower": float(robot.lower[i]),
        "upper": float(robot.upper[i]),
        "home": float(robot.home[i]),
        "start": float(robot.start[i]),
    }
