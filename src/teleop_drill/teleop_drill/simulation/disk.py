"""Disk: the disk to which a simulated process writes its recording, and the writing thread."""

import errno
import os
from collections import deque
from collections.abc import Callable
from typing import Any, BinaryIO

from teleop_core.base.background import SYSTEM
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.scheduler import Strand

_BYTE_NS = 2
"""Time to write a byte [ns]."""


class Jobs:
    """Simulated form of :class:`~teleop_core.base.background.Jobs`."""

    def __init__(self, process: Process, size: int) -> None:
        self._scheduler, self._size = process.machine.scheduler, size
        self._jobs: deque[Any] = deque()
        self._waiting: list[Strand] = []

    def put(self, job: Any) -> None:
        """Append a job as soon as the queue has a free place."""
        while len(self._jobs) >= self._size:
            self._wait()
        self._jobs.append(job)
        self._tell()

    def get(self) -> Any:
        """Remove and return the oldest job; waits until there is one."""
        while not self._jobs:
            self._wait()
        job = self._jobs.popleft()
        self._tell()
        return job

    def empty(self) -> bool:
        """Whether no job waits."""
        return not self._jobs

    def _wait(self) -> None:
        self._waiting.append(self._scheduler.current)
        self._scheduler.wait(None)

    def _tell(self) -> None:
        waiting, self._waiting = self._waiting, []
        for strand in waiting:
            self._scheduler.wake(strand)


class Disk:
    """Simulated form of :class:`~teleop_core.base.background.Background` in one process.

    Args:
        process: Process that writes.
    """

    def __init__(self, process: Process) -> None:
        self._process = process

    def queue(self, size: int) -> Jobs:
        """Return a queue for at most ``size`` jobs."""
        return Jobs(self._process, size)

    def thread(self, name: str, work: Callable[[], None]) -> Strand:
        """Return a thread that runs ``work`` as soon as it is started."""
        return self._process.machine.scheduler.spawn(self._process, name, work)

    def write(self, file: BinaryIO, data: bytes | memoryview) -> int:
        """Write data up to the limit of the process; raises OSError beyond the limit or if the disk has failed."""
        scheduler = self._process.machine.scheduler
        scheduler.sleep(self._process.disk_delay + 1e-9 * _BYTE_NS * len(data))
        self._insist()
        room = self._process.room
        if room is None:
            return file.write(data)
        taken = file.write(data[: max(0, room)])
        self._process.room = room - taken
        if not taken:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return taken

    def cut(self, file: BinaryIO, size: int) -> None:
        """Truncate a file to ``size`` bytes; raise OSError if the disk has failed. A full disk still truncates."""
        if self._process.disk_error != errno.ENOSPC:
            self._insist()
        SYSTEM.cut(file, size)

    def sync(self, file: BinaryIO) -> None:
        """Do nothing, because all data is already on the disk; raises OSError if the disk has failed."""
        self._insist()

    def _insist(self) -> None:
        if number := self._process.disk_error:
            raise OSError(number, os.strerror(number))
