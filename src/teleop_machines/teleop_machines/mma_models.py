"""The MMA's three tables: conventional (A), with dummy frames (B), with parallelogram (C).

They show the derivation of the closed form and check it; the kernels never need them. Modified
Denavit-Hartenberg throughout, with signed d; joint vectors, in the order of their tables:

- A: θ1, θ2, θ3, θ4, θ5, θ6, θ7. It lacks the offsets a5, a7, a9, a11; its attitude is that of C up to a fixed rotation.
- B: θ1, θ2, θ3, θ4, θ6, θ8, θ10. A serial arm that reaches the same poses as C.
- C: θ1, θ2, θ3, θ3'', θ4', θ6, θ8, θ10. θ3'' and θ4' are passive; the loop determines them. The joint readings are θ1,
  θ2, θ3, θ3', θ6, θ8, θ10, the joint vector of the robot.

Source:
    Singh 2014, tables 4.1, 4.4, 4.8-4.10, eqs. 4.1, 4.45-4.62, misprints corrected.
"""

import math
from collections.abc import Mapping
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from teleop_core.base import ShapeError, UnknownNameError
from teleop_core.kernels import Array, checked_array, product
from teleop_core.robots.arms.dh import DhJoint, DhRow, DhTable

# Half of d5, because the thesis states only the sum of the two equal lengths a3 + a4'.
SHORT_SIDE = 0.03391
LINKS = 10  # number of links, base included
JOINTS = 10  # number of joints; the joint of three links counts twice
_QUARTER = 0.5 * math.pi
# Frames of the tables from the base to the tool.
FRAMES = {
    "A": ("1", "2", "3", "4", "5", "6", "7", "8"),
    "B": ("1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12"),
    "C": ("1", "2", "3", "3''", "4'", "5", "6", "7", "8", "9", "10", "11", "12"),
}
MODELS = tuple(FRAMES)


class LoopEnds(NamedTuple):
    """End points of the two branches of the parallelogram; the loop is closed if points and angles are equal."""

    along_link_3a: Array
    """End point (3,) [m] of the branch over links 3a and 3b."""
    along_link_3: Array
    """End point (3,) [m] of the branch over link 3."""
    frame_4: Array
    """Origin of frame 4', where link 4 leaves the parallelogram (3,) [m]."""


def _check_model(model: str) -> None:
    if model not in MODELS:
        raise UnknownNameError("model", model, MODELS)


def vector(name: str, value: object, size: int) -> Array:
    """One finite vector of length ``size``.

    Raises:
        ShapeError: The shape of ``value`` is not (``size``,).
        ParameterError: ``value`` contains NaN or infinity.
    """
    array = checked_array(name, value, (size,))
    if array.ndim != 1:
        raise ShapeError(name, (size,), array.shape)
    return array


def model_table(model: str, g: Mapping[str, float], short_side: float = SHORT_SIDE) -> DhTable:
    """D-H table of model "A", "B" or "C" over a geometry [m]; in A, d8 is d11 + d12.

    The alpha of the last row of B, printed as 90°, is corrected to 0.

    Raises:
        UnknownNameError: No such model.
    """
    _check_model(model)
    wrist = {"A": _wrist_a, "B": _wrist_b, "C": _wrist_c}[model]
    rows = (
        _row("theta1", d=g["d1"]),
        _row("theta2", alpha=-_QUARTER),
        _row("theta3", a=g["a2"]),
        *wrist(g, short_side),
    )
    return DhTable(name=model, convention="modified", rows=rows)


def _row(joint: str = "", *, a: float = 0.0, alpha: float = 0.0, d: float = 0.0, theta: float = 0.0) -> DhRow:
    return DhRow(
        constants={"a": a, "alpha": alpha, "d": d, "theta": theta},
        joint=DhJoint(name=joint, symbol="theta", sign=1.0, lower=-math.pi, upper=math.pi, home=0.0) if joint else None,
    )


def _wrist_a(g: Mapping[str, float], _short_side: float) -> tuple[DhRow, ...]:
    return (
        _row("theta4", a=g["a3"]),
        _row("theta5", alpha=_QUARTER, d=g["d5"]),
        _row("theta6", alpha=-_QUARTER, d=-g["d7"]),
        _row("theta7", alpha=-_QUARTER, d=-g["d9"]),
        _row(alpha=_QUARTER, d=g["d11"] + g["d12"]),
    )


