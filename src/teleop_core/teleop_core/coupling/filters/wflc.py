"""Weighted-frequency Fourier linear combiner: learns the tremor's sine and subtracts it."""

import math
from dataclasses import dataclass

from teleop_core.base import Within, parameter
from teleop_core.coupling.filters import TremorFilter, sections
from teleop_core.kernels import Array, inner, kernel

_SECOND, _THIRD = sections.WIDTH, 2 * sections.WIDTH
_PHASE, RATE, _HEARD, _SUBTRACTED = range(3 * sections.WIDTH, 3 * sections.WIDTH + 8, 2)
"""Indices in the memory, after the three sections.

The values are: phase [rad]; rate minus initial rate [rad/s]; weights of sine and cosine [m] of the first combiner,
which finds the rate; weights of sine and cosine [m] of the second combiner, whose output is subtracted.
"""
_REACH = 2.0 * math.pi * 2.0
"""Largest difference of the learned rate from the initial rate [rad/s]; from 10 Hz this allows 8 to 12 Hz."""
_FAINT = 5e-6
"""Amplitude below which the frequency of a tremor can hardly be estimated [m]."""
_DAMPING = math.sqrt(2.0)
"""Damping of the high-pass (Butterworth)."""
_WIDE = 0.6
"""Width of the band-passes, divided by their frequency."""


@dataclass(frozen=True, kw_only=True)
class WflcParameters:
    """How the tremor is separated from the intended motion, and how fast it is learned."""

    frequency: float = parameter(
        10.0, Within(6.0, 14.0, "Hz"), "frequency of the tremor that the filter assumes at the beginning"
    )
    high_pass: float = parameter(
        6.0, Within(0.5, 6.0, "Hz"), "motion below this frequency counts as intended; the filter does not learn it"
    )
    amplitude_rate: float = parameter(
        6.0,
        Within(0.1, 50.0, "1/s"),
        "inverse of the time in which the filter learns the amplitude; the larger, the wider the "
        "band of frequencies that counts as tremor",
        source="derived: gives the smallest error from the intended motion, for a hand as in scenario human",
    )
    frequency_rate: float = parameter(
        0.3,
        Within(0.0, 5.0, "1/s"),
        "inverse of the time in which the filter learns the tremor's frequency, within 2 Hz of "
        "frequency; 0: the frequency stays constant",
    )


@inner
def _band_pass(memory: Array, at: int, value: float, slope: float) -> float:
    sections.advance_section(memory, at, value, slope, _WIDE)
    return _WIDE * memory[at]


@kernel
def wflc_filter(numbers: Array, memory: Array, value: float, period: float) -> float:
    """Value minus the learned sine of the tremor.

    Two combiners learn the weights of the same sine by least mean squares. The second combiner gets the value after a
    high-pass; its sine is subtracted. The first combiner gets the value after two more band-passes, which leave hardly
    any intended motion, and finds the rate. The rate changes by the combiner's error times the sine's derivative. Here
    this product is divided by the squared amplitude, so that large and small tremors are learned equally fast. The
    high-pass changes the tremor's phase and amplitude. At the learned rate both changes are known, so the sine before
    the high-pass is subtracted.

    Source:
        Riviere, Rader and Thakor 1998 (IEEE Trans. Biomed. Eng. 45, 7): the weighted-frequency combiner behind a
        band-pass, of one harmonic, and a second one with its rate. There the second combiner gets the unfiltered
        value; the high-pass and its correction are ours.
    """
    corner = math.tan(math.pi * numbers[1] * period)
    sections.advance_section(memory, 0, value, corner, _DAMPING)
    passed = value - _DAMPING * memory[0] - memory[1]
    middle = math.tan(math.pi * numbers[0] * period)
    heard = _band_pass(memory, _SECOND, passed, middle)
    heard = _band_pass(memory, _THIRD, heard, middle)
    rate = 2.0 * math.pi * numbers[0] + memory[RATE]
    phase = memory[_PHASE] + rate * period
    if phase > 2.0 * math.pi:
        phase -= 2.0 * math.pi
    memory[_PHASE] = phase
    sine, cosine = math.sin(phase), math.cos(phase)
    learned = memory[_HEARD] * sine + memory[_HEARD + 1] * cosine
    turned = memory[_HEARD] * cosine - memory[_HEARD + 1] * sine
    error = heard - learned
    power = learned * learned + turned * turned + _FAINT * _FAINT
    drift = 2.0 * numbers[2] * numbers[3] * period * error * turned / power
    memory[RATE] = min(max(memory[RATE] + drift, -_REACH), _REACH)
    _teach(memory, _HEARD, 2.0 * numbers[2] * period * error, sine, cosine)
    learned = memory[_SUBTRACTED] * sine + memory[_SUBTRACTED + 1] * cosine
    turned = memory[_SUBTRACTED] * cosine - memory[_SUBTRACTED + 1] * sine
    _teach(memory, _SUBTRACTED, 2.0 * numbers[2] * period * (passed - learned), sine, cosine)
    ratio = math.tan(0.5 * rate * period) / corner
    return value - (1.0 - 1.0 / (ratio * ratio)) * learned + (_DAMPING / ratio) * turned


@inner
def _teach(memory: Array, at: int, step: float, sine: float, cosine: float) -> None:
    memory[at] += step * sine
    memory[at + 1] += step * cosine


WFLC = TremorFilter("wflc", WflcParameters, wflc_filter)
