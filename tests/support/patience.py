"""Patience: waiting for a state, never for a time."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


def wait_until(condition: Callable[[], Any], what: str, timeout: float, pause: float = 0.01) -> Any:
    """Result of ``condition`` as soon as it is true; what takes longer [s] never comes."""
    end = time.monotonic() + timeout
    while not (result := condition()):
        assert time.monotonic() < end, f"not within {timeout:g} s: {what}"
        time.sleep(pause)
    return result


def is_alive(pid: int) -> bool:
    """Whether a process is there, and not only its exit code."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
