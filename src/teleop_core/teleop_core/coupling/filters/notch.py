"""Notch: removes one frequency and its neighbours; a lower quality removes a wider band."""

import math
from dataclasses import dataclass

from teleop_core.base import ParameterError, Within, parameter
from teleop_core.coupling.filters import LONGEST_NS, TremorFilter, sections
from teleop_core.kernels import Array, kernel

_WIDEST = 0.45
"""Largest width of a notch times the sample period; below 0.5, where its tangent becomes infinite."""


@dataclass(frozen=True, kw_only=True)
class NotchParameters:
    """Frequency and width of the notch."""

    frequency: float = parameter(10.0, Within(3.0, 25.0, "Hz"), "frequency that the filter removes")
    quality: float = parameter(
        1.0,
        Within(0.3, 30.0),
        "frequency divided by the width of the band in which more than 3 dB are removed; slow motion "
        "is delayed by 1/(2π frequency quality)",
    )

    def __post_init__(self) -> None:
        """Refuse a notch that is too wide for slow samples."""
        least = self.frequency * 1e-9 * LONGEST_NS / _WIDEST
        if self.quality < least:
            text = f">= {least:.3g} at {self.frequency:g} Hz, or samples of 100 Hz cannot show it"
            raise ParameterError("quality", self.quality, text)


@kernel
def notch_filter(numbers: Array, memory: Array, value: float, period: float) -> float:
    """Value without frequencies near the notch's frequency.

    The width is prewarped by its tangent, so that it is correct after the bilinear transform.

    Source:
        Orfanidis 1996 (Introduction to Signal Processing), section 11.3.
    """
    angle = 2.0 * math.pi * numbers[0] * period
    damping = 2.0 * math.tan(0.5 * angle / numbers[1]) / math.sin(angle)
    sections.advance_section(memory, 0, value, math.tan(0.5 * angle), damping)
    return value - damping * memory[0]


NOTCH = TremorFilter("notch", NotchParameters, notch_filter)
