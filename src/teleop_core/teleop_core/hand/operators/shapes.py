"""Shapes: smooth motion of the hand as a pure function of time: random, line, circle and more."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from teleop_core.hand.operators import Motion, Operator, Setting
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.kernels import Array, dot


def minimum_jerk(share: Array) -> Array:
    """Smooth step from 0 to 1, at rest at both ends; ``share`` of its time is clipped to [0, 1].

    Source:
        Flash and Hogan 1985, eq. 6.
    """
    x = np.clip(share, 0.0, 1.0)
    return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)


# Components of random motion, in cycles per period; they are incommensurate, so that the motion does not repeat.
_CYCLES = np.array([1.0, math.sqrt(3.0), math.sqrt(7.0), math.sqrt(13.0)])
_SHARES = np.array([0.5, 0.4, 0.25, 0.15])
PHASES = (6, len(_CYCLES))
"""Shape of the array of random phases: three axes of position and three of rotation, with 4 phases each."""
Shape = Callable[[OperatorParameters, Array, Array], Array]
"""Function of parameters, phases (6, 4) and times (N,) [s] since the approach; returns positions (N, 3) [m]."""


def smooth(p: OperatorParameters, phases: Array, shape: Shape, *, grows: bool = True) -> Motion:
    """Motion that approaches the centre, then draws a shape there while the stylus turns.

    Args:
        p: Centre, approach, tilt, largest turn.
        phases: Random phases (6, 4) [rad].
        shape: Function that gives positions around the centre.
        grows: Whether the shape grows over its first second, so that it starts at rest.

    Returns:
        Function from times (N,) to position [m] and rotation vector [rad] relative to the start, (N, 6); at time 0
        these are zero and at rest.
    """

    def motion(times: Array) -> Array:
        moved = np.maximum(times - p.approach_time, 0.0)
        grown = minimum_jerk(moved)[:, None]
        approach = minimum_jerk(times / p.approach_time)[:, None]
        turn = p.rotation * random_unit(p, phases[3:], moved) * grown
        place = shape(p, phases, moved)
        position = approach * np.array(p.center) + (grown * place if grows else place)
        return np.hstack((position, approach * np.array(p.tilt) + turn))

    return motion


def random_unit(p: OperatorParameters, phases: Array, times: Array) -> Array:
    """Smooth random motion within [-1, 1] on three axes, (N, 3), with phases (3, 4)."""
    rate = 2.0 * math.pi * _CYCLES / p.period
    waves = np.sin(times[:, None, None] * rate + phases)
    return np.sin(0.5 * math.pi * dot(waves, _SHARES))


def _random(p: OperatorParameters, phases: Array, times: Array) -> Array:
    return 0.5 * np.array(p.size) * random_unit(p, phases[:3], times)


def _line(p: OperatorParameters, phases: Array, times: Array) -> Array:
    share = 0.5 - 0.5 * np.cos(2.0 * math.pi * times / p.period)
    return share[:, None] * np.array(p.size)


def _circle(p: OperatorParameters, phases: Array, times: Array) -> Array:
    angle = 2.0 * math.pi * times / p.period
    unit = np.stack((np.cos(angle), np.sin(angle), np.sin(angle)), axis=1)
    return 0.5 * np.array(p.size) * unit


def _points(p: OperatorParameters, phases: Array, times: Array) -> Array:
    stops = np.vstack((np.zeros(3), np.reshape(p.points, (-1, 3))))
    # In the last fifth of each leg the hand rests at the stop.
    leg = np.minimum(times / p.period, len(stops) - 1 - 1e-9)
    index = leg.astype(int)
    share = minimum_jerk((leg - index) / 0.8)[:, None]
    return stops[index] + share * (stops[index + 1] - stops[index])


def _hold(p: OperatorParameters, phases: Array, times: Array) -> Array:
    return np.zeros((len(times), 3))


def _operator(name: str, shape: Shape, *, grows: bool = True) -> Operator:
    def make(parameters: object, setting: Setting) -> Motion:
        return smooth(setting.common, setting.phases, shape, grows=grows)

    return Operator(name, make, approaches=True)


RANDOM = _operator("random", _random)
LINE = _operator("line", _line)
CIRCLE = _operator("circle", _circle)
POINTS = _operator("points", _points, grows=False)
HOLD = _operator("hold", _hold)
ELSEWHERE = replace(HOLD, name="elsewhere", is_here=False)
"""No operator in this session: another node sends the hand's topics; for live sessions only."""
