"""Sessions: which live sessions run on this machine, so that one command can stop them all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def _folder() -> Path:
    """Where sessions of this user leave their mark."""
    return Path(tempfile.gettempdir()) / f"teleop_core_{os.getuid()}"


@contextmanager
def announced(domain: int) -> Iterator[None]:
    """Let others on this machine find a session of this process on a ROS domain, meanwhile."""
    mark = _folder() / f"{os.getpid()}.{domain}"
    with suppress(OSError):  # nobody loses a session because of a mark
        mark.parent.mkdir(mode=0o700, exist_ok=True)
        mark.touch()
    try:
        yield
    finally:
        with suppress(OSError):
            mark.unlink()


def domains() -> tuple[int, ...]:
    """ROS domains of the sessions that run here; marks of dead processes are removed."""
    found = set()
    for mark in _folder().glob("*.*"):
        pid, _, domain = mark.name.partition(".")
        if not (pid.isdigit() and domain.isdigit()):
            continue
        if Path(f"/proc/{pid}").exists():
            found.add(int(domain))
        else:
            with suppress(OSError):
                mark.unlink()
    return tuple(sorted(found))
