"""Packing: numbers of a page as few bytes, by differences of rounded values."""

import base64
import math
import zlib
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation.figure import Numbers
from teleop_core.kernels.geometry import Array

FINEST_BITS = 8.0
"""Bits per number that are never exceeded: the finest steps that anybody could want to see."""
EXACT = 4000
"""Arrays that are no longer than this are not rounded."""
COARSEST_BITS = 2.0
"""Bits per number that are always spent."""
_SAMPLED, _SAMPLES = 8, 2500  # stretches of an array, and numbers in each
_LEVELS = 2.0**26  # a range has no more steps than this, so that differences fit into 32 bits
_LEVEL = 4  # half the time of the usual 6, for 2 % more bytes
_STRATEGIES = (zlib.Z_DEFAULT_STRATEGY, zlib.Z_HUFFMAN_ONLY)
_FACTORS = (1, 2, 5, 10)
_WIDE = 2.0**22  # more steps than this away from zero do not fit into float32


@dataclass(frozen=True)
class Packed:
    """Rounded numbers: ``first + step * k``, where the k are sums of what ``data`` holds.

    Attributes:
        count: How many numbers.
        first: The first of them.
        step: Distance of neighbouring levels, in the unit of the numbers.
        order: How often differences were taken, 1 or 2; 0 for the numbers themselves, in 8 bytes.
        planes: Bytes per difference; the lowest bytes of all come first.
        data: Differences with the sign in the lowest bit, deflated, as base64.
        holes: One bit per number, set where there is none, deflated, as base64; empty without any.
        wide: Whether the numbers need 64 bits when they are unpacked.
    """

    count: int
    first: float
    step: float
    order: int
    planes: int
    data: str
    holes: str
    wide: bool


def bits_within(arrays: Sequence[Numbers], room: int) -> float:
    """Bits per number, the same for all arrays, with which they just have room.

    What they take is tried on some stretches of each.

    Args:
        arrays: As for :func:`pack`.
        room: Bytes for all of them, as base64.
    """
    samples = [(_stretches(array), len(array)) for array in arrays if len(array) > EXACT]

    def is_enough(bits: float) -> bool:
        taken = (len(pack(sample, bits).data) / len(sample) * count for sample, count in samples)
        return sum(taken) <= room

    choices = np.arange(COARSEST_BITS, FINEST_BITS + 0.1, 0.25).tolist()
    return choices[max(0, bisect_left(choices, True, key=lambda bits: not is_enough(bits)) - 1)]


def pack(values: Numbers, bits: float) -> Packed:
    """Numbers in at most about so many bits each, whatever they are; a few as they are.

    Steps are as fine as that allows. Of all differences with a mean magnitude m, those with
    Laplace's distribution have the largest entropy, log2(2 e m / step) (Cover and Thomas 2006,
    chapter 12). So curves are rounded to a part of how much they change from one sample to the
    next, however closely one looks, and steady ones cost next to nothing.

    Args:
        values: Shape (N,); what is not finite becomes NaN.
        bits: Bits per number, between :data:`COARSEST_BITS` and :data:`FINEST_BITS`.
    """
    numbers = np.asarray(values, dtype=float)
    if len(numbers) <= EXACT:  # such as those of an axis with a logarithmic scale
        exact = deflated(numbers.astype("<f8").tobytes())
        return Packed(len(numbers), 0.0, 0.0, 0, 8, exact, "", wide=True)
    filled = _filled(numbers, ~np.isfinite(numbers))
    return pack_to(numbers, step_for(filled, bits))


def pack_to(values: Numbers, step: float) -> Packed:
    """Numbers rounded to whole steps from the first, in as many bits as that takes.

    Args:
        values: Shape (N,), N >= 1; what is not finite becomes NaN.
        step: Distance of neighbouring levels, in the unit of the numbers; the range has at most
            2³⁰ of them.
    """
    numbers = np.asarray(values, dtype=float)
    is_hole = ~np.isfinite(numbers)
    filled = _filled(numbers, is_hole)
    first = float(filled[0])
    levels = np.round((filled - first) / step).astype(np.int64)
    order, differences = _shortest(levels)
    codes = ((differences << 1) ^ (differences >> 63)).astype("<u4")
    planes = (int(codes.max()).bit_length() + 7) // 8
    data = (plane.tobytes() for plane in codes.view(np.uint8).reshape(-1, 4).T[:planes])
    holes = deflated(np.packbits(is_hole, bitorder="little").tobytes()) if is_hole.any() else ""
    wide = bool(np.abs(filled).max() / step > _WIDE)
    return Packed(len(filled), first, step, order, planes, deflated(*data), holes, wide)


def step_for(filled: Array, bits: float) -> float:
    """Smallest step of 1, 2 or 5 times a power of ten that is enough for finite numbers (N,)."""
    bits = min(max(bits, COARSEST_BITS), FINEST_BITS)
    change = min(float(np.abs(np.diff(filled, order)).mean()) if len(filled) > order else 0.0
                 for order in (1, 2))  # fmt: skip
    finest = float(np.ptp(filled)) / _LEVELS
    wanted = max(2.0 * math.e * change * 2.0**-bits, finest)
    if not wanted:
        return 1.0
    power = int(np.floor(np.log10(wanted)))
    choices = (float(f"{factor}e{power}") for factor in _FACTORS)
    return min(choice for choice in choices if choice >= wanted * (1.0 - 1e-9))


def _stretches(array: Numbers) -> Array:
    """Some stretches of an array, each moved to where the one before ends, without holes."""
    begins = np.linspace(0, max(0, len(array) - _SAMPLES), _SAMPLED).astype(np.int64)
    rows: list[Array] = []
    for begin in begins:
        row = np.asarray(array[begin : begin + _SAMPLES], dtype=float)
        row = _filled(row, ~np.isfinite(row))
        rows.append(row + (rows[-1][-1] - row[0]) if rows else row)
    return np.concatenate(rows)


def deflated(*parts: bytes) -> str:
    """Bytes as base64 of one raw deflate stream, which browsers unpack by themselves.

    Each part is coded by the shorter of two strategies: noise has no repetitions to look for.
    """
    last = len(parts) - 1
    streams = (
        min((_stream(part, strategy, is_last=i == last) for strategy in _STRATEGIES), key=len)
        for i, part in enumerate(parts)
    )
    return base64.b64encode(b"".join(streams)).decode("ascii")


def _stream(part: bytes, strategy: int, *, is_last: bool) -> bytes:
    packer = zlib.compressobj(_LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS, 9, strategy)
    # A flush in between ends at a whole byte, so that streams can follow each other.
    return packer.compress(part) + packer.flush(zlib.Z_FINISH if is_last else zlib.Z_SYNC_FLUSH)


def _filled(numbers: Array, is_hole: NDArray[np.bool_]) -> Array:
    """Numbers with holes filled by the last one before, so that they cost nothing."""
    if not is_hole.any():
        return numbers
    if is_hole.all():
        return np.zeros(len(numbers))
    known = np.where(is_hole, 0, np.arange(len(numbers)))
    last = np.maximum.accumulate(known)
    filled = numbers[last]
    leading = int(np.argmin(is_hole))
    filled[:leading] = numbers[leading]
    return filled


def _shortest(levels: NDArray[np.int64]) -> tuple[int, NDArray[np.int64]]:
    """First or second differences, whichever are smaller."""
    once = np.diff(levels, prepend=0)
    twice = np.diff(once, prepend=0)
    return (2, twice) if np.abs(twice).sum() < np.abs(once).sum() else (1, once)