def _wrist_b(g: Mapping[str, float], _short_side: float) -> tuple[DhRow, ...]:
    return (
        _row("theta4", a=g["a3"]),
        _row(alpha=_QUARTER, d=g["d5"], theta=-_QUARTER),
        _row("theta6", a=g["a5"]),
        *_handle(g),
    )


def _wrist_c(g: Mapping[str, float], short_side: float) -> tuple[DhRow, ...]:
    """Rows of model C over links 3a and 3b of the parallelogram."""
    return (
        _row("theta3''", a=short_side),
        _row("theta4'", a=g["a3"]),
        _row(a=short_side - g["d5"], alpha=_QUARTER, theta=-_QUARTER),
        _row("theta6", a=g["a5"], alpha=_QUARTER),
        *_handle(g),
    )


def _handle(g: Mapping[str, float]) -> tuple[DhRow, ...]:
    """Rows 7 to 12 of tables 4.4 and 4.10."""
    return (
        _row(alpha=-_QUARTER, d=-g["d7"], theta=-_QUARTER),
        _row("theta8", a=g["a7"]),
        _row(alpha=-_QUARTER, d=-g["d9"], theta=_QUARTER),
        _row("theta10", a=g["a9"]),
        _row(alpha=_QUARTER, d=g["d11"], theta=-_QUARTER),
        _row(a=g["a11"], d=g["d12"], theta=g["theta12"]),
    )


def frames(table: DhTable, joints: object) -> dict[str, Array]:
    """Transforms (4, 4) from the base to every frame of a model's table, by :data:`FRAMES`.

    Args:
        table: Result of :func:`model_table`.
        joints: Joint vector in the order of the model [rad].

    Raises:
        ShapeError: The length of ``joints`` does not fit the model.
        ParameterError: ``joints`` contains NaN or infinity.
    """
    steps = accumulate(table.link_transforms(joints), product)
    return dict(zip(FRAMES[table.name], steps, strict=True))


def passive_angles(q: object) -> Array:
    """θ3'' = θ3' - θ3 and θ4' = pi - θ3'' [rad] that close the loop, (2,) or (N, 2), of readings.

    If θ3'' is 0 or pi, the four links are on one line, and a real parallelogram could change to its crossed mode. The
    formula stays in the mode in which opposite links are parallel.
    """
    joints = checked_array("q", q, (7,))
    knee = joints[..., 3] - joints[..., 2]
    return np.stack((knee, math.pi - knee), axis=-1)


def joints_of_model(q: object, model: str) -> Array:
    """Joint vector of model "A", "B" or "C" from joint readings q (7,) [rad]; see the module.

    Raises:
        UnknownNameError: There is no such model.
        ShapeError: ``q`` is not (7,).
        ParameterError: ``q`` contains NaN or infinity.
    """
    _check_model(model)
    joints = vector("q", q, 7)
    if model == "C":
        return np.concatenate((joints[:3], passive_angles(joints), joints[4:]))
    elbow = (joints[3], joints[2] + _QUARTER - joints[3])
    turns = (-_QUARTER, -_QUARTER, _QUARTER) if model == "A" else (0.0, 0.0, 0.0)
    return np.concatenate((joints[:2], elbow, joints[4:] + np.array(turns)))


def loop_closure(q: object, g: Mapping[str, float], short_side: float = SHORT_SIDE) -> LoopEnds:
    """End points of the two branches of the parallelogram for joint readings q (7,) [rad].

    Source:
        Singh 2014, eqs. 4.45-a, 4.53-a (sign corrected) and 4.66.
    """
    joints = vector("q", q, 7)
    knee, ankle = passive_angles(joints)
    upper, short, long = joints[1], joints[1] + joints[2], joints[1] + joints[3]
    start = ((g["a2"], upper),)
    over_3a = ((short_side, short), (g["a3"], short + knee), (short_side, short + knee + ankle))
    return LoopEnds(
        along_link_3a=_in_plane(g["d1"], joints[0], start + over_3a),
        along_link_3=_in_plane(g["d1"], joints[0], (*start, (g["a3"], long))),
        frame_4=_in_plane(g["d1"], joints[0], start + over_3a[:2]),
    )


def _in_plane(d1: float, yaw: float, links: tuple[tuple[float, float], ...]) -> Array:
    """Point (3,) [m] at the end of links (length, angle below the horizon) in the arm's plane."""
    radius = sum(length * math.cos(angle) for length, angle in links)
    fall = sum(length * math.sin(angle) for length, angle in links)
    return np.array([math.cos(yaw) * radius, math.sin(yaw) * radius, d1 - fall])
