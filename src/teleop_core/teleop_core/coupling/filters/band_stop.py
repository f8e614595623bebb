"""Band stop: removes all frequencies between two edges, with a response as flat as possible outside."""

import math
from dataclasses import dataclass

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.coupling.filters import TremorFilter, sections
from teleop_core.kernels import Array, inner, kernel


@dataclass(frozen=True, kw_only=True)
class BandStopParameters:
    """Edges of the band."""

    low: float = parameter(8.0, Within(3.0, 25.0, "Hz"), "lower edge of the stop band, at which 3 dB are removed")
    high: float = parameter(12.0, Within(3.0, 25.0, "Hz"), "upper edge of the stop band, at which 3 dB are removed")

    def __post_init__(self) -> None:
        """Refuse edges that enclose no band."""
        if self.high <= self.low:
            raise ParameterError("high", self.high, f"> low ({self.low})")


@inner
def _section(memory: Array, at: int, value: float, real: float, imaginary: float, center: float) -> float:
    """Set up a section with a pair of poles (real ± imaginary j) and zeros at ``± j sqrt(center)``."""
    square = real * real + imaginary * imaginary
    slope = math.sqrt(square)
    damping = -2.0 * real / slope
    sections.advance_section(memory, at, value, slope, damping)
    return value - damping * memory[at] + (center / square - 1.0) * memory[at + 1]


@kernel
def band_stop_filter(numbers: Array, memory: Array, value: float, period: float) -> float:
    """Value without the frequencies in the band: Butterworth of order 4, two sections.

    The poles ``p = exp(±3πj/4)`` of the low-pass of order 2 are mapped to the roots of
    ``s² - (width / p) s + low high = 0``, with edges warped by the bilinear transform.

    Source:
        Oppenheim and Schafer 2010 (Discrete-Time Signal Processing), section 7.2 and appendix B;
        Constantinides 1970 for the step from low-pass to band stop.
    """
    low = math.tan(math.pi * numbers[0] * period)
    high = math.tan(math.pi * numbers[1] * period)
    center, width = low * high, high - low
    # The root of h² - center, where h = width / (2 p) = half (-1 - j) and h² = 2 half² j.
    half = width / math.sqrt(8.0)
    product = half * half
    length = math.sqrt(center * center + 4.0 * product * product)
    imaginary = math.sqrt(0.5 * (length + center))
    real = product / imaginary
    value = _section(memory, 0, value, -half + real, -half + imaginary, center)
    return _section(memory, sections.WIDTH, value, -half - real, -half - imaginary, center)


BAND_STOP = TremorFilter("band_stop", BandStopParameters, band_stop_filter)
