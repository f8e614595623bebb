"""Published values: results of the RCRT-1 and its operator, and the conditions for comparing scores with them."""

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import SLAVE_MEASURED_CP

SOURCE = "Vongbunyong 2008, Table 8.2"
POSITION_SHARE = 0.15
"""Largest relative difference at which the root mean square of a position agrees with the published value."""
ANGLE_FACTOR = 1.6
"""Largest factor between the root mean square of an angle and the published value at which both agree."""

_SOURCE_LAW = "source_pid"  # name of the control law of the source


@dataclass(frozen=True)
class Published:
    """Root mean square and maximum of one mode: position [mm], angles [deg].

    Angles have the names of this package, roll about x and yaw about z; the source calls them yaw and roll (eqs.
    2.7.1-2.7.6).
    """

    mode: str
    gain: float
    position_mm: tuple[float, float]
    roll_deg: tuple[float, float]
    pitch_deg: tuple[float, float]
    yaw_deg: tuple[float, float]


COARSE = Published("coarse", 1.0, (0.338, 0.702), (0.112, 0.537), (0.092, 0.828), (0.044, 0.172))
# Maximum of table 8.2. The text of the source states 0.266 mm, which is below its own root mean square.
FINE = Published("fine", 0.1, (0.293, 0.791), (0.153, 0.811), (0.105, 0.832), (0.077, 0.628))

BOX_OVERSHOOT_MM = 1.0
"""Approximate distance by which the source's paths exceed each wall [mm] (section 7.6)."""


def published_for(gain: float | None, robot: str | None = "rcrt1", plant: str | None = "hardware") -> Published | None:
    """Published values of the mode (coarse or fine) whose gain is nearer, on a logarithmic scale.

    Returns:
        The values; None without a gain, for another robot, and for a plant that does not model the real machine. A
        comparison of an ideal arm with a real arm would be meaningless. A recording that does not name its robot or
        its plant (None) may be of the machine itself.
    """
    if gain is None or not gain > 0.0 or robot not in {"rcrt1", None}:
        return None
    if plant not in {"hardware", None}:
        return None
    return min((COARSE, FINE), key=lambda mode: abs(math.log(gain / mode.gain)))


def agrees(value: float | None, published: float, share: float) -> bool | None:
    """Whether a value differs from the published value by at most a share of it; None without a value."""
    return None if value is None else abs(value - published) <= share * published


def agrees_by_factor(value: float | None, published: float, factor: float) -> bool | None:
    """Whether a value differs from the published value by at most a factor; None without a value."""
    return None if value is None else published / factor <= value <= published * factor


class Gains:
    """Counts the slave samples during which each gain was in force."""

    def __init__(self, context: Context) -> None:
        self._robot, self._origin = context.robot, context.origin
        self._counts: Counter[float] = Counter()

    def add(self, window: Window) -> None:
        """Process one window."""
        column = window.states(SLAVE_MEASURED_CP).column("gain")
        gains, counts = np.unique(column, return_counts=True)
        self._counts.update({g: n for g, n in zip(gains.tolist(), counts.tolist(), strict=True) if g})

    @property
    def gain(self) -> float | None:
        """The most frequent gain over all slave samples; None without teleop/state."""
        return self._counts.most_common(1)[0][0] if self._counts else None

    @property
    def published(self) -> Published | None:
        """Published values for this gain, robot and plant; None if there are none."""
        return published_for(self.gain, self._robot, self._origin.plant)

    @property
    def is_source(self) -> bool:
        """Whether the slave may be the real machine, or is its simulation here with the source's control law."""
        return self._origin.plant is None or self._origin.controller == _SOURCE_LAW
