"""Packing of a page's numbers: what is unpacked again, how near it is, and how little it takes."""

import base64
import zlib
from typing import Any

import numpy as np
import pytest

from teleop_core.evaluation.packing import EXACT, FINEST_BITS, Packed, bits_within, pack
from teleop_core.kernels.geometry import Array

# Steps come out as decimal fractions; sums of half a million of them as float64.
ROUNDING = 1e-6


def inflated(text: str) -> bytes:
    return zlib.decompress(base64.b64decode(text), -zlib.MAX_WBITS) if text else b""


def unpacked(packed: Packed) -> Array:
    """The numbers again, by sums over Python's integers."""
    data = inflated(packed.data)
    if packed.order == 0:
        return np.frombuffer(data, "<f8")
    numbers, level, change = [], 0, 0
    for i in range(packed.count):
        code = sum(data[plane * packed.count + i] << 8 * plane for plane in range(packed.planes))
        difference = -(code + 1) // 2 if code % 2 else code // 2
        change = change + difference if packed.order == 2 else difference
        level += change
        numbers.append(packed.first + packed.step * level)
    found = np.array(numbers, float)
    if packed.holes:
        bits = np.unpackbits(np.frombuffer(inflated(packed.holes), np.uint8), bitorder="little")
        found[bits[: packed.count] > 0] = np.nan
    return found


def walk(count: int = 20_000, seed: int = 1) -> Array:
    return 400.0 + np.cumsum(np.random.default_rng(seed).normal(scale=0.02, size=count))


@pytest.mark.parametrize(
    "values",
    [
        walk(),
        np.random.default_rng(2).laplace(size=10_000),
        np.linspace(-3.0, 5.0, 7777),
        np.repeat([0.0, 0.055, 0.11, 0.055], 2000),
        np.concatenate((np.zeros(5000), [1e6], np.zeros(5000))),
        np.full(5000, -3.5),
        1e-9 * np.arange(9000) ** 2,
        np.arange(10_000),
        walk(EXACT + 1),
    ],
)
@pytest.mark.parametrize("bits", [2.0, 5.0, 8.0])
def test_unpacked_numbers_are_within_half_a_step(values: Any, bits: float) -> None:
    packed = pack(values, bits)
    half = 0.5 * packed.step * (1.0 + ROUNDING) + 1e-12 * np.abs(values).max()
    assert packed.count == len(values)
    assert np.abs(unpacked(packed) - values).max() <= half


def test_what_is_no_number_is_a_hole_and_nothing_else_is() -> None:
    values = walk(9000)
    values[:7] = values[100:250] = values[-1] = np.nan
    values[500], values[501] = np.inf, -np.inf
    found = unpacked(pack(values, 6.0))
    assert np.array_equal(np.isnan(found), ~np.isfinite(values))
    is_known = np.isfinite(values)
    assert np.abs(found - values)[is_known].max() < 0.01


@pytest.mark.parametrize("values", [np.full(9000, np.nan), np.full(9, np.nan), np.empty(0)])
def test_without_numbers_there_are_only_holes(values: Array) -> None:
    assert np.array_equal(unpacked(pack(values, 4.0)), values, equal_nan=True)


def test_few_numbers_are_not_rounded() -> None:
    values = 10.0 ** np.random.default_rng(5).uniform(-9, 9, EXACT)
    values[7] = np.nan
    assert np.array_equal(unpacked(pack(values, 2.0)), values, equal_nan=True)


@pytest.mark.parametrize("bits", [3.0, 4.0, 6.0])
@pytest.mark.parametrize("noise", ["normal", "laplace", "uniform"])
def test_noise_takes_no_more_bits_than_allowed(bits: float, noise: str) -> None:
    values = np.cumsum(getattr(np.random.default_rng(4), noise)(size=200_000))
    packed = pack(values, bits)
    taken = 8 * len(base64.b64decode(packed.data)) / packed.count
    assert taken <= bits + 0.2  # deflate's codes have whole bits
    assert taken >= bits - 2.0, "coarser than there is room for"


def test_rounding_is_a_part_of_the_change_from_sample_to_sample() -> None:
    values = walk()
    packed = pack(values, 5.0)
    assert packed.step <= 0.5 * np.abs(np.diff(values)).mean()


def test_more_bits_than_the_finest_change_nothing() -> None:
    assert pack(walk(), 30.0) == pack(walk(), FINEST_BITS)


@pytest.mark.parametrize("period", [0.001, 0.008, 0.02, 1.0 / 30.0])
def test_regular_times_take_next_to_nothing(period: float) -> None:
    times = np.arange(100_000) * period
    packed = pack(times, 4.0)
    assert np.abs(unpacked(packed) - times).max() <= 0.005 * period
    assert len(packed.data) < 12_000


def test_steps_are_short_decimal_fractions() -> None:
    rng = np.random.default_rng(6)
    for scale in 10.0 ** rng.uniform(-7, 7, 100):
        step = pack(scale * walk(5000), 5.0).step
        assert f"{step:.0e}"[0] in "125"
        assert step == float(f"{step:.0e}")


def test_large_numbers_are_unpacked_in_double_precision() -> None:
    assert pack(1e9 + walk(), 6.0).wide
    assert not pack(walk(), 4.0).wide


def test_all_arrays_together_fill_the_room_but_no_more() -> None:
    rng = np.random.default_rng(8)
    steps = np.repeat(rng.integers(0, 9, 3000), 100) * 0.055
    arrays = [walk(300_000, 1), walk(300_000, 2), rng.normal(size=300_000), steps]
    for room in (400_000, 700_000):
        bits = bits_within(arrays, room)
        taken = sum(len(pack(array, bits).data) for array in arrays)
        assert taken <= 1.03 * room  # tried on parts of them
        assert taken >= 0.7 * room
    assert bits_within(arrays, 10**9) == FINEST_BITS
    assert bits_within([], 100) == FINEST_BITS
