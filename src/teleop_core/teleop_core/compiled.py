"""Compiled kernels: one decorator, so that every kernel is compiled in the same way.

Kernels are cached on disk. numba invalidates a cached kernel when *its* file changes, not when a
kernel that it calls changes; a stale caller would silently go on with old formulas. Here the
stamp of a cached kernel therefore covers every source file of the package.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import NullCache


@cache
def _package_stamp() -> tuple[float, int]:
    """Newest change and total size of the package's sources, in the form numba stores."""
    stats = [path.stat() for path in Path(__file__).parent.rglob("*.py")]
    return max(s.st_mtime for s in stats), sum(s.st_size for s in stats)


def _cover_whole_package(kernel_cache: Any) -> None:
    if not isinstance(kernel_cache, NullCache):
        kernel_cache._cache_file._source_stamp = _package_stamp()


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a pure function over float64 arrays and records.

    No ``fastmath``: results are the same on every machine and in every run mode. The kernel
    releases the interpreter lock, so that other threads run beside it.
    """
    dispatcher = numba.njit(cache=True, nogil=True)(function)
    _cover_whole_package(dispatcher._cache)
    return dispatcher


def pointer(compiled: Any, signature: Any) -> Any:
    """Kernel as a first-class value of a fixed signature, which other kernels take as argument.

    Args:
        compiled: A function made by :func:`kernel`.
        signature: numba signature, the same for all kernels that may stand in this place.

    Returns:
        The callable to hand to a kernel.
    """
    return numba.cfunc(signature, cache=True)(compiled.py_func)
