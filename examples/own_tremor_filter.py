"""Take the tremor out of the hand by a filter of your own, and see what a low-pass costs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LowPassParameters:
    """What ``--set tremor_filter.low_pass.corner=...`` sets; the filter gets it as a number."""

    corner: float = tc.parameter(3.0, tc.Within(0.1, 25.0, "Hz"), "what is faster goes")


@tc.kernel
def low_pass(numbers: Array, memory: Array, value: float, period: float) -> float:
    """Follow the value by two lags in a row, at any period."""
    share = 1.0 - math.exp(-2.0 * math.pi * numbers[0] * period)
    memory[0] += share * (value - memory[0])
    memory[1] += share * (memory[0] - memory[1])
    return float(memory[1])


tc.register_tremor_filter(tc.TremorFilter("low_pass", LowPassParameters, low_pass))


def main() -> None:
    """Print for this filter and the built-in ones how much tremor they leave, and their delay."""
    for kind in ("low_pass", "notch", "band_stop", "kalman", "wflc"):
        recording = tc.run("human", duration=12.0, stages="tremor_filter", settings={"tremor_filter.kind": kind})
        score = recording.score()
        left, delay = (score.value(f"tremor_filter.{key}") for key in ("left_share", "delay_ms"))
        print(f"{kind}: {100.0 * (left or 0.0):.0f} % left, {delay or 0.0:.1f} ms late")


if __name__ == "__main__":
    main()
