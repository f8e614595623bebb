"""Planar four-bar loop: all four forms of its closure and its two assembly modes.

Ground ``l0`` is along x from the left to the right pivot. Crank ``l1`` rotates by theta1 about the left pivot, rocker
``l3`` by phi1 about the right pivot. Coupler ``l2`` connects their ends. phi2 is the angle from crank to coupler. phi3
is the angle from coupler to rocker, where the rocker points from the coupler's end to the right pivot.

Source:
    Ghosal 2020, lecture 11, eqs. 2-5, corrected (coupler form: pi; last form: l0 restored).
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from teleop_core.base import ParameterError
from teleop_core.kernels import Array, arctangent

_ROUNDING = 1e-12


class Assembly(IntEnum):
    """Whether a loop can be put together."""

    CLOSED = 0  # both assembly modes exist (they are equal at the end of the range)
    CANNOT_ASSEMBLE = 1  # the loop does not close; angles are those of the smallest gap


class Closure(NamedTuple):
    """Angles of a closed loop [rad] in (-pi, pi]; the last axis (2,) is the assembly mode."""

    status: Array
    """:class:`Assembly` for each theta1, integers."""
    phi1: Array
    phi2: Array
    phi3: Array


@dataclass(frozen=True)
class FourBar:
    """Lengths of a planar four-bar [m]: ground, crank, coupler, rocker."""

    l0: float
    l1: float
    l2: float
    l3: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise ParameterError(name, value, "a length > 0 m")

    def close(self, theta1: Array | float) -> Closure:
        """All angles for crank angles (...) [rad], both modes.

        Source:
            Freudenstein 1954; Ghosal 2020, eq. 5, solved for phi1.
        """
        theta = np.asarray(theta1, dtype=np.float64)[..., None]
        x, y = self.l1 * np.cos(theta), self.l1 * np.sin(theta)
        A, B = 2.0 * self.l3 * (self.l0 - x), -2.0 * self.l3 * y
        C = (self.l0 - x) ** 2 + y**2 + self.l3**2 - self.l2**2
        radius = np.hypot(A, B)
        is_open = np.abs(C) > radius * (1.0 + _ROUNDING)
        cosine = np.clip(-C / np.where(radius > 0.0, radius, 1.0), -1.0, 1.0)
        half = arctangent(np.sqrt((1.0 - cosine) * (1.0 + cosine)), cosine)
        phi1 = arctangent(B, A) + np.array([1.0, -1.0]) * half
        coupler = arctangent(self.l3 * np.sin(phi1) - y, self.l0 + self.l3 * np.cos(phi1) - x)
        angles = (phi1, coupler - theta, phi1 + math.pi - coupler)
        return Closure(np.where(is_open, 1, 0)[..., 0], *(_principal(angle) for angle in angles))

    def crank_ranges(self) -> tuple[tuple[float, float], ...]:
        """Intervals of theta1 [rad] in which the loop closes: no interval, one, or two that are mirror images.

        The distance between the crank's end and the right pivot must be between |l2 - l3| and l2 + l3.
        """
        product, squares = 2.0 * self.l0 * self.l1, self.l0**2 + self.l1**2
        least = (squares - (self.l2 + self.l3) ** 2) / product
        most = (squares - (self.l2 - self.l3) ** 2) / product
        if least > 1.0 + _ROUNDING or most < -1.0 - _ROUNDING:
            return ()
        inner, outer = math.acos(min(most, 1.0)), math.acos(max(least, -1.0))
        if inner == 0.0:
            return ((-outer, outer),)
        if outer == math.pi:
            return ((inner, 2.0 * math.pi - inner),)
        return ((inner, outer), (-outer, -inner))


def _principal(angle: Array) -> Array:
    """The angle plus whole turns, in (-pi, pi]."""
    return np.asarray(-np.remainder(math.pi - angle, 2.0 * math.pi) + math.pi)
