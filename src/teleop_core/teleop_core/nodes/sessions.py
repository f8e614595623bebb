"""Sessions: which live sessions run on this machine, one at most on each ROS domain.

A session holds a lock on a file of its domain (``flock``), which ends with its process however
that ends: a file whose lock is free belongs to nobody.
"""

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from teleop_core.base.errors import SessionError


def _folder() -> Path:
    """Where sessions of this user leave their mark."""
    return Path(tempfile.gettempdir()) / f"teleop_core_{os.getuid()}"


def _holds(file: IO[str]) -> bool:
    """Whether the lock of a mark could be had."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextmanager
def announced(domain: int) -> Iterator[None]:
    """Own a ROS domain of this machine, and let others find its session, meanwhile.

    Raises:
        SessionError: Another session has it.
    """
    mark = _folder() / f"{domain}.domain"
    try:
        file = _held(mark)
    except OSError:  # nobody loses a session because of a mark
        yield
        return
    with file:
        file.seek(0)
        if not _holds(file):
            raise SessionError(
                f"ROS domain {domain} has a session already, process {file.read().strip()}: end "
                "it, set ROS_DOMAIN_ID to another domain, or unset it to get a free one"
            )
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        try:
            yield
        finally:
            with suppress(OSError):
                mark.unlink()


def _held(mark: Path) -> IO[str]:
    """Open mark, locked if nobody else holds it; never one that was removed meanwhile."""
    mark.parent.mkdir(mode=0o700, exist_ok=True)
    while True:
        file = mark.open("a+")
        if not _holds(file):
            return file
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), mark.stat()):
                return file
        file.close()


def domains() -> tuple[int, ...]:
    """ROS domains of the sessions that run here."""
    found = set()
    for mark in _folder().glob("*.domain"):
        with suppress(OSError, ValueError), mark.open("r") as file:
            if not _holds(file):
                found.add(int(mark.stem))
    return tuple(sorted(found))
