"""Describing robots: the choice of the description of a robot's bodies, and the description of serial robots.

Serial robots are described from kinematics alone, by the product of exponentials. The Jacobian at home gives the screw
axis of every joint. The pose of link i is the product of the motions of joints 1 to i; this is exact for every robot
whose joints are a chain. A robot that is neither serial nor described is drawn as a base, a dotted line to the tip, and
the tip.

Source:
    Lynch and Park 2017, chapter 4.
"""

from weakref import WeakKeyDictionary

import numpy as np

from teleop_core.kernels import Array, length, rotations_from_quaternions
from teleop_core.robots.bodies.chain import axes_of, chain, places, tip_of
from teleop_core.robots.bodies.frames import pose_of, tips
from teleop_core.robots.body import HERE, Bodies, Body, Joint
from teleop_core.robots.dynamics.followers import followers_of
from teleop_core.robots.robot import Robot
from teleop_core.robots.solids import ball, cylinder

_KNOWN: "WeakKeyDictionary[Robot, Bodies]" = WeakKeyDictionary()


def bodies_of(robot: Robot) -> Bodies:
    """Bodies of a robot; later calls for the same robot return the same object.

    A robot may describe itself (``Robot.describe``), as robots with loops do. For every other robot whose joints are a
    chain, the axes follow from its kinematics. All other robots are drawn as base, dotted line, and tip.
    """
    if robot not in _KNOWN:
        _KNOWN[robot] = _described(robot)
    return _KNOWN[robot]


def _described(robot: Robot) -> Bodies:
    if robot.describe is not None:
        return robot.describe(robot)
    return serial_bodies(robot) or unknown_bodies(robot)


_TRIALS = 5
# The joints count as a chain if the error of the tip, divided by the size of the robot, is not larger.
_EXACT = 1e-6


def serial_bodies(robot: Robot) -> Bodies | None:
    """Bodies of a robot whose joints are a chain; None if they are not."""
    if robot.kernels.assemble is not None:
        return None
    tip = pose_of(robot.fk(robot.home))
    followers = followers_of(robot)
    ranges, jacobian = np.stack((robot.lower, robot.home, robot.upper)), robot.jacobian(robot.home)
    if followers is not None:
        ranges = np.sort(followers.of(ranges), axis=0)
        jacobian = followers.chain_jacobian(robot.geometry_row, ranges[1])
    axes = axes_of(jacobian, tip[:3])
    if axes is None:
        return None
    chained = places(axes, ranges[1] - ranges[0], tip[:3])
    moves = range(robot.n) if followers is None else followers.coordinates
    names = [f"link{i + 1}" for i in range(len(axes))]
    bodies, reach = chain(chained, names, moves, ranges[1], ranges[2] - ranges[0], tip)

    def coordinates(q: Array) -> tuple[Array, Array]:
        more = np.empty((len(q), 0)) if followers is None else followers.of(q)
        return np.concatenate((q, more), axis=1), np.empty((1, 0, 7))

    joined = None if followers is None else coordinates
    frames = Bodies(tuple(bodies), robot.n, joined, (), reach).poses(robot.home)
    bodies.append(tip_of(bodies, frames[-1], tip, reach))
    first = range(robot.n) if followers is None else followers.first
    found = Bodies(tuple(bodies), robot.n, joined, tuple(i + 1 for i in first), reach)
    return found if has_tip_of(found, robot) else None


def has_tip_of(bodies: Bodies, robot: Robot) -> bool:
    """Whether the last body has the pose of the robot's tip, for random joints within the limits."""
    draws = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_TRIALS, robot.n))
    tips, expected = bodies.poses(draws)[:, -1], robot.fk(draws)
    off = np.abs(tips[:, :3] - expected[:, :3, 3]).max() / bodies.size
    turned = np.abs(rotations_from_quaternions(tips[:, 3:]) - expected[:, :3, :3]).max()
    return bool(off < _EXACT and turned < _EXACT)


_DOTS = 12


def unknown_bodies(robot: Robot) -> Bodies:
    """Bodies of a robot whose only known body is the tip; no joint has a body of its own."""
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
