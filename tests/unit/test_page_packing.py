"""Packing of a page's numbers: what is unpacked again, and how little it takes."""

import base64
import zlib

import numpy as np
import pytest

from teleop_console.report.packing import Arrays, packed
from teleop_core.kernels.geometry import Array


def unpacked(text: str) -> Array:
    """The numbers again, by sums over Python's integers."""
    data = zlib.decompress(base64.b64decode(text), -zlib.MAX_WBITS)
    count, bits = len(data) // 4, [0]
    for i in range(count):
        bits.append((bits[-1] + sum(data[n * count + i] << 8 * n for n in range(4))) % (1 << 32))
    return np.array(bits[1:], "<u4").view("<f4").astype(float)


@pytest.mark.parametrize(
    "values",
    [
        400.0 + np.cumsum(np.random.default_rng(1).normal(scale=0.02, size=2000)),
        np.array([0.0, -0.0, 1e-30, -3e30, np.nan, np.inf, 7.0]),
        np.arange(500),
        np.empty(0),
    ],
)
def test_numbers_are_unpacked_in_single_precision(values: Array) -> None:
    assert np.array_equal(unpacked(packed(values)), np.float32(values), equal_nan=True)


def test_regular_times_take_next_to_nothing() -> None:
    assert len(packed(np.arange(100_000) * 1e-3)) < 50_000


def test_each_array_is_packed_once() -> None:
    arrays, times = Arrays(), np.arange(10) * 0.1
    named = arrays.named({"a": times, "b": [times.copy(), times[1:]], "c": float("nan")})
    assert named == {"a": {"array": 0}, "b": [{"array": 0}, {"array": 1}], "c": None}
    assert len(arrays.packed()) == 2
