"""Shipped kernels: kernels of the built-in parts, compiled when the wheel was made.

A wheel for x86-64 contains these kernels in ``kernels/compiled``, for processors with AVX2 and FMA. Nearly all
processors since 2013 have AVX2 and FMA. Only ``make wheel`` writes to this folder. A source tree has no shipped
kernels.
"""

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).with_name("compiled")
_PACKAGE = Path(__file__).parents[1]

TIER = "x86-64-v3"
"""Tier of the x86-64 psABI for which the shipped kernels are compiled."""
_NEEDED = frozenset((
    "cx16", "lahf_lm", "popcnt", "pni", "ssse3", "sse4_1", "sse4_2",
    "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe", "xsave",
))  # fmt: skip
"""Abilities of all processors of the tier, as Linux names them."""


def places(source: Path) -> Iterator[tuple[str, Path]]:
    """The tier, with the folder of a source file's kernels, if this processor can run them.

    If ``NUMBA_CPU_NAME`` sets the processor for which numba compiles, only that processor counts.
    """
    if source.is_relative_to(_PACKAGE) and is_tier():
        yield TIER, FOLDER / TIER / source.parent.relative_to(_PACKAGE)


@cache
def is_tier() -> bool:
    """Whether this processor, or the processor for which numba must compile, belongs to the tier."""
    asked = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NUMBA_CPU_FEATURES")
    if asked != (None, None):
        return asked == (TIER, "")
    return set(_told("flags").split()) >= _NEEDED


@cache
def processor() -> str:
    """Name and abilities of this processor; they determine the code that the compiler makes."""
    return f"{_told('model name')} {_told('cpu family')} {_told('model')} {_told('flags')}"


def _told(name: str) -> str:
    """What Linux says of this processor."""
    with suppress(OSError):
        found = re.search(rf"^{name}\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
        return found[1] if found else ""
    return ""
