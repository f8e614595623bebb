"""Description of a robot: one line for the prompt, a page of text, a table for notebooks."""

import math
from collections.abc import Iterator
from html import escape

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.kinematics import DIRECTIONS
from teleop_core.robots.arm import Arm
from teleop_core.robots.freedom import freedom, lever
from teleop_core.robots.rank import directions_of

_OF_CHAINS = "fixed0_00"  # geometry symbol that only chains from tables have: an element of a matrix


def short(robot: Arm) -> str:
    """One line: name, number of joints, limits [rad, m] of each."""
    joints = ", ".join(f"{name} {lower:.4g}…{upper:.4g}" for name, lower, upper, _ in rows(robot))
    return f"Robot {robot.name!r}, {robot.n} joints [rad, m]: {joints}"


def text(robot: Arm) -> str:
    """Page with the controlled directions, joints, drives, geometry, room to move, and the pose of the tip at home."""
    lines = [f"{robot.name}: {robot.n} joints [rad, m], controls {controlled(robot)} of the tip"]
    if (rank := directions_of(robot, lever(robot)).rank) < len(DIRECTIONS):
        lines.append(f"the tip moves in {rank} of 6 directions at once; task=... chooses which")
    for row, start in zip(rows(robot), robot.start.tolist(), strict=True):
        lines.append("  {:14} {:9.4f} … {:8.4f}   home {:8.4f}   start {:8.4f}".format(*row, start))
    lines += [f"room at {name}: {room_text(robot, q)}" for name, q in postures(robot).items()]
    lines.append(f"drives: {drives(robot)}")
    if robot.solution:
        lines.append(f"inverse kinematics: {robot.solution}")
    if _OF_CHAINS not in robot.geometry:
        lines.append("geometry: " + ", ".join(f"{k} = {v:g}" for k, v in robot.geometry.items()))
    tip = np.array2string(robot.solve_fk(robot.home).T, precision=4, suppress_small=True)
    return "\n".join([*lines, "T_base_tip at home:", tip])


def html(robot: Arm) -> str:
    """Small table of the joints with their limits and home [rad, m]."""
    head = "".join(f"<th>{name}</th>" for name in ("joint", "lower", "upper", "home"))
    body = "".join(
        f"<tr><td>{escape(name)}</td>" + "".join(f"<td>{v:.4f}</td>" for v in values) + "</tr>"
        for name, *values in rows(robot)
    )
    caption = f"{escape(robot.name)}: {robot.n} joints [rad, m]; drives {escape(drives(robot))}"
    return f"<table><caption>{caption}</caption><tr>{head}</tr>{body}</table>"


def postures(robot: Arm) -> dict[str, Array]:
    """Postures home and start by their names; a single entry if the two postures are equal."""
    if np.array_equal(robot.home, robot.start):
        return {"home and start": robot.home}
    return {"home": robot.home, "start": robot.start}


def room_text(robot: Arm, q: Array) -> str:
    """How far the tip can go from a posture in its worst direction, in millimetres and degrees."""
    metres, radians = freedom(robot, q)
    ways = [f"{1e3 * metres:.0f} mm"] if math.isfinite(metres) else []
    ways += [f"{math.degrees(radians):.0f}°"] if math.isfinite(radians) else []
    return " and ".join(ways) + " in the worst direction"


def rows(robot: Arm) -> Iterator[tuple[str, float, float, float]]:
    """Name, lower, upper and home [rad, m] of each joint."""
    columns = (robot.lower.tolist(), robot.upper.tolist(), robot.home.tolist())
    return zip(robot.joint_names, *columns, strict=True)


def controlled(robot: Arm) -> str:
    """Directions of the tip that the robot controls."""
    pairs = zip(DIRECTIONS, robot.task_mask, strict=True)
    return ", ".join(name for name, is_controlled in pairs if is_controlled)


def drives(robot: Arm) -> str:
    """Whether the robot can be a slave, and which entries of its drive table are assumed."""
    if robot.drives is None:
        return "none, not a slave"
    if not robot.drives_are_assumed:
        return "as stated"
    assumed, entries = robot.drives.assumed, robot.drives.entries()
    which = "all" if set(assumed) == set(entries) else ", ".join(assumed)
    return f"assumed ({which})"
