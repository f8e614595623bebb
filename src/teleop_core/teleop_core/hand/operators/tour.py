"""Tour: stops at one point after the other, then draws a smooth line through all of them.

Three times are set separately: the duration of a leg, the duration of each rest, and the period of the stylus rotation
(``operator.period``).
"""

from dataclasses import dataclass
from typing import cast

import numpy as np

from teleop_core.base import ParameterError, Within, fixed
from teleop_core.hand.operators import Motion, Operator, Setting
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.shapes import minimum_jerk, smooth
from teleop_core.kernels.geometry import Array


@dataclass(frozen=True, kw_only=True)
class TourParameters:
    """Points of a tour, and times for its legs, rests and lines."""

    points: tuple[float, ...] = fixed(
        (), Within(-0.3, 0.3, "m"), "x, y, z of each point relative to the centre, one point after the other"
    )
    leg_time: float = fixed(
        0.7,
        Within(0.05, 60.0, "s"),
        "duration of the move from one point to the next",
        source="assumed: with it, 24 points, their rests and the line back take the published 45 s",
    )
    rest_time: float = fixed(
        0.6,
        Within(0.0, 60.0, "s"),
        "duration of the rest at each point",
        source="assumed: for the same reason as leg_time",
    )
    trace_time: float = fixed(
        13.8,
        Within(0.0, 600.0, "s"),
        "duration of the line back through all points, from the last to the first; 0: no line back",
        source="assumed: for the same reason as leg_time",
    )

    def __post_init__(self) -> None:
        if len(self.points) % 3:
            raise ParameterError("operator.tour.points", self.points, "x, y, z of each point")

    @property
    def stops(self) -> Array:
        """Points (N, 3) [m] relative to the centre."""
        return np.reshape(np.array(self.points, dtype=np.float64), (-1, 3))

    @property
    def visit_time(self) -> float:
        """Time for all points with their rests [s]."""
        return len(self.stops) * (self.leg_time + self.rest_time)


def through(points: Array, share: Array) -> Array:
    """Smooth line (M, 3) through points (N, 3), N >= 2, at shares (M,) of its length, 0 to 1.

    Between neighbours the line is a cubic. Its slope at a point is the slope from the previous point to the next point.

    Source:
        Catmull and Rom 1974.
    """
    at = np.clip(share, 0.0, 1.0) * (len(points) - 1)
    first = np.minimum(at.astype(int), len(points) - 2)
    t = (at - first)[:, None]
    slopes = np.gradient(points, axis=0)
    a, b, u, v = points[first], points[first + 1], slopes[first], slopes[first + 1]
    rising = t * t * (3.0 - 2.0 * t)
    return np.asarray(a + (b - a) * rising + u * (t * (1.0 - t) ** 2) - v * (t * t * (1.0 - t)), dtype=np.float64)


def tour(p: TourParameters, times: Array) -> Array:
    """Positions (N, 3) [m] around the centre at times (N,) [s] since the tour began at the centre."""
    stops = np.vstack((np.zeros(3), p.stops))
    legs = len(stops) - 1
    whole = np.minimum(times / (p.leg_time + p.rest_time), legs - 1e-9)
    leg = whole.astype(int)
    share = minimum_jerk((whole - leg) * (p.leg_time + p.rest_time) / p.leg_time)[:, None]
    place = stops[leg] + share * (stops[leg + 1] - stops[leg])
    if p.trace_time > 0.0 and legs > 1:
        since = times - p.visit_time
        traced = through(stops[:0:-1], minimum_jerk(since / p.trace_time))
        place = np.where(since[:, None] > 0.0, traced, place)
    return np.asarray(place, dtype=np.float64)


def _make(parameters: object, setting: Setting) -> Motion:
    p = cast(TourParameters, parameters)
    if not len(p.stops):
        raise ParameterError("operator.tour.points", p.points, "x, y, z of at least one point")

    def shape(_: OperatorParameters, __: Array, times: Array) -> Array:
        return tour(p, times)

    return smooth(setting.common, setting.phases, shape, grows=False)


def _length(parameters: object, setting: Setting) -> float:
    p = cast(TourParameters, parameters)
    trace = p.trace_time if len(p.stops) > 1 else 0.0
    return float(setting.common.approach_time) + p.visit_time + trace


TOUR = Operator("tour", _make, TourParameters, approaches=True, length=_length)
