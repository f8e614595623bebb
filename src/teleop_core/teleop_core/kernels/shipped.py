"""Shipped kernels: those of the built-in parts, compiled when the wheel was made.

A wheel for x86-64 holds them in ``kernels/compiled``, a folder for each tier of processors; only
``make wheel`` writes there. A source tree has none.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba
from llvmlite.binding import get_host_cpu_features

FOLDER = Path(__file__).with_name("compiled")
_PACKAGE = Path(__file__).parents[1]

_V2 = ("cx16", "sahf", "popcnt", "sse3", "ssse3", "sse4.1", "sse4.2")
_V3 = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")
TIERS = {"x86-64-v3": _V2 + _V3, "x86-64-v2": _V2}
"""Tiers of the x86-64 psABI, the best first, with what a processor must have for them."""


def places(source: Path) -> Iterator[tuple[str, Path]]:
    """Tiers that this processor can run, best first, with the folder of a source file's kernels.

    Where numba was told to compile for one processor (``NUMBA_CPU_NAME``), that one alone counts.
    """
    if source.is_relative_to(_PACKAGE):
        for tier in _tiers():
            yield tier, FOLDER / tier / source.parent.relative_to(_PACKAGE)


@cache
def _tiers() -> tuple[str, ...]:
    shipped = [tier for tier in TIERS if (FOLDER / tier).is_dir()]
    config: Any = numba.config
    asked = (config.CPU_NAME, config.CPU_FEATURES)
    if asked != (None, None):
        return tuple(tier for tier in shipped if (tier, "") == asked)
    features = get_host_cpu_features()
    return tuple(t for t in shipped if all(features.get(name) for name in TIERS[t]))
