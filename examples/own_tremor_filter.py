"""Remove the tremor of the hand by your own filter, and measure the delay of a low-pass."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LowPassParameters:
    """Parameters for ``--set tremor_filter.low_pass.corner=...``; the filter gets them as numbers."""

    corner: float = tc.parameter(3.0, tc.Within(0.1, 25.0, "Hz"), "what is faster goes")


@tc.kernel
def low_pass(numbers: Array, memory: Array, value: float, period: float) -> float:
    """Return the value after two first-order lags in series, for any period."""
    share = 1.0 - math.exp(-2.0 * math.pi * numbers[0] * period)
    memory[0] += share * (value - memory[0])
    memory[1] += share * (memory[0] - memory[1])
    return float(memory[1])


tc.register_tremor_filter(tc.TremorFilter("low_pass", LowPassParameters, low_pass))


def main() -> None:
    """Print the remaining tremor and the delay of this filter and of the built-in filters."""
    for kind in ("low_pass", "notch", "band_stop", "kalman", "wflc"):
        recording = tc.run("human", duration=12.0, stages="tremor_filter", settings={"tremor_filter.kind": kind})
        score = recording.score()
        left, delay = (score.value(f"tremor_filter.{key}") for key in ("left_share", "delay_ms"))
        print(f"{kind}: {100.0 * (left or 0.0):.0f} % left, {delay or 0.0:.1f} ms late")


if __name__ == "__main__":
    main()
