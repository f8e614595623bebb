"""Patience: waiting for a state, never for a time."""

import time
from collections.abc import Callable
from typing import Any


def wait_until(condition: Callable[[], Any], what: str, timeout: float, pause: float = 0.01) -> Any:
    """Result of ``condition`` as soon as it is true; what takes longer [s] never comes."""
    end = time.monotonic() + timeout
    while not (result := condition()):
        assert time.monotonic() < end, f"not within {timeout:g} s: {what}"
        time.sleep(pause)
    return result
