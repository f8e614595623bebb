"""The MMA's three tables: conventional (A), with dummy frames (B), with parallelogram (C).

They show how the closed form comes about and check it; the kernels never need them. Modified
Denavit-Hartenberg throughout, with signed d; joint vectors, in the order of their tables:

- A: θ1, θ2, θ3, θ4, θ5, θ6, θ7. Loses the offsets a5, a7, a9, a11; same attitude up to a turn.
- B: θ1, θ2, θ3, θ4, θ6, θ8, θ10. A serial arm that reaches the same poses as C.
- C: θ1, θ2, θ3, θ3'', θ4', θ6, θ8, θ10. θ3'' and θ4' are passive, given by the loop. The joint
  readings are θ1, θ2, θ3, θ3', θ6, θ8, θ10, the joint vector of the robot.

Source:
    Singh 2014, tables 4.1, 4.4, 4.8-4.10, eqs. 4.1, 4.45-4.62, misprints corrected.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from teleop_core.errors import ShapeError, UnknownNameError
from teleop_core.geometry import Array, checked_array

MODELS = ("A", "B", "C")
# Half of d5: the thesis only gives the sum of the two equal symbols a3 + a4'.
SHORT_SIDE = 0.03391
LINKS, JOINTS = 10, 10  # base included; the joint of three links counts twice
_QUARTER = 0.5 * math.pi


def independent_loops(links: int, joints: int) -> int:
    """Number of independent loops, base counted as a link (Singh 2014, eq. 3.16)."""
    return joints - (links - 1)


class Row(NamedTuple):
    """Row of a modified D-H table: a, alpha before the joint, d, and θ fixed or of a joint."""

    name: str
    a: float
    alpha: float
    d: float
    joint: int
    """Index in the model's joint vector; -1 for a fixed θ."""
    theta: float = 0.0
    """Fixed θ [rad]."""


class Loop(NamedTuple):
    """Where the two branches of the parallelogram meet; equal points and angles close it."""

    along_link_3a: Array
    """Point reached over links 3a and 3b (3,) [m]."""
    along_link_3: Array
    """Point reached over link 3 (3,) [m]."""
    frame_4: Array
    """Origin of frame 4', where link 4 leaves the parallelogram (3,) [m]."""


def vector(name: str, value: object, size: int) -> Array:
    """One finite vector of a size.

    Raises:
        ShapeError: Another shape.
        ParameterError: NaN or infinity.
    """
    array = checked_array(name, value, (size,))
    if array.ndim != 1:
        raise ShapeError(name, (size,), array.shape)
    return array


def _arm(g: Mapping[str, float]) -> list[Row]:
    return [
        Row("1", 0.0, 0.0, g["d1"], 0),
        Row("2", 0.0, -_QUARTER, 0.0, 1),
    ]


def _handle(g: Mapping[str, float], first: int) -> list[Row]:
    """Rows 6 to 12 of tables 4.4 and 4.10, less the a and alpha of row 6."""
    return [
        Row("7", 0.0, -_QUARTER, -g["d7"], -1, -_QUARTER),
        Row("8", g["a7"], 0.0, 0.0, first),
        Row("9", 0.0, -_QUARTER, -g["d9"], -1, _QUARTER),
        Row("10", g["a9"], 0.0, 0.0, first + 1),
        Row("11", 0.0, _QUARTER, g["d11"], -1, -_QUARTER),
        Row("12", g["a11"], 0.0, g["d12"], -1, g["theta12"]),
    ]


def table_a(g: Mapping[str, float]) -> tuple[Row, ...]:
    """Conventional table 4.1 of a geometry [m]; its d8 is d11 + d12."""
    return (
        *_arm(g),
        Row("3", g["a2"], 0.0, 0.0, 2),
        Row("4", g["a3"], 0.0, 0.0, 3),
        Row("5", 0.0, _QUARTER, g["d5"], 4),
        Row("6", 0.0, -_QUARTER, -g["d7"], 5),
        Row("7", 0.0, -_QUARTER, -g["d9"], 6),
        Row("8", 0.0, _QUARTER, g["d11"] + g["d12"], -1),
    )


def table_b(g: Mapping[str, float]) -> tuple[Row, ...]:
    """Table 4.4 of a geometry [m], serial with dummy frames; alpha of the last row corrected."""
    return (
        *_arm(g),
        Row("3", g["a2"], 0.0, 0.0, 2),
        Row("4", g["a3"], 0.0, 0.0, 3),
        Row("5", 0.0, _QUARTER, g["d5"], -1, -_QUARTER),
        Row("6", g["a5"], 0.0, 0.0, 4),
        *_handle(g, 5),
    )


