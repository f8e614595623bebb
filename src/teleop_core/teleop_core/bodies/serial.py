"""Serial robots: bodies from kinematics alone, by the product of exponentials.

The Jacobian at home gives every joint's screw axis; the placement of link i is the product of the
motions of joints 1 to i, exact for every robot whose joints are a chain.

Source:
    Lynch and Park 2017, chapter 4.
"""

import numpy as np

from teleop_core.bodies.axes import axes_of, places
from teleop_core.bodies.body import Bodies
from teleop_core.bodies.chain import chain, tip_of
from teleop_core.bodies.frames import pose_of
from teleop_core.geometry import rotations_from_quaternions
from teleop_core.robots.robot import Robot

_TRIALS = 5
# How far, over the size of the robot, the tip may be off for joints to count as a chain.
_EXACT = 1e-6


def serial_bodies(robot: Robot) -> Bodies | None:
    """Bodies of a robot whose joints are a chain; None if they are not."""
    if robot.kernels.assemble is not None:
        return None
    home = robot.fk(robot.home)
    axes = axes_of(robot.jacobian(robot.home), home[:3, 3])
    if axes is None:
        return None
    tip, strokes = pose_of(home), robot.upper - robot.lower
    chained = places(axes, robot.home - robot.lower, tip[:3])
    joints = range(robot.n)
    bodies, reach = chain(
        chained, [f"link{i + 1}" for i in joints], joints, robot.home, strokes, tip
    )
    frames = Bodies(tuple(bodies), robot.n, None, (), reach).poses(robot.home)
    bodies.append(tip_of(bodies, frames[-1], tip, reach))
    found = Bodies(tuple(bodies), robot.n, None, tuple(i + 1 for i in joints), reach)
    return found if has_tip_of(found, robot) else None


def has_tip_of(bodies: Bodies, robot: Robot) -> bool:
    """Whether the last body is where the robot's tip is, for joints drawn within the limits."""
    draws = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_TRIALS, robot.n))
    tips, expected = bodies.poses(draws)[:, -1], robot.fk(draws)
    off = np.abs(tips[:, :3] - expected[:, :3, 3]).max() / bodies.size
    turned = np.abs(rotations_from_quaternions(tips[:, 3:]) - expected[:, :3, :3]).max()
    return bool(off < _EXACT and turned < _EXACT)
