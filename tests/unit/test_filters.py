"""Reference low-pass: published coefficients and step, and the printed sign that diverges."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop_core.base import build
from teleop_core.kernels.filters import lag_step
from teleop_core.kernels.geometry import Array
from teleop_core.slave.parameters import ReferenceFilterParameters

GAIN, ZERO, POLE, DT = 0.1, 100.0, 10.0, 1e-3
# One difference equation of three terms.
ROUNDING = 1e-15


def filtered(values: Any, start: float = 0.0, gain: float = GAIN, zero: float = ZERO, pole: float = POLE) -> Array:
    """Output of the filter that rests at ``start`` before the values come."""
    last_input, output, out = start, start, []
    for value in values:
        output = lag_step(value, last_input, output, gain, zero, pole, DT)
        last_input = value
        out.append(output)
    return np.array(out)


def test_gimbal_noise_comes_out_at_a_quarter_or_less() -> None:
    noise = np.random.default_rng(1).uniform(-2e-3, 2e-3, 20_000)
    # ±2e-3 rad becomes ±5e-4 rad in the source.
    assert np.abs(filtered(noise)).max() < 5e-4


def test_output_lags_90_ms_behind_a_ramp() -> None:
    times = np.arange(3000) * DT
    # 1/pole - 1/zero, in steady motion.
    assert math.isclose(times[-1] - filtered(times)[-1], 0.09, abs_tol=1e-9)


@given(st.floats(-3.0, 3.0))
def test_filter_at_rest_stays_at_rest(value: float) -> None:
    assert np.allclose(filtered(np.full(100, value), value), value, rtol=0, atol=1e-13)


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=50))
def test_output_never_leaves_the_range_of_its_inputs(values: list[float]) -> None:
    output = filtered(values, values[0])
    assert output.max() <= max(values) + 1e-13
    assert output.min() >= min(values) - 1e-13


@pytest.mark.parametrize(
    "values", [{}, {"gain": 0.2, "pole": 20.0}, {"pole": 5.0, "zero": 50.0}, {"gain": 1.0, "pole": 100.0}]
)
def test_filter_of_unit_steady_gain_is_accepted(values: dict[str, float]) -> None:
    build(ReferenceFilterParameters, values)