def table_c(g: Mapping[str, float], short_side: float = SHORT_SIDE) -> tuple[Row, ...]:
    """Table 4.10 of a geometry [m]: over links 3a and 3b of the parallelogram to the tool."""
    return (
        *_arm(g),
        Row("3", g["a2"], 0.0, 0.0, 2),
        Row("3''", short_side, 0.0, 0.0, 3),
        Row("4'", g["a3"], 0.0, 0.0, 4),
        Row("5", short_side - g["d5"], _QUARTER, 0.0, -1, -_QUARTER),
        Row("6", g["a5"], _QUARTER, 0.0, 5),
        *_handle(g, 6),
    )


def frames(table: tuple[Row, ...], joints: Array) -> dict[str, Array]:
    """Transforms (4, 4) from the base to every frame of a table.

    Args:
        table: Rows.
        joints: Joint vector in the order of the table's model [rad].

    Returns:
        Frame name to transform; the last is the tool.

    Source:
        Craig 2005; Singh 2014, eq. 4.1.
    """
    transform, out = np.eye(4), {}
    for row in table:
        theta = row.theta if row.joint < 0 else joints[row.joint]
        c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(row.alpha), math.sin(row.alpha)
        step = np.array(
            [
                [c, -s, 0.0, row.a],
                [s * ca, c * ca, -sa, -sa * row.d],
                [s * sa, c * sa, ca, ca * row.d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        transform = transform @ step
        out[row.name] = transform
    return out


def passive_angles(q: object) -> Array:
    """θ3'' = θ3' - θ3 and θ4' = pi - θ3'' [rad] that close the loop, (2,) or (N, 2), of readings.

    Where θ3'' is 0 or pi the four links lie on one line and a real parallelogram could fold over;
    the formula stays on the side where opposite links are parallel.
    """
    joints = checked_array("q", q, (7,))
    knee = joints[..., 3] - joints[..., 2]
    return np.stack((knee, math.pi - knee), axis=-1)


def joints_of_model(q: object, model: str) -> Array:
    """Joint vector of model "A", "B" or "C" from joint readings q (7,) [rad]; see the module.

    Raises:
        UnknownNameError: No such model.
        ShapeError: Another shape.
        ParameterError: NaN or infinity.
    """
    if model not in MODELS:
        raise UnknownNameError("model", model, MODELS)
    joints = vector("q", q, 7)
    if model == "C":
        return np.concatenate((joints[:3], passive_angles(joints), joints[4:]))
    elbow = (joints[3], joints[2] + _QUARTER - joints[3])
    turns = (-_QUARTER, -_QUARTER, _QUARTER) if model == "A" else (0.0, 0.0, 0.0)
    return np.concatenate((joints[:2], elbow, joints[4:] + np.array(turns)))


def readings_of_serial(serial: object) -> Array:
    """Joint readings (7,) of the MMA from the joint vector (7,) of model B [rad]."""
    joints = vector("serial", serial, 7)
    return np.concatenate((joints[:2], (joints[2] + joints[3] - _QUARTER, joints[2]), joints[4:]))


def loop_closure(q: object, g: Mapping[str, float], short_side: float = SHORT_SIDE) -> Loop:
    """Both ways round the parallelogram for joint readings q (7,) [rad].

    Source:
        Singh 2014, eqs. 4.45-a, 4.53-a (sign corrected) and 4.66.
    """
    joints = vector("q", q, 7)
    knee, ankle = passive_angles(joints)
    upper, short, long = joints[1], joints[1] + joints[2], joints[1] + joints[3]
    start = ((g["a2"], upper),)
    over_3a = ((short_side, short), (g["a3"], short + knee), (short_side, short + knee + ankle))
    return Loop(
        along_link_3a=_in_plane(g["d1"], joints[0], start + over_3a),
        along_link_3=_in_plane(g["d1"], joints[0], (*start, (g["a3"], long))),
        frame_4=_in_plane(g["d1"], joints[0], start + over_3a[:2]),
    )


def _in_plane(d1: float, yaw: float, links: tuple[tuple[float, float], ...]) -> Array:
    """Point (3,) [m] at the end of links (length, angle below the horizon) in the arm's plane."""
    radius = sum(length * math.cos(angle) for length, angle in links)
    fall = sum(length * math.sin(angle) for length, angle in links)
    return np.array([math.cos(yaw) * radius, math.sin(yaw) * radius, d1 - fall])
