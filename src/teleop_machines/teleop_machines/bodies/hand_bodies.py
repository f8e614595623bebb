"""Hand: bodies of the three-fingered hand and of the object that it holds."""

import math

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.robots.bodies.frames import pose, tips
from teleop_core.robots.body import HERE, Bodies, Body, Joint
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import ball, capsule, rim
from teleop_machines import hand_grasp, rps3_loop
from teleop_machines.bodies.planar import pivoted

_UP = np.array([0.0, 0.0, 1.0])


def hand_bodies(robot: Robot) -> Bodies:
    """Palm, three fingers of three links, and the object at the contact points."""
    g = robot.geometry
    roots = (pose(0.0, -g["d"], g["h"]), pose(0.0, g["d"], g["h"]), pose(axis="y", angle=g["gamma"]))
    radius = 0.05 * max(g["h"], g["d"], g["l11"] + g["l12"] + g["l13"])
    feet = [root[:3] for root in roots]
    palm = rim(np.array(feet), radius, "base")
    bodies = [Body("base", palm or (ball(np.zeros(3), radius, "base"),), -1)]
    for finger, root in enumerate(roots):
        lengths = tuple(g[f"l{finger + 1}{link}"] for link in (1, 2, 3))
        bodies += _finger(finger, root, lengths, radius)
    corners = g["side"] / math.sqrt(3.0) * np.stack((rps3_loop.COSINES, rps3_loop.SINES, np.zeros(3)), axis=-1)
    held = Body("object", rim(corners, 0.5 * radius, "platform"), 0, Joint.FREE, HERE, 0)
    tip = Body("tip", (ball(np.zeros(3), 0.8 * radius, "tool"),), 0, Joint.FREE, HERE, 0)

    def coordinates(q: Array) -> tuple[Array, Array]:
        return q, tips(robot, q)[1][:, None]

    size = g["h"] + g["l11"] + g["l12"] + g["l13"]
    moved = tuple(range(1, 3 * hand_grasp.FINGERS + 1))
    return Bodies((*bodies, held, tip), robot.n, coordinates, moved, size)


def _finger(finger: int, root: Array, lengths: tuple[float, ...], radius: float) -> tuple[Body, ...]:
    """Links of a finger: theta turns about z of its root, psi and phi lift."""
    first, name, shin = 3 * finger, f"finger{finger + 1}", 0.8 * radius
    start = capsule(np.zeros(3), np.array([lengths[0], 0.0, 0.0]), radius, "link")
    # z of the lifting joints is -y of the first link, so that they lift from x to z.
    lift = pose(lengths[0], axis="x", angle=0.5 * math.pi)
    pad = ball(np.array([lengths[2], 0.0, 0.0]), radius, "link")
    shapes = ((start,), pivoted(lengths[1], shin), (*pivoted(lengths[2], shin), pad))
    origins = (root, lift, pose(lengths[1]))
    parents = (0, first + 1, first + 2)
    parts = zip(shapes, parents, origins, strict=True)
    return tuple(
        Body(f"{name}_link{i + 1}", solids, parent, Joint.REVOLUTE, origin, first + i)
        for i, (solids, parent, origin) in enumerate(parts)
    )
