"""Interrupt: signals that end a live session in order; its main thread checks for them."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from teleop_core.nodes.watch import ENDS


class Interrupt:
    """Notes Ctrl-C and other ending signals. The running code continues until it calls :meth:`check`.

    SIGTERM, SIGQUIT, and SIGHUP of a closed terminal act like Ctrl-C. The handler itself raises no exception: an
    exception could leave a lock of the middleware locked, and the end of the session would wait for this lock.

    Attributes:
        has_come: Whether such a signal came.
    """

    def __init__(self) -> None:
        self.has_come = False

    def __call__(self, number: int, _: object) -> None:
        """Note a signal."""
        self.has_come = True
        if number == signal.SIGHUP:
            _leave_terminal()

    def ask(self) -> None:
        """Request the end like a signal, from another thread."""
        self.has_come = True

    def check(self) -> None:
        """End the running code if a signal came.

        Raises:
            KeyboardInterrupt: A signal came.
        """
        if self.has_come:
            raise KeyboardInterrupt

    @contextmanager
    def caught(self) -> Iterator[None]:
        """Handle the signals within this context; outside the main thread nothing changes.

        Ignored signals stay ignored, such as SIGHUP under ``nohup``.
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
    """Discard all further output: the terminal is closed, and writing to it would raise an exception."""
    with open(os.devnull, "w") as nowhere:
        for file in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                if file.isatty():
                    os.dup2(nowhere.fileno(), file.fileno())
