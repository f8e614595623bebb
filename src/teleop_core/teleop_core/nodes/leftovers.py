"""Leftovers: files in shared memory of processes that were killed.

Fast DDS 2.14 keeps segments and ports of its shared-memory transport as files, and removes them
when a participant leaves; of a process that is killed they stay, half a megabyte each. Beside each
stands a lock file that the owner keeps locked as long as it lives (``flock``, which ends with the
process): who gets the lock knows that the owner is dead. A file that was just made is left alone:
its owner may be about to lock it.
"""

import fcntl
import os
import re
import time
from contextlib import suppress
from pathlib import Path

FOLDER = Path("/dev/shm")
_LOCK = re.compile(r"(?P<file>(fastrtps|fastdds)_([0-9a-z]{16}|port\d+))_[es]l")

_PORT = re.compile(r"(fastrtps|fastdds)_port\d+")  # its lock goes with its last reader
_YOUNG = 60.0  # seconds


def remove_leftovers(folder: Path = FOLDER) -> int:
    """Remove files without a living owner; leave files that cannot be opened.

    Args:
        folder: Where the middleware keeps its shared memory.

    Returns:
        Number of segments and ports removed.
    """
    if not folder.is_dir():
        return 0
    locks: dict[str, list[Path]] = {}
    for path in folder.iterdir():
        if found := _LOCK.fullmatch(path.name):
            locks.setdefault(found["file"], []).append(path)
    removed = sum(_remove(folder, name, own) for name, own in locks.items())
    unlocked = [p for p in folder.iterdir() if _PORT.fullmatch(p.name) and p.name not in locks]
    used = _mapped(folder) if unlocked else set()
    return removed + sum(_remove(folder, p.name, [p]) for p in unlocked if p.name not in used)


def _remove(folder: Path, name: str, locks: list[Path]) -> bool:
    """Remove one file with its locks, while holding them all."""
    held = []
    try:
        for path in locks:
            held.append(file := path.open("rb+"))
            if time.time() - os.fstat(file.fileno()).st_mtime < _YOUNG:
                return False
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for path in (folder / name, folder / f"sem.{name}_mutex", *locks):
            path.unlink(missing_ok=True)
    except OSError:  # somebody holds it, or it is not ours
        return False
    finally:
        for file in held:
            file.close()
    return True


def _mapped(folder: Path) -> set[str]:
    """Names of the files that processes of this machine have in their memory."""
    found: set[str] = set()
    for path in Path("/proc").glob("[0-9]*/maps"):
        with suppress(OSError):
            found |= set(re.findall(rf"{re.escape(str(folder))}/(\S+)", path.read_text()))
    return found
