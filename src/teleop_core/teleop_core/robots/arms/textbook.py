"""Textbook arms: PUMA 560, SCARA, planar 3R, a five-axis arm, and the pointer of a screen, each a table.

Sources:
    Ghosal 2020, lecture 6 (PUMA 560, SCARA, planar 3R; misprints corrected). Lengths of the PUMA: Corke and
    Armstrong-Hélouvry 1994; its joint ranges: Wang and Chen 1991; both as quoted in roboticstoolbox, converted to this
    table's zeros. Five-axis arm: table 3.4 of the MMA thesis (its Microbot Alpha II and Rhino XR-3), with the home of
    joint 4 corrected. All other numbers are assumed for arms of this size, because the lecture and the thesis print no
    lengths.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import DIRECTIONS
from teleop_core.robots.arms.dh import parse_table
from teleop_core.robots.drives import ENTRIES, Drives
from teleop_core.robots.robot import Robot, geometry_of

_MOST = 10.0  # largest absolute value of a length that is accepted [m]
_DEGREES = math.pi / 180.0
# Result of :func:`teleop_core.robots.freedom.start_posture` for the published lengths, rounded.
_PUMA_START = (-0.4783, -1.6627, -0.035, 0.3949, 1.0084, -0.57)


def puma560(**geometry: float | str) -> Robot:
    """PUMA 560; ``a2`` upper arm, ``d4`` forearm, ``d3`` and ``a3`` their offsets [m].

    Six turning joints, with a spherical wrist whose centre is the tip. At home the upper arm points
    45° up, the forearm is level, the tool points 45° down.
    """
    published = {"a2": 0.4318, "a3": 0.0203, "d3": 0.15005, "d4": 0.4318}
    g = geometry_of(published, geometry)
    rows = [
        _turn(160.0),
        _turn(45.0, -225.0, -45.0, alpha=-90.0),
        _turn(45.0, -225.0, -45.0, a=g["a2"], d=g["d3"]),
        _turn(170.0, -110.0, alpha=-90.0, a=g["a3"], d=g["d4"]),
        _turn(100.0, home=45.0, alpha=90.0),
        _turn(266.0, alpha=-90.0),
    ]
    if g == published:
        for row, start in zip(rows, _PUMA_START, strict=True):
            row["start"] = math.degrees(start)
    drives = _drives(  # quoted from memory, not checked
        inertia=(2.6, 6.8, 1.16, 0.20, 0.18, 0.19),
        viscous=(4.9, 8.2, 3.5, 0.4, 0.4, 0.3),
        coulomb=(6.3, 5.5, 2.6, 1.3, 1.0, 1.2),
        friction_speed=(0.01,) * 6,
        effort_limit=(97.6, 186.4, 89.4, 24.2, 20.1, 21.3),
        speed_limit=np.array([82.0, 74.0, 122.0, 228.0, 241.0, 228.0]) * _DEGREES,
        encoder_step=np.array([1.0, 0.7, 1.2, 0.9, 0.9, 0.9]) * 1e-4,
    )
    return _arm("puma560", g, DIRECTIONS, rows, drives)


def scara(**geometry: float | str) -> Robot:
    """SCARA of electronic assembly; ``a1``, ``a2`` links [m]. A positive d3 lowers the tool."""
    g = geometry_of({"a1": 0.4, "a2": 0.3}, geometry)
    rows = [
        _turn(150.0, home=-45.0),
        _turn(150.0, home=90.0, a=g["a1"]),
        {"name": "d3", "a": g["a2"], "d": "-q", "lower": 0.0, "upper": 0.2, "home": 0.1},
        _turn(360.0, home=-45.0),
    ]
    drives = _drives(
        inertia=(0.6, 0.2, 6.0, 0.01),
        viscous=(1.0, 0.5, 20.0, 0.02),
        coulomb=(0.5, 0.3, 2.0, 0.02),
        friction_speed=(0.01, 0.01, 0.001, 0.02),
        effort_limit=(60.0, 30.0, 150.0, 4.0),
        speed_limit=(6.0, 8.0, 1.0, 20.0),
        encoder_step=(1e-5, 1e-5, 1e-6, 5e-5),
    )
    return _arm("scara", g, ("x", "y", "z", "rz"), rows, drives)


def planar_3r(**geometry: float | str) -> Robot:
    """Planar arm of three joints; ``l1``, ``l2`` links, ``l3`` tool [m]."""
    g = geometry_of({"l1": 1.0, "l2": 0.8, "l3": 0.5}, geometry)
    rows: list[dict[str, Any]] = [
        _turn(170.0, home=30.0),
        _turn(160.0, home=60.0, a=g["l1"]),
        _turn(170.0, home=-30.0, a=g["l2"]),
        {"a": g["l3"]},
    ]
    drives = _drives(
        inertia=(3.0, 1.0, 0.1),
        viscous=(2.0, 1.0, 0.1),
        coulomb=(1.0, 0.5, 0.05),
        friction_speed=(0.01,) * 3,
        effort_limit=(150.0, 60.0, 10.0),
        speed_limit=(3.0, 3.0, 6.0),
        encoder_step=(1e-5,) * 3,
    )
    return _arm("planar_3r", g, ("x", "y", "rz"), rows, drives)


def five_axis(**geometry: float | str) -> Robot:
    """Five-axis arm; ``d1`` shoulder height, ``a2``, ``a3`` links, ``d5`` tool [m].

    Its joints are yaw, three parallel pitches, roll. The tool stays in the vertical plane of joint 1. At home the tool
    points down, and the direction that the arm cannot control is the rotation about x.
    """
    g = geometry_of({"d1": 0.215, "a2": 0.1778, "a3": 0.1778, "d5": 0.1295}, geometry)
    rows: list[dict[str, Any]] = [
        _turn(150.0, d=g["d1"]),
        _turn(35.0, -145.0, -60.0, alpha=-90.0),
        _turn(150.0, -10.0, 90.0, a=g["a2"]),
        _turn(150.0, home=-30.0, a=g["a3"]),
        _turn(270.0, alpha=-90.0),
        {"d": g["d5"]},
    ]
    drives = _drives(
        inertia=(0.15, 0.15, 0.08, 0.02, 0.01),
        viscous=(0.3, 0.3, 0.2, 0.05, 0.02),
        coulomb=(0.2, 0.2, 0.15, 0.05, 0.02),
        friction_speed=(0.01,) * 5,
        effort_limit=(15.0, 15.0, 10.0, 4.0, 2.0),
        speed_limit=(1.5, 1.5, 2.0, 3.0, 4.0),
        encoder_step=(5e-5,) * 5,
    )
    return _arm("five_axis", g, ("x", "y", "z", "ry", "rz"), rows, drives)


def pointer(**geometry: float | str) -> Robot:
    """Pointer of a screen, as of a mouse: it slides along z and y of its base, nearly without friction.

    ``x`` is the distance of the screen from the base [m]. With a control law that feeds the reference forward, such as
    ``computed_torque``, and without the reference filter, the pointer follows its command within 1 ms.
    """
    g = geometry_of({"x": 0.3}, geometry)
    slide = {"lower": -1.0, "upper": 1.0}
    rows = [{"name": "up", "a": g["x"], "d": "q", **slide}, {"name": "aside", "alpha": 90.0, "d": "-q", **slide}]
    drives = _drives(
        bandwidth=500.0,
        inertia=(0.1, 0.1),
        viscous=(1e-3, 1e-3),
        coulomb=(1e-3, 1e-3),
        friction_speed=(1e-3, 1e-3),
        effort_limit=(1e3, 1e3),
        speed_limit=(20.0, 20.0),
        encoder_step=(1e-6, 1e-6),
    )
    return _arm("pointer", g, ("y", "z"), rows, drives)


def _turn(upper: float, lower: float | None = None, home: float = 0.0, **constants: float) -> dict[str, Any]:
    """Row of a turning joint, with limits and home [°]."""
    limits = {"lower": -upper if lower is None else lower, "upper": upper, "home": home}
    return {"theta": "q", **limits, **constants}


def _drives(bandwidth: float = 60.0, **entries: Sequence[float] | Array) -> Drives:
    """Drive table, all of it assumed."""
    rows = {name: np.array(values) for name, values in entries.items()}
    return Drives(**rows, bandwidth=np.full(len(rows["inertia"]), bandwidth), assumed=ENTRIES)


def _arm(
    name: str, geometry: Mapping[str, float], task: Sequence[str], rows: Sequence[dict[str, Any]], drives: Drives
) -> Robot:
    """Robot of a table in the modified (Craig) convention, in degrees."""
    for symbol, value in geometry.items():
        if abs(value) > _MOST:
            raise ParameterError(symbol, value, f"between -{_MOST:g} and {_MOST:g} m")
    named = [{"name": f"theta{i + 1}", **row} for i, row in enumerate(rows)]
    table = {"name": name, "convention": "modified", "angles": "degrees", "task": list(task)}
    return parse_table({**table, "rows": named}).robot(geometry, drives)
