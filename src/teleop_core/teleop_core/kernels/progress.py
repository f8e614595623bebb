"""Progress of one-time work: whether this process is now compiling a kernel or making a grid.

Such work takes seconds, during which the thread that needs the kernel makes no progress. A watchdog asks this module
before it treats a thread as hung. Kernels that are loaded from disk do not count.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_lock = threading.Lock()
_counts = {"running": 0, "done": 0}


def begun() -> None:
    """Count a kernel whose compilation begins; the compiler calls this in the thread that compiles."""
    with _lock:
        _counts["running"] += 1


def ended() -> None:
    """Count a kernel whose compilation is finished or has failed."""
    with _lock:
        _counts["running"] -= 1
        _counts["done"] += 1


def is_compiling() -> bool:
    """Whether any thread of this process compiles a kernel now."""
    return _counts["running"] > 0


_told: dict[str, str] = {}


@contextmanager
def told(work: str) -> Iterator[Callable[[str], None]]:
    """Report work that takes seconds. Yields a function, which the work calls with its progress."""
    _told[work] = ""
    try:
        yield lambda text: _told.update({work: text})
    finally:
        _told.pop(work, None)


def in_work() -> str:
    """Text about the current one-time work of this process and its progress; empty if there is none."""
    for work, text in list(_told.items()):
        return f"{work} ({text})" if text else work
    return f"compiling kernels ({compiled_count()} so far)" if is_compiling() else ""


def compiled_count() -> int:
    """Number of kernels that this process has compiled, including kernels that other kernels call."""
    return _counts["done"]
