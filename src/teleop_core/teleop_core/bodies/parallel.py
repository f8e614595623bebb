"""Parallel robots: bodies of the Stewart platform and of the 3-RPS."""

import numpy as np

from teleop_core.bodies.body import HERE, Bodies, Body, Joint
from teleop_core.bodies.legs import Telescope, plate
from teleop_core.bodies.solids import Solid, ball
from teleop_core.bodies.tips import tips
from teleop_core.geometry import Array
from teleop_core.portable import length, product
from teleop_core.robots.robot import Robot
from teleop_core.robots.rps3_loop import COSINES, SINES

_RADIUS = 0.06  # of a leg's outer tube, over the platform's size


def stewart_bodies(robot: Robot) -> Bodies:
    """Base, telescopes between the joint points of the layout, platform."""
    points = robot.geometry_row[:36].reshape(2, 6, 3)
    return _platform_on_legs(robot, points[0], points[1])


def rps3_bodies(robot: Robot) -> Bodies:
    """Base, telescopes from hinges to ball joints, platform."""
    circle = np.stack((COSINES, SINES, np.zeros(3)), axis=-1)
    return _platform_on_legs(robot, robot.geometry["b"] * circle, robot.geometry["a"] * circle)


def _platform_on_legs(robot: Robot, base: Array, platform: Array) -> Bodies:
    """Bodies of a platform, which is the tip, on legs whose lengths are the joints.

    Joint points (n, 3) [m] are those of the base in the base and of the platform in the platform.
    """
    radius = _RADIUS * float(length(platform).max())
    legs = Telescope(float(robot.lower.min()), float(robot.upper.max()), radius)

    def coordinates(q: Array) -> tuple[Array, Array]:
        transforms, poses = tips(robot, q)
        ends = product(platform, transforms[:, :3, :3].swapaxes(1, 2)) + transforms[:, None, :3, 3]
        starts = np.broadcast_to(base, ends.shape)
        return q, np.concatenate((legs.poses(starts, ends), poses[:, None]), axis=1)

    count = robot.n * legs.tubes
    bodies = [Body("base", plate(base, radius, is_base=True), -1), *legs.bodies(robot.n)]
    bodies.append(Body("platform", plate(platform, radius), 0, Joint.FREE, HERE, count))
    bodies.append(Body("tip", _tool(radius), 0, Joint.FREE, HERE, count))
    moved = tuple((leg + 1) * legs.tubes for leg in range(robot.n))
    size = float(length(base).max() + robot.upper.max())
    return Bodies(tuple(bodies), robot.n, coordinates, moved, size)


def _tool(radius: float) -> tuple[Solid, ...]:
    return (ball(np.zeros(3), 1.5 * radius, "tool"),)
