"""Look and move: the number of looks that a person needs to reach a target, and the duration of the movement.

The model uses the constants of the operator ``observer``, but contains no arm. It predicts the time of any motion that
is guided by sight.
"""

import numpy as np

from teleop_core.hand.operators.observer_parameters import ObserverParameters
from teleop_core.kernels.geometry import Array

_PEOPLE = 20_000
_MOST = 60  # upper limit of the number of looks, which no person reaches
CYCLE = 0.325
"""Time of a look-move cycle of a person without any lag [s], identified from MacKenzie and Ware 1993. The formula MT =
2.7 (0.325 s + lag) fits their four lags within 2 %."""


def looks(way: float, width: float, passed: float = 1.0, seed: int = 1) -> tuple[float, float]:
    """Mean number of submovements to a target, and their total duration [s].

    Args:
        way: Distance to the target [m].
        width: Width of the target in which the motion must end [m].
        passed: Share of each motion that the slave makes; it is below 1 if, for example, the network loses increments.
        seed: Seed of the hand's noise.
    """
    p, rng = ObserverParameters(), np.random.default_rng(seed)
    off = np.full(_PEOPLE, way)
    count, time, tries = np.zeros(_PEOPLE), np.zeros(_PEOPLE), np.ones(_PEOPLE, bool)
    for _ in range(_MOST):
        lasts = p.least_time + p.time_per_bit * np.log2(np.abs(off) / width + 1.0)
        noise = rng.standard_normal(_PEOPLE) * p.noise * np.abs(off) / lasts
        off = np.where(tries, off - passed * off + noise, off)
        count += tries
        time += np.where(tries, lasts, 0.0)
        tries &= np.abs(off) > 0.5 * width
    return float(count.mean()), float(time.mean())


def movement_time(way: float, width: float, lag: float) -> tuple[float, float]:
    """Time [s] to hit a target on a delayed display, and the number of looks.

    Args:
        way: Distance to the target [m].
        width: Width of the target [m].
        lag: Delay of the display [s]; the delay of the eye is not included.
    """
    p = ObserverParameters()
    count, moving = looks(way, width)
    return p.reaction + moving + count * (p.eye + lag), count


def difficulty(way: float | Array, width: float) -> float | Array:
    """Index of difficulty [bit] in Shannon's form, MacKenzie 1992."""
    found: float | Array = np.log2(way / width + 1.0)
    return found
