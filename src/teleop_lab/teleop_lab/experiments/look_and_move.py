"""Look and move: the operator `observer` before a screen, as one compiled loop without an arm, and two other models.

Each model gives the mean time of a press and the share of misses, for targets of a width at a distance that are seen
with a lag. :mod:`teleop_lab.experiments.operator_models` fits all of them to MacKenzie and Ware 1993.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from teleop_core.hand.operators.observer_parameters import ObserverParameters
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array

LAGS = np.array([0.0083, 0.025, 0.075, 0.225])
"""Lags of the screen of MacKenzie and Ware 1993 [s]."""
TIMES = np.array([0.911, 0.934, 1.059, 1.493])
"""Their printed mean times [s]."""
MISSES = np.array([0.036, 0.036, 0.049, 0.113])
"""Their printed shares of misses."""
TARGETS = np.array([(way, width) for way in (96.0, 192.0, 384.0) for width in (6.0, 12.0, 24.0, 48.0)])
"""Their distances and widths (12, 2) [pixels]; only the ratio of both matters."""
BITS = np.log2(TARGETS[:, 0] / TARGETS[:, 1] + 1.0)
"""Their indices of difficulty (12,) [bit], in Shannon's form (MacKenzie 1992)."""
INTERCEPT = 0.230
SLOPES = 0.169 + 1.03 * LAGS
"""Their printed law: a time is the intercept [s] plus the lag's slope [s/bit] times the bits."""
_MOST = 40  # looks at a target, which nobody reaches
_SHORTEST = 0.1  # as in the operator
_PRESSES = 1500
_RNG = np.random.default_rng(5).standard_normal((_PRESSES, _MOST, 6))
_RNG.setflags(write=False)


class Pressed(NamedTuple):
    """Presses of a model in cells.

    Attributes:
        time: Mean time of a press [s].
        miss: Share of presses outside of the target.
        looks: Mean number of submovements.
        spread: Standard deviation of the end along the way, divided by the width.
    """

    time: Array
    miss: Array
    looks: Array
    spread: Array


@kernel
def look_and_move(p: Array, way: float, width: float, lag: float, noise: Array, found: Array) -> None:
    """Simulate presses, by the rules of the operator, and write the fields of :class:`Pressed`.

    Args:
        p: eye, reaction, least_time, undershoot, noise, noise_across and error_cost of the operator, then the
            number of dimensions, 1 to 3.
        way: Distance of the target.
        width: Width of the target, in the same unit.
        lag: Lag with which the tip is seen [s].
        noise: Standard normal numbers (presses, looks, 6): of the submovement, then of what is seen of it.
        found: Results (4,); written.
    """
    eye, reaction, last, undershoot, per_speed, across, cost = p[:7]
    n, off, seen = int(p[7]), np.zeros(3), np.zeros(3)
    ends = ends_squared = 0.0
    found[:] = 0.0
    for k in range(noise.shape[0]):
        off[:] = 0.0
        off[0] = way
        seen[:] = off
        found[0] += reaction
        for j in range(noise.shape[1]):
            far = math.sqrt(seen[0] * seen[0] + seen[1] * seen[1] + seen[2] * seen[2])
            spread, ahead, doubt, square = 0.0, 0.0, 0.0, 0.0
            if far > _SHORTEST * width:
                spread = per_speed * (1.0 - undershoot) * far / last
                for i in range(n):
                    ahead += noise[k, j, i] * seen[i] / far
                    doubt += noise[k, j, 3 + i] * seen[i] / far
            for i in range(n):
                along = seen[i] / max(far, 1e-12)
                if spread > 0.0:
                    off[i] -= (1.0 - undershoot) * seen[i]
                off[i] -= spread * (ahead * along + across * (noise[k, j, i] - ahead * along))
                seen[i] = off[i] + spread * (doubt * along + across * (noise[k, j, 3 + i] - doubt * along))
                square += seen[i] * seen[i]
            look = last + lag + eye
            found[0] += look
            found[2] += 1.0
            scale = math.sqrt(2.0) * max(spread, 1e-12)
            beside = math.sqrt(square)
            chance = math.erf((0.5 * width - beside) / scale) + math.erf((0.5 * width + beside) / scale)
            if (1.0 - 0.5 * chance) * cost < look:
                break
        if math.sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]) > 0.5 * width:
            found[1] += 1.0
        ends += off[0]
        ends_squared += off[0] * off[0]
    for i in range(3):
        found[i] /= noise.shape[0]
    ends /= noise.shape[0]
    found[3] = math.sqrt(max(ends_squared / noise.shape[0] - ends * ends, 0.0)) / width


FITTED = ("reaction", "least_time", "undershoot", "noise", "error_cost")
"""Constants of the operator that are fitted to MacKenzie and Ware 1993."""


def constants(fitted: Array | None = None, dimensions: int = 2) -> Array:
    """Constants for :func:`look_and_move`: the operator's, or those of :data:`FITTED` replaced."""
    p = ObserverParameters()
    values = {name: float(getattr(p, name)) for name in (*FITTED, "eye", "noise_across")}
    if fitted is not None:
        values.update(zip(FITTED, map(float, fitted), strict=True))
    names = ("eye", "reaction", "least_time", "undershoot", "noise", "noise_across", "error_cost")
    return np.array([*(values[name] for name in names), float(dimensions)])


def presses(p: Array, targets: Array = TARGETS, lags: Array = LAGS, noise: Array = _RNG) -> Pressed:
    """Presses by lag and target (lags, targets), by constants of :func:`constants`."""
    found = np.empty((len(lags), len(targets), 4))
    for i, lag in enumerate(lags):
        for j, (way, width) in enumerate(targets):
            look_and_move(p, way, width, lag, noise, found[i, j])
    return Pressed(*np.moveaxis(found, -1, 0))
