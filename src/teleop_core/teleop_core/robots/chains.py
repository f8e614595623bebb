"""Chains: serial arms of any origin as one chain of links, as drawn and as built."""

import math
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from teleop_core.base.errors import ParameterError
from teleop_core.kernels.geometry import Array
from teleop_core.robots import dh_kernels
from teleop_core.robots.dh import robot_from_table
from teleop_core.robots.link_errors import Chain, LinkErrors
from teleop_core.robots.robot import Robot


def chain_of(robot: Robot) -> Chain | None:
    """The robot as a chain; None for one that is none: a parallel robot, or one with followers."""
    if "motions" in robot.geometry:
        return None
    if robot.kernels.fk is dh_kernels.fk:
        row = robot.geometry_row
    else:
        table = _built_in_table(robot)
        if table is None:
            return None
        row = robot_from_table(table).geometry_row
    n = robot.n
    fixed = np.tile(np.eye(4), (n + 1, 1, 1))
    fixed[:, :3] = row[n + 7 : n + 7 + 12 * (n + 1)].reshape(n + 1, 3, 4)
    return Chain(kinds=row[:n].copy(), fixed=fixed, row=row)


def true_chain(robot: Robot, errors: LinkErrors) -> Array | None:
    """Geometry row of the arm as built, for the kernels of :mod:`teleop_core.robots.dh_kernels`.

    Args:
        robot: The arm as drawn.
        errors: What its links are off, n of them.

    Returns:
        The row, a new array, on which ``dh_kernels.fk`` takes the robot's own joint vectors; None
        for robots that are no chain.

    Raises:
        ParameterError: Errors of another number of links.
    """
    if errors.n != robot.n:
        raise ParameterError("errors", f"for {errors.n} links", f"for {robot.n}, as {robot.name}")
    chain = chain_of(robot)
    return None if chain is None else chain.built(errors)


def _built_in_table(robot: Robot) -> dict[str, Any] | None:
    """Denavit-Hartenberg table of a chain of ours that has kernels of its own."""
    make = _TABLES.get(robot.name)
    if make is None:
        return None
    module = import_module(f"teleop_core.robots.{robot.name}")
    if robot.kernels.fk is not module.fk:
        return None  # somebody else's robot of the same name
    convention, rows = make(dict(robot.geometry))
    moving = [row for row in rows if not {"q", "-q"}.isdisjoint(row.values())]
    for i, row in enumerate(moving):
        limits = {"lower": float(robot.lower[i]), "upper": float(robot.upper[i])}
        row |= {"name": robot.joint_names[i], **limits}
    return {"name": robot.name, "convention": convention, "rows": rows}


_Table = tuple[str, list[dict[str, Any]]]
_RIGHT = 0.5 * math.pi


def _rcrt1(g: Mapping[str, float]) -> _Table:
    turn: dict[str, Any] = {"theta": "q"}
    return "standard", [
        turn | {"alpha": -_RIGHT}, turn | {"alpha": _RIGHT, "d": g["d2"]}, {"d": "q"},
        turn | {"alpha": -_RIGHT}, turn | {"alpha": _RIGHT}, turn | {"d": g["L6"]},
    ]  # fmt: skip


def _puma560(g: Mapping[str, float]) -> _Table:
    turn: dict[str, Any] = {"theta": "q"}
    return "modified", [
        turn | {}, turn | {"alpha": -_RIGHT}, turn | {"a": g["a2"], "d": g["d3"]},
        turn | {"alpha": -_RIGHT, "a": g["a3"], "d": g["d4"]}, turn | {"alpha": _RIGHT},
        turn | {"alpha": -_RIGHT},
    ]  # fmt: skip


def _scara(g: Mapping[str, float]) -> _Table:
    return "modified", [
        {"theta": "q"}, {"theta": "q", "a": g["a1"]}, {"a": g["a2"], "d": "-q"}, {"theta": "q"},
    ]  # fmt: skip


def _planar_3r(g: Mapping[str, float]) -> _Table:
    return "modified", [
        {"theta": "q"}, {"theta": "q", "a": g["l1"]}, {"theta": "q", "a": g["l2"]}, {"a": g["l3"]},
    ]  # fmt: skip


def _five_axis(g: Mapping[str, float]) -> _Table:
    turn: dict[str, Any] = {"theta": "q"}
    return "modified", [
        turn | {"d": g["d1"]}, turn | {"alpha": -_RIGHT}, turn | {"a": g["a2"]},
        turn | {"a": g["a3"]}, turn | {"alpha": -_RIGHT}, {"d": g["d5"]},
    ]  # fmt: skip


_TABLES: dict[str, Callable[[Mapping[str, float]], _Table]] = {
    "rcrt1": _rcrt1, "puma560": _puma560, "scara": _scara, "planar_3r": _planar_3r,
    "five_axis": _five_axis,
}  # fmt: skip
