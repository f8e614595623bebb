"""MMA: bodies of the arm with a parallelogram. The side of the parallelogram with link 3 is modelled as a serial chain.

The chain has the joints 1, 2, 3', then a rotation of link 4 by θ3 - θ3', which the parallelogram causes, then the
wrist. Links 3a and 3b close the parallelogram on the other side.
"""

import math
from collections.abc import Sequence

import numpy as np

from teleop_core.kernels import Array, product
from teleop_core.robots.bodies import chain, frames
from teleop_core.robots.body import Bodies, Body, Joint
from teleop_core.robots.robot import Robot
from teleop_machines.bodies.planar import pivoted
from teleop_machines.mma_models import SHORT_SIDE

_NAMES = ("link1", "link2", "link3", "link4", "link6", "link8", "link10")
# For each joint of the chain, the index of its coordinate: joint readings, then θ3 - θ3', then θ3' - θ3 of link 3b.
_CHAIN = (0, 1, 3, 7, 4, 5, 6)
_ELBOW = 3  # index of link 3 among the bodies
_ANKLE = 4  # index of link 4 among the bodies


def mma_bodies(robot: Robot) -> Bodies:
    """Links of the chain, the two links of the parallelogram's other side, and the tip."""
    home = robot.fk(robot.home)
    tip, reference = frames.pose_of(home), _coordinates(robot.home[None])[0][0]
    mixing = np.zeros((7, 7))  # joint speeds per speed of the chain's coordinates
    for column, joint in enumerate((0, 1, 3, 2, 4, 5, 6)):
        mixing[joint, column] = 1.0
    mixing[2, 2] = 1.0  # θ3 = θ3' + (θ3 - θ3')
    axes = chain.axes_of(product(robot.jacobian(robot.home), mixing), tip[:3])
    assert axes is not None, "the MMA's joints all turn"
    chained = chain.places(axes, np.zeros(7), tip[:3])
    bodies, reach = chain.chain(chained, _NAMES, _CHAIN, reference[list(_CHAIN)], np.zeros(7), tip)
    placed = Bodies(tuple(bodies), 7, _coordinates, (), reach).poses(robot.home)
    end = chain.tip_of(bodies, placed[-1], tip, reach)
    bodies += _other_side(bodies, robot.geometry["a3"])
    moves = (1, 2, len(_NAMES) + 1, _ELBOW, 5, 6, 7)
    return Bodies((*bodies, end), 7, _coordinates, moves, reach)


def _coordinates(q: Array) -> tuple[Array, Array]:
    knee = q[:, 3] - q[:, 2]
    return np.column_stack((q, -knee, knee)), np.empty((len(q), 0, 7))


def _other_side(bodies: Sequence[Body], long_side: float) -> tuple[Body, Body]:
    """Link 3a, which rotates on link 2 about the axis of link 3, and link 3b on link 3a, parallel to link 3."""
    x, y = bodies[_ANKLE].origin[:2]  # end of link 3 in its own frame
    root = frames.moved(bodies[_ELBOW].origin, Joint.REVOLUTE, math.atan2(y, x))
    radius = 0.03 * long_side
    count = len(bodies)
    short = Body("link3a", pivoted(SHORT_SIDE, radius), 2, Joint.REVOLUTE, root, 2)
    long = Body("link3b", pivoted(long_side, radius), count, Joint.REVOLUTE, frames.pose(SHORT_SIDE), 8)
    return short, long
