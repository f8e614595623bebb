"""Look and move: the operator `observer` before a screen, as one compiled loop without an arm, and two other models.

Each model gives the mean time of a press and the share of misses, for targets of a width at a distance that are seen
with a lag. :mod:`teleop_lab.experiments.operator_models` fits all of them to MacKenzie and Ware 1993.
"""

import math

import numpy as np

from teleop_core.hand.operators.observer_parameters import ObserverParameters
from teleop_core.kernels import inner, kernel
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
PRESSES = 1500
"""Number of presses at each target and lag."""
_MOST = 40  # looks at a target, which nobody reaches
_SHORTEST = 0.1  # as in the operator
TIME, OFF, HIT, LOOKS, BESIDE = range(5)
"""Columns of a press.

They are the time of the first press [s]; where it ended along the way, relative to the middle of the target; the time
of the press that hits [s]; the submovements until the first press; and its distance from the middle of the target.
"""


@inner
def _one_look(p: Array, width: float, lag: float, noise: Array, off: Array, seen: Array) -> bool:
    """Make one submovement, then decide whether to press; the offset and the seen offset (3,) are written."""
    eye, _, last, undershoot, per_speed, across, cost = p[:7]
    far = math.sqrt(seen[0] * seen[0] + seen[1] * seen[1] + seen[2] * seen[2])
    spread, ahead, doubt, square, passed = 0.0, 0.0, 0.0, 0.0, 0.0
    if far > _SHORTEST * width:
        passed = 1.0 - undershoot
        spread = per_speed * passed * far / last
        for i in range(int(p[7])):
            ahead += noise[i] * seen[i] / far
            doubt += noise[3 + i] * seen[i] / far
    for i in range(int(p[7])):
        along = seen[i] / max(far, 1e-12)
        off[i] -= passed * seen[i] + spread * (ahead * along + across * (noise[i] - ahead * along))
        seen[i] = off[i] + spread * (doubt * along + across * (noise[3 + i] - doubt * along))
        square += seen[i] * seen[i]
    beside, scale = math.sqrt(square), math.sqrt(2.0) * max(spread, 1e-12)
    chance = math.erf((0.5 * width - beside) / scale) + math.erf((0.5 * width + beside) / scale)
    return beside <= 0.5 * width and (1.0 - 0.5 * chance) * cost < last + lag + eye


@kernel
def look_and_move(p: Array, way: float, width: float, lag: float, noise: Array, found: Array) -> None:
    """Simulate presses at a target, by the rules of the operator.

    Args:
        p: eye, reaction, least_time, undershoot, noise, noise_across and error_cost of the operator, then the number
            of dimensions, 1 to 3.
        way: Distance of the target.
        width: Width of the target, in the same unit.
        lag: Lag with which the tip is seen [s].
        noise: Standard normal numbers (presses, looks, 6): of the submovement, then of what is seen of it.
        found: Presses (presses, 5), with the columns :data:`TIME` to :data:`BESIDE`; written.
    """
    off, seen = np.zeros(3), np.zeros(3)
    for k in range(noise.shape[0]):
        off[:] = 0.0
        off[0] = way
        seen[:] = off
        time, is_first = p[1], True
        for j in range(noise.shape[1]):
            time += p[2] + lag + p[0]
            if not _one_look(p, width, lag, noise[k, j], off, seen) and j < noise.shape[1] - 1:
                continue
            beside = math.sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2])
            if is_first:
                found[k, TIME], found[k, OFF], found[k, LOOKS] = time, off[0], j + 1.0
                found[k, BESIDE] = beside
                is_first = False
            found[k, HIT] = time
            if beside <= 0.5 * width:
                break
            time += p[1]
            seen[:] = off


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


def presses(p: Array, way: float, width: float, lag: float, seed: int = 1, count: int = PRESSES) -> Array:
    """Presses (count, 5) at a target, by constants of :func:`constants`."""
    found = np.empty((count, 5))
    noise = np.random.default_rng(seed).standard_normal((count, _MOST, 6))
    look_and_move(p, way, width, lag, noise, found)
    return found
