"""Sessions: the live sessions on this machine, at most one on each ROS domain.

A session locks a file of its domain (``flock``). The lock ends with the session's process, however the process ends: a
file that is not locked belongs to no session.
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
    """Folder of the lock files of this user's sessions."""
    return Path(tempfile.gettempdir()) / f"teleop_core_{os.getuid()}"


def _holds(file: IO[str]) -> bool:
    """Lock a file without waiting; return whether the file is now locked by this process."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextmanager
def announced(domain: int) -> Iterator[None]:
    """Own a ROS domain of this machine within this context, so that other programs find its session.

    Raises:
        SessionError: Another session owns the domain.
    """
    mark = _folder() / f"{domain}.domain"
    try:
        file = _held(mark)
    except OSError:  # a problem with a lock file must not end a session
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
    """Open the lock file, and lock it unless another session has locked it; never a file that was removed meanwhile."""
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
    """ROS domains of the sessions on this machine."""
    found = set()
    for mark in _folder().glob("*.domain"):
        with suppress(OSError, ValueError), mark.open("r") as file:
            if not _holds(file):
                found.add(int(mark.stem))
    return tuple(sorted(found))
