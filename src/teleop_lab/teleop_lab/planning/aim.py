"""Aim: let a tool that is aligned with the stylus turn about the axes about which the hand turns.

Without ``tool_axes`` it always does. ``tool_axes`` and ``tool_roll`` map rotations of the stylus to rotations of the
tool about the tool's own axes. In space, after the map of ``axes``, the tool turns about the axes of the hand's
rotation only if these parameters fit the orientations of stylus and tool at engagement.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import Array, rotation, rotations_from_quaternions
from teleop_core.robots.robot import Robot
from teleop_lab.planning.placement import Placement
from teleop_lab.planning.turns import turns

# The given tool axes and roll are kept if their misfit exceeds the smallest misfit by at most this angle.
_NEAR_ENOUGH = math.radians(5.0)
_DIGITS = 4


class Aim:
    """Fits ``tool_axes`` and ``tool_roll`` to placements.

    Args:
        robot: The slave.
        stylus: Attitude of the stylus, quaternion (4,), when it is engaged.
        given: Placement whose tool axes and roll are preferred if they fit.
    """

    def __init__(self, robot: Robot, stylus: Array, given: Placement) -> None:
        self._robot, self._given = robot, given
        self._stylus = rotations_from_quaternions(stylus)

    def wanted(self, placement: Placement) -> Array:
        """Rotation (3, 3) from the tool's axes to the stylus's axes for which both turn about the same axes."""
        tool = self._robot.fk(np.array(placement.start))[:3, :3]
        return np.asarray(self._stylus.T @ axis_map("axes", placement.axes).T @ tool)

    def misfit(self, placement: Placement) -> float:
        """Angle [rad] between the rotation axes of the tool and those of the hand; 0 without ``tool_axes``."""
        if not placement.tool_axes:
            return 0.0
        given = axis_map("tool_axes", placement.tool_axes).T @ rotation("z", placement.tool_roll)
        return _angle(np.trace(given.T @ self.wanted(placement)))

    def aimed(self, placement: Placement) -> Placement:
        """Return the placement with the best tool axes and roll.

        If the given axes and roll fit as well, they are preferred. A placement without ``tool_axes`` stays as it is.
        """
        if not placement.tool_axes:
            return placement
        left = _matrices() @ self.wanted(placement)
        rolls = np.arctan2(left[:, 1, 0] - left[:, 0, 1], left[:, 0, 0] + left[:, 1, 1])
        # Trace of Rz(-roll) times each of the matrices.
        traces = np.hypot(left[:, 1, 0] - left[:, 0, 1], left[:, 0, 0] + left[:, 1, 1])
        traces += left[:, 2, 2]
        first = turns().index(self._given.tool_axes)
        best = first if traces[first] >= traces.max() - 1e-9 else int(traces.argmax())
        kept = replace(placement, tool_axes=self._given.tool_axes, tool_roll=self._given.tool_roll)
        if self.misfit(kept) <= _angle(traces[best]) + _NEAR_ENOUGH:
            return kept
        roll = round(float(np.clip(rolls[best], -3.1415, 3.1415)), _DIGITS)
        return replace(placement, tool_axes=turns()[best], tool_roll=roll)


def _angle(trace: float) -> float:
    """Angle [rad] of a rotation with a trace."""
    return math.acos(min(max(0.5 * (float(trace) - 1.0), -1.0), 1.0))


@cache
def _matrices() -> Array:
    """Matrices (24, 3, 3) of all maps of axes."""
    return np.stack([axis_map("tool_axes", axes) for axes in turns()])
