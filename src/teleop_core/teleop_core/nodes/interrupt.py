"""Interrupt: signals that end a live session in order, where its main thread looks for them."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from teleop_core.nodes.watch import ENDS


class Interrupt:
    """Whether Ctrl-C or another ending signal came. Work goes on until it calls :meth:`check`.

    SIGTERM, SIGQUIT, and SIGHUP of a closed terminal act like Ctrl-C. An exception raised by the handler itself could
    leave a lock of the middleware taken, and the end of the session would wait for it.

    Attributes:
        has_come: Whether one did.
    """

    def __init__(self) -> None:
        self.has_come = False

    def __call__(self, number: int, _: object) -> None:
        """Note a signal."""
        self.has_come = True
        if number == signal.SIGHUP:
            _leave_terminal()

    def ask(self) -> None:
        """Do as a signal does, from another thread."""
        self.has_come = True

    def check(self) -> None:
        """End what runs now, if a signal came.

        Raises:
            KeyboardInterrupt: It did.
        """
        if self.has_come:
            raise KeyboardInterrupt

    @contextmanager
    def caught(self) -> Iterator[None]:
        """Take the signals meanwhile; outside the main thread nothing changes.

        What is ignored stays so, such as SIGHUP under ``nohup``.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {n: signal.getsignal(n) for n in ENDS if signal.getsignal(n) != signal.SIG_IGN}
        for number in before:
            signal.signal(number, self)
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


def _leave_terminal() -> None:
    """Write to nowhere from now on: the terminal is gone, and writing to it would raise."""
    with open(os.devnull, "w") as nowhere:
        for file in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                if file.isatty():
                    os.dup2(nowhere.fileno(), file.fileno())
