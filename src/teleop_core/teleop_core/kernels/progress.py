"""Progress of what is made once: whether this process compiles a kernel, or makes a grid, now.

That takes seconds, in which the thread that needs the kernel stands still: whoever watches
threads asks here before taking one for hung. Kernels that are loaded from disk do not count.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core import event


class _Progress(event.Listener):  # type: ignore[misc]
    """Counter of the compiler's events, which come in the thread that compiles."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.running = self.done = 0

    def on_start(self, event: object) -> None:
        """Count a kernel that is begun; those that it calls are begun within."""
        with self._lock:
            self.running += 1

    def on_end(self, event: object) -> None:
        """Count a kernel that is finished, or cannot be compiled."""
        with self._lock:
            self.running -= 1
            self.done += 1


_progress = _Progress()
event.register("numba:compile", _progress)


def is_compiling() -> bool:
    """Whether any thread of this process compiles a kernel now."""
    return _progress.running > 0


_told: dict[str, str] = {}


@contextmanager
def told(work: str) -> Iterator[Callable[[str], None]]:
    """Tell of work that takes seconds: hands out a function that takes how far it is."""
    _told[work] = ""
    try:
        yield lambda text: _told.update({work: text})
    finally:
        _told.pop(work, None)


def in_work() -> str:
    """What this process makes now, and how far it is; empty if it makes nothing."""
    for work, text in list(_told.items()):
        return f"{work} ({text})" if text else work
    return f"compiling kernels ({compiled_count()} so far)" if is_compiling() else ""


def compiled_count() -> int:
    """Number of kernels that this process has compiled, those inside others included."""
    return _progress.done
