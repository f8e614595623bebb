"""Background: the thread that writes a recording, its queue, and the disk below it."""

import os
import queue
import threading
from collections.abc import Callable
from typing import Any, BinaryIO, Protocol


class Jobs(Protocol):
    """Queue between two threads."""

    def put(self, job: Any) -> None:
        """Append, as soon as there is room."""

    def get(self) -> Any:
        """Take the oldest, as soon as there is one."""

    def empty(self) -> bool:
        """Whether nothing waits."""


class Worker(Protocol):
    """Thread that writes."""

    def start(self) -> None:
        """Begin."""

    def join(self) -> None:
        """Wait for its end."""


class Background(Protocol):
    """What a writer asks of the system."""

    def queue(self, size: int) -> Jobs:
        """Queue of so many jobs."""

    def thread(self, name: str, work: Callable[[], None]) -> Worker:
        """Thread that does something, once it is started."""

    def write(self, file: BinaryIO, data: bytes | memoryview) -> int:
        """Write to a file without a buffer; how much was taken.

        Raises:
            OSError: The disk takes no more.
        """

    def cut(self, file: BinaryIO, size: int) -> None:
        """Let a file end after so many bytes, and go on to write there.

        Raises:
            OSError: The disk does not.
        """

    def sync(self, file: BinaryIO) -> None:
        """Wait until what was written is on the disk.

        Raises:
            OSError: The disk refuses it.
        """


class System:
    """Threads and files as they are."""

    def queue(self, size: int) -> Jobs:
        """Queue of so many jobs."""
        return queue.Queue(maxsize=size)

    def thread(self, name: str, work: Callable[[], None]) -> Worker:
        """Thread that does something, once it is started."""
        return threading.Thread(target=work, name=name, daemon=True)

    def write(self, file: BinaryIO, data: bytes | memoryview) -> int:
        """Write to a file without a buffer; how much was taken."""
        return file.write(data)

    def cut(self, file: BinaryIO, size: int) -> None:
        """Let a file end after so many bytes, and go on to write there."""
        file.seek(size)
        file.truncate()

    def sync(self, file: BinaryIO) -> None:
        """Wait until what was written is on the disk."""
        os.fdatasync(file.fileno())


SYSTEM = System()
"""The background of all who name none."""
