"""Shipped kernels: kernels of the built-in parts, compiled when the wheel was made.

A wheel for x86-64 contains these kernels in ``kernels/compiled``, for processors with AVX2 and FMA. Nearly all
processors since 2013 have AVX2 and FMA. Only ``make wheel`` writes to this folder. A source tree has no shipped
kernels.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba
from llvmlite.binding import get_host_cpu_features

FOLDER = Path(__file__).with_name("compiled")
_PACKAGE = Path(__file__).parents[1]

TIER = "x86-64-v3"
"""Tier of the x86-64 psABI for which the shipped kernels are compiled."""
_NEEDED = (
    "cx16", "sahf", "popcnt", "sse3", "ssse3", "sse4.1", "sse4.2",
    "avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave",
)  # fmt: skip


def places(source: Path) -> Iterator[tuple[str, Path]]:
    """The tier, with the folder of a source file's kernels, if this processor can run them.

    If ``NUMBA_CPU_NAME`` sets the processor for which numba compiles, only that processor counts.
    """
    if source.is_relative_to(_PACKAGE) and is_tier():
        yield TIER, FOLDER / TIER / source.parent.relative_to(_PACKAGE)


@cache
def is_tier() -> bool:
    """Whether this processor, or the processor for which numba must compile, belongs to the tier."""
    config: Any = numba.config
    asked = (config.CPU_NAME, config.CPU_FEATURES)
    if asked != (None, None):
        return asked == (TIER, "")
    features = get_host_cpu_features()
    return all(features.get(name) for name in _NEEDED)
