"""Kalman: a hand that keeps its speed until it is pushed, seen through readings that tremble."""

from dataclasses import dataclass

from teleop_core.base.parameters import parameter
from teleop_core.chain.filters import TremorFilter
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array

_PLACE, _SPEED, _VARIANCE, _SHARED, _OF_SPEED, _HAS_BEGUN = range(6)
"""Places in the memory: estimate, its covariance, and whether there is any."""
FASTEST = 1.0
"""Standard deviation of the speed with which a hand may begin [m/s]."""


@dataclass(frozen=True, kw_only=True)
class KalmanParameters:
    """How much the hand accelerates, and how much its readings tremble, for any rate of samples.

    Motion below ``sqrt(acceleration_noise / reading_noise) / 2π`` (3.6 Hz) is taken as meant.
    """

    acceleration_noise: float = parameter(
        0.01, unit="m/s²/√Hz", lower=1e-6, upper=100.0,
        doc="root of the density of the meant acceleration, which is white",
        source="assumed: motion up to 3.6 Hz is meant, beside a tremor of 20 µm/√Hz",
    )  # fmt: skip
    reading_noise: float = parameter(
        2e-5, unit="m/√Hz", lower=1e-9, upper=0.1,
        doc="root of the density of what the readings add: the tremor, taken as white",
        source="assumed: 40 µm of tremor per axis in 4 Hz",
    )  # fmt: skip


@kernel
def kalman_filter(numbers: Array, memory: Array, value: float, period: float) -> float:
    """Place of the meant motion: predicted at constant speed, then moved towards the reading.

    Of the first sample nothing is known but its place, so that one that begins at speed follows
    at once.

    Source:
        Kalman 1960, theorem 3; Bar-Shalom, Li and Kirubarajan 2001, section 6.2.2 (white noise
        of the acceleration) and 5.2.3 (gain and covariance).
    """
    push = numbers[0] * numbers[0] * period
    spread = numbers[1] * numbers[1] / period
    if memory[_HAS_BEGUN] == 0.0:
        memory[_HAS_BEGUN] = 1.0
        memory[_VARIANCE], memory[_OF_SPEED] = spread, FASTEST * FASTEST
    shared = memory[_SHARED] + period * memory[_OF_SPEED] + 0.5 * push * period
    variance = (
        memory[_VARIANCE] + period * (memory[_SHARED] + shared) - push * period * period / 6.0
    )
    of_speed = memory[_OF_SPEED] + push
    gain, gain_of_speed = variance / (variance + spread), shared / (variance + spread)
    place = memory[_PLACE] + period * memory[_SPEED]
    off = value - place
    memory[_PLACE], memory[_SPEED] = place + gain * off, memory[_SPEED] + gain_of_speed * off
    memory[_VARIANCE], memory[_SHARED] = gain * spread, gain_of_speed * spread
    memory[_OF_SPEED] = of_speed - gain_of_speed * shared
    return memory[_PLACE]


KALMAN = TremorFilter("kalman", KalmanParameters, kalman_filter)
