"""Planar loops: bodies of the four-bar and of the parallelogram."""

import math

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.robots.bodies.frames import pose
from teleop_core.robots.body import Bodies, Body, Coordinates, Joint
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import Solid, ball, capsule, cylinder
from teleop_machines.four_bar_loop import FourBar

_UP = np.array([0.0, 0.0, 1.0])


def four_bar_bodies(robot: Robot) -> Bodies:
    """Crank, coupler and rocker; if the loop does not close, the coupler's end is not at the rocker's end.

    Coordinates after the joint: angle of the coupler relative to the crank, angle of the rocker relative to the base
    [rad].
    """
    g = robot.geometry
    loop, mode = FourBar(g["l0"], g["l1"], g["l2"], g["l3"]), 0 if g["mode"] > 0.0 else 1

    def coordinates(q: Array) -> tuple[Array, Array]:
        closed = loop.close(q[:, 0])
        passive = closed.phi2[:, mode], closed.phi1[:, mode]
        return np.column_stack((q, *passive)), _no_free(q)

    return _loop((loop.l0, loop.l1, loop.l2, loop.l3), g["a"], coordinates)


def parallelogram_bodies(robot: Robot) -> Bodies:
    """Crank, coupler and rocker; the coupler never rotates, the rocker rotates like the crank."""
    g = robot.geometry

    def coordinates(q: Array) -> tuple[Array, Array]:
        return np.column_stack((q, -q, q)), _no_free(q)

    return _loop((g["l0"], g["l1"], g["l0"], g["l1"]), g["a"], coordinates)


def _loop(lengths: tuple[float, float, float, float], tip: float, coordinates: Coordinates) -> Bodies:
    """Bodies of a loop of ground, crank, coupler, rocker [m], the tip on the coupler."""
    ground, crank, coupler, rocker = lengths
    radius = 0.03 * max(lengths)
    pivots = np.array([[0.0, 0.0, 0.0], [ground, 0.0, 0.0]])
    feet = (cylinder(point, _UP, 2.0 * radius, 2.0 * radius, "base") for point in pivots)
    base = Body("base", (capsule(pivots[0], pivots[1], radius, "base"), *feet), -1)
    point = capsule(np.zeros(3), np.array([tip, 0.0, 0.0]), radius, "link")
    bodies = (
        base,
        Body("crank", pivoted(crank, radius), 0, Joint.REVOLUTE, pose(), 0),
        Body("coupler", (*pivoted(coupler, radius), point), 1, Joint.REVOLUTE, pose(crank), 1),
        Body("rocker", pivoted(rocker, radius), 0, Joint.REVOLUTE, pose(ground), 2),
        Body("tip", (ball(np.zeros(3), 1.5 * radius, "tool"),), 2, origin=pose(tip)),
    )
    return Bodies(bodies, 1, coordinates, (1,), max(lengths) + math.fabs(tip))


def pivoted(length: float, radius: float) -> tuple[Solid, ...]:
    """Link of a length [m] along x that turns about z at its beginning."""
    end = np.array([length, 0.0, 0.0])
    joint = cylinder(np.zeros(3), _UP, 1.5 * radius, 3.2 * radius, "joint")
    return (joint, capsule(np.zeros(3), end, radius, "link"))


def _no_free(q: Array) -> Array:
    return np.empty((len(q), 0, 7))
