"""Patience: how long a test waits for a state, in time for which the machine had a processor.

What must come in a second comes later on a busy machine, and nobody knows how much later. So the
time for which somebody waited for a processor counts less: a quarter of it, so that a test whose
state never comes ends all the same.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

BUSY_SHARE = 0.25
"""Part of the time without a free processor that counts."""
_ACCOUNT = Path("/proc/pressure/cpu")


def stalled() -> float:
    """Time since the start of the machine for which somebody waited for a processor [s].

    0 where the system keeps no account: the clock alone counts there.
    """
    try:
        line = _ACCOUNT.read_text(encoding="ascii").partition("\n")[0]
        return 1e-6 * int(line.rpartition("=")[2])
    except (OSError, ValueError):
        return 0.0


class Patience:
    """Time that is left to wait, from making on.

    Args:
        seconds: As long as it lasts on an idle machine.
        clock, busy: Where time and time without a processor are read [s].
    """

    def __init__(
        self, seconds: float, clock: Callable[[], float] = time.monotonic,
        busy: Callable[[], float] = stalled,
    ) -> None:  # fmt: skip
        self._seconds, self._clock, self._busy = seconds, clock, busy
        self._begin, self._busy_begin = clock(), busy()

    def is_over(self) -> bool:
        """Whether nothing is left."""
        elapsed = self._clock() - self._begin
        if elapsed < self._seconds:
            return False
        busy = min(self._busy() - self._busy_begin, elapsed)
        return elapsed - (1.0 - BUSY_SHARE) * busy >= self._seconds


def wait_until(condition: Callable[[], Any], what: str, timeout: float, pause: float = 0.01) -> Any:
    """Result of ``condition`` as soon as it is true."""
    patience = Patience(timeout)
    while not (result := condition()):
        assert not patience.is_over(), f"not within {timeout} s, more of a busy machine: {what}"
        time.sleep(pause)
    return result
