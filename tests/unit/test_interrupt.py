"""Interrupt: a signal ends a session where it looks, and breaks nothing off."""

import os
import signal
import threading

import pytest

from teleop_core.nodes.interrupt import Interrupt


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGQUIT])
def test_a_signal_leaves_no_lock_taken_and_is_found_by_who_looks(number: int) -> None:
    interrupt, condition = Interrupt(), threading.Condition()
    before = signal.signal(number, signal.SIG_DFL)  # in a shell's background it may be ignored
    try:
        break_into(interrupt, condition, number)
    finally:
        signal.signal(number, before)


def break_into(interrupt: Interrupt, condition: threading.Condition, number: int) -> None:
    """Send a signal often into code that takes a lock."""
    with interrupt.caught():
        try:
            for _ in range(2000):
                with condition:  # its __enter__ is Python, in which a signal may come
                    os.kill(os.getpid(), number)
        except KeyboardInterrupt:
            pytest.fail("the signal broke off what was running")
        with pytest.raises(KeyboardInterrupt):
            interrupt.check()
    assert condition.acquire(timeout=1.0)


def test_handlers_are_what_they_were_afterwards() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with Interrupt().caught():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before
