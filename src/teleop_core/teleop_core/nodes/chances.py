"""Chances: the time for which a process could have worked, from the kernel's accounting of its threads.

On a busy machine a healthy thread may get no processor for a second. Judged by the clock alone, the thread would seem
to hang. Therefore the time for which a thread waited for a processor does not count here.
"""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

_LONGEST = 0.2
"""Largest time between two calls of :meth:`Chances.look` that counts [s]. If more time has passed, the caller itself
had no processor, or was stopped together with the process."""


@dataclass(frozen=True)
class _Account:
    """Time for which a thread ran, time for which it waited for a processor [s], and whether it is ready to run."""

    ran: float
    waited: float
    is_ready: bool


class Chances:
    """Measures the time that a process had for its work between two calls of :meth:`look`.

    Args:
        pid: The process.
        worker: Thread that does the work. The time for which it ran always counts, since it may be in an endless loop.
            0: no particular thread.
    """

    def __init__(self, pid: int, worker: int = 0) -> None:
        self._folder, self._worker = Path(f"/proc/{pid}/task"), worker
        self._last = time.monotonic()
        self._accounts: dict[int, _Account] = {}

    def look(self, threads: Iterable[int] | None = None) -> float:
        """Time since the last call in which no thread waited for a processor [s].

        Args:
            threads: Threads to consider; None for all threads of the process.
        """
        now = time.monotonic()
        elapsed, self._last = min(now - self._last, _LONGEST), now
        before, self._accounts = self._accounts, self._read(threads)
        waited = ran = 0.0
        for thread, account in self._accounts.items():
            if thread not in before:
                continue
            got = account.ran - before[thread].ran
            waits = account.is_ready and got <= 0.0  # the kernel updates an account when its thread runs again
            waited = max(waited, elapsed if waits else account.waited - before[thread].waited)
            ran = got if thread == self._worker else ran
        return max(elapsed - waited, ran, 0.0)

    def _read(self, threads: Iterable[int] | None) -> dict[int, _Account]:
        names = self._threads() if threads is None else threads
        return {thread: one for thread in names if (one := self._account(thread)) is not None}

    def _threads(self) -> list[int]:
        """Numbers of all threads of the process; empty after the process has ended."""
        try:
            return [int(path.name) for path in self._folder.iterdir()]
        except OSError:
            return []

    def _account(self, thread: int) -> _Account | None:
        """Account of one thread; None if the thread has ended, or the system has no account."""
        folder = self._folder / str(thread)
        try:
            ran, waited, _ = map(int, (folder / "schedstat").read_text().split())
            # The name, in parentheses, may contain any characters.
            state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
        except (OSError, ValueError):
            return None
        return _Account(1e-9 * ran, 1e-9 * waited, state == "R")
