"""Packing: numbers of a page as few bytes, by differences of rounded values."""

import base64
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from teleop_core.geometry import Array

FINEST_BITS = 8.0
"""Bits per number that are never exceeded: the finest steps that anybody could want to see."""
_COARSEST_BITS = 2.0
_LEVELS = 2.0**26  # a range has no more steps than this, so that differences fit into 32 bits
_FACTORS = (1, 2, 5, 10)
_WIDE = 2.0**22  # more steps than this away from zero do not fit into float32


@dataclass(frozen=True)
class Packed:
    """Rounded numbers: ``first + step * k``, where the k are sums of what ``data`` holds.

    Attributes:
        count: How many numbers.
        first: The first of them.
        step: Distance of neighbouring levels, in the unit of the numbers.
        order: How often differences were taken, 1 or 2.
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


def pack(values: "np.ndarray[Any, Any]", bits: float) -> Packed:
    """Numbers in about so many bits each, whatever they are.

    Steps are as fine as that allows. Of all differences with a mean magnitude m, those with
    Laplace's distribution have the largest entropy, log2(2 e m / step) (Cover and Thomas 2006,
    chapter 12). So curves are rounded to a part of how much they change from one sample to the
    next, however closely one looks, and steady ones cost next to nothing.

    Args:
        values: Shape (N,); what is not finite becomes NaN.
        bits: Bits per number; at most :data:`FINEST_BITS` are used.
    """
    numbers = np.asarray(values, dtype=float)
    is_hole = ~np.isfinite(numbers)
    filled = _filled(numbers, is_hole)
    if not len(filled):
        return Packed(0, 0.0, 1.0, 1, 0, "", "", wide=False)
    first = float(filled[0])
    step = step_for(filled, bits)
    levels = np.round((filled - first) / step).astype(np.int64)
    order, differences = _shortest(levels)
    codes = ((differences << 1) ^ (differences >> 63)).astype("<u4")
    planes = (int(codes.max()).bit_length() + 7) // 8
    data = codes.view(np.uint8).reshape(-1, 4)[:, :planes].T.tobytes()
    holes = deflated(np.packbits(is_hole, bitorder="little").tobytes()) if is_hole.any() else ""
    wide = bool(np.abs(filled).max() / step > _WIDE)
    return Packed(len(filled), first, step, order, planes, deflated(data), holes, wide)


def step_for(filled: Array, bits: float) -> float:
    """Step of 1, 2 or 5 times a power of ten with which finite numbers (N,) need so many bits."""
    bits = min(max(bits, _COARSEST_BITS), FINEST_BITS)
    change = min(float(np.abs(np.diff(filled, order)).mean()) if len(filled) > order else 0.0
                 for order in (1, 2))  # fmt: skip
    finest = float(np.ptp(filled)) / _LEVELS if len(filled) else 0.0
    wanted = 2.0 * np.e * change * 2.0**-bits
    if wanted < finest:
        return _nice(finest, lowest=True)
    return _nice(wanted) if wanted else 1.0


def _nice(step: float, *, lowest: bool = False) -> float:
    """Nearest of 1, 2 and 5 times a power of ten that is not above, or else not below, a step."""
    power = int(np.floor(np.log10(step)))
    choices = [float(f"{factor}e{power}") for factor in _FACTORS]
    tolerance = 1e-9 * step
    if lowest:
        return min(choice for choice in choices if choice >= step - tolerance)
    return max(choice for choice in choices if choice <= step + tolerance)


def deflated(data: bytes) -> str:
    """Bytes as base64 of a raw deflate stream, which browsers unpack by themselves."""
    packer = zlib.compressobj(6, zlib.DEFLATED, -zlib.MAX_WBITS, 9)
    return base64.b64encode(packer.compress(data) + packer.flush()).decode("ascii")


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
