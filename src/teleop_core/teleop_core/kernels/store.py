"""Store: folder of this user's compiled kernels, by the digest of their sources.

A kernel that was compiled from one copy of a source is used for every other copy with the same text: a second clone,
another environment, a fresh checkout of a test run. Old versions are kept until they have not been used for
:data:`KEPT_DAYS`.
"""

import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FunctionType

from teleop_core.kernels.dependencies import hexdigest

try:
    import fcntl
except ImportError:  # not on Unix
    fcntl = None  # type: ignore[assignment]

KEPT_DAYS = 30
"""Days after which :func:`prune` removes unused kernels."""
_TAG = f"py{sys.version_info[0]}{sys.version_info[1]}"


def folder() -> Path | None:
    """Folder of the store; None if kernels are stored beside their source, as numba does.

    ``TELEOP_KERNELS`` names another folder. If it is empty, or ``NUMBA_CACHE_DIR`` is set, there is no store.
    """
    named = os.environ.get("TELEOP_KERNELS")
    if os.environ.get("NUMBA_CACHE_DIR") or named == "":
        return None
    if named:
        return Path(named)
    return user_cache("kernels")


def user_cache(name: str) -> Path | None:
    """Cache folder of this user, for files that can be made again; None if the home folder is unknown."""
    with suppress(RuntimeError):
        caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        return Path(caches) / "teleop_core" / name
    return None


def place(function: FunctionType, stamp: Iterable[str]) -> Path | None:
    """Path in the store of a function with a given stamp; None if there is no store.

    Functions with the same name in one file are distinguished by their line.
    """
    kept = folder()
    if kept is None:
        return None
    line = function.__code__.co_firstlineno
    key = hexdigest((*stamp, function.__module__ or "", function.__qualname__, str(line)))
    return kept / key[:2] / f"{function.__name__}-{key[2:]}.{_TAG}"


@contextmanager
def locked(kept: Path) -> Iterator[None]:
    """Let only one process at a time write in a folder, because each process reads the index before it adds to it.

    If two processes added to an index at the same time, two kernels would get the same file.
    """
    with (kept / ".lock").open("a") as lock:
        if fcntl is not None:
            fcntl.flock(lock, fcntl.LOCK_EX)  # released when the file is closed
        yield


def prune(days: float = KEPT_DAYS) -> int:
    """Remove kernels and grids that were not used for some days; returns the number of removed files."""
    kept, removed = folder(), 0
    oldest = time.time() - 86400.0 * days
    grids = user_cache("grids")
    found = [*(kept.glob("*/*.nb[io]") if kept else ()), *(grids.glob("*.npz") if grids else ())]
    for index in found:
        with suppress(OSError):
            if index.stat().st_mtime < oldest:
                for file in index.parent.glob(f"{index.stem}.*"):
                    file.unlink()
                    removed += 1
    return removed
