"""Unknown robots: base, a dotted line to the tip, and the tip, for what nobody described."""

import numpy as np

from teleop_core.bodies.body import HERE, Bodies, Body, Joint
from teleop_core.bodies.solids import ball, cylinder
from teleop_core.bodies.tips import tips
from teleop_core.geometry import Array
from teleop_core.portable import length
from teleop_core.robots.robot import Robot

_DOTS = 12


def unknown_bodies(robot: Robot) -> Bodies:
    """Bodies of a robot of which only its tip is known; no joint has a body of its own."""
    home = robot.solve_fk(robot.home).T[:3, 3]
    size = max(float(length(home)), 1e-3)
    up = np.array([0.0, 0.0, 1.0])
    base = Body("base", (cylinder(-0.015 * size * up, up, 0.09 * size, 0.03 * size, "base"),), -1)
    dot, end = ball(np.zeros(3), 0.012 * size, "link"), ball(np.zeros(3), 0.03 * size, "tool")
    dots = [Body(f"dot{i + 1}", (dot,), 0, Joint.FREE, HERE, i) for i in range(_DOTS)]
    tip = Body("tip", (end,), 0, Joint.FREE, HERE, _DOTS)
    shares = np.append(np.arange(1, _DOTS + 1) / (_DOTS + 1.0), 1.0)

    def coordinates(q: Array) -> tuple[Array, Array]:
        _, poses = tips(robot, q)
        free = np.repeat(poses[:, None], _DOTS + 1, axis=1)
        free[..., :3] *= shares[:, None]
        return q, free

    last = _DOTS + 1
    return Bodies((base, *dots, tip), robot.n, coordinates, (last,) * robot.n, size)
