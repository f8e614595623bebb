"""Background: the thread that writes a recording, the queue of this thread, and the disk."""

import os
import queue
import threading
from collections.abc import Callable
from typing import Any, BinaryIO, Protocol


class Jobs(Protocol):
    """Queue between two threads."""

    def put(self, job: Any) -> None:
        """Append a job; wait while the queue is full."""

    def get(self) -> Any:
        """Remove and return the oldest job; wait while the queue is empty."""

    def empty(self) -> bool:
        """Whether no job waits in the queue."""


class Worker(Protocol):
    """Thread that writes."""

    def start(self) -> None:
        """Start the thread."""

    def join(self) -> None:
        """Wait until the thread has ended."""


class Background(Protocol):
    """Operating-system functions that a writer of recordings uses."""

    def queue(self, size: int) -> Jobs:
        """Queue of at most ``size`` jobs."""

    def thread(self, name: str, work: Callable[[], None]) -> Worker:
        """Thread that calls ``work`` when it is started."""

    def write(self, file: BinaryIO, data: bytes | memoryview) -> int:
        """Write to an unbuffered file; return the number of bytes written.

        Raises:
            OSError: Nothing more can be written to the disk.
        """

    def cut(self, file: BinaryIO, size: int) -> None:
        """Truncate a file to ``size`` bytes; later writes go to its new end.

        Raises:
            OSError: The file cannot be truncated.
        """

    def sync(self, file: BinaryIO) -> None:
        """Wait until all written data are on the disk.

        Raises:
            OSError: The data cannot be written to the disk.
        """


class System:
    """Threads and files of the operating system."""

    def queue(self, size: int) -> Jobs:
        """Queue of at most ``size`` jobs."""
        return queue.Queue(maxsize=size)

    def thread(self, name: str, work: Callable[[], None]) -> Worker:
        """Thread that calls ``work`` when it is started."""
        return threading.Thread(target=work, name=name, daemon=True)

    def write(self, file: BinaryIO, data: bytes | memoryview) -> int:
        """Write to an unbuffered file; return the number of bytes written."""
        return file.write(data)

    def cut(self, file: BinaryIO, size: int) -> None:
        """Truncate a file to ``size`` bytes; later writes go to its new end."""
        file.seek(size)
        file.truncate()

    def sync(self, file: BinaryIO) -> None:
        """Wait until all written data are on the disk."""
        os.fdatasync(file.fileno())


SYSTEM = System()
"""Background that is used if the caller passes none."""
