"""Keys: the terminal of a live session as a stop button, without waiting for Enter."""

import select
import sys
import termios
import threading
import tty
from collections import deque
from collections.abc import Callable

STOP = " "
"""Key that stops all arms."""
_PERIOD = 0.2  # period of checking whether the session has ended [s]


class Keys:
    """Reader of key presses in a separate thread; without a terminal it reads nothing.

    A context manager for ``with``.

    Args:
        stop: Called at once, in that thread, when :data:`STOP` is pressed.

    Attributes:
        is_there: Whether there is a terminal from which keys can be read.
        waiting: Other keys that were pressed, oldest first.
    """

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop, self._is_open = stop, True
        self.is_there = sys.stdin.isatty() and sys.stdout.isatty()
        self.waiting: deque[str] = deque()
        self._thread = threading.Thread(target=self._read, name="keys", daemon=True)

    def __enter__(self) -> "Keys":
        if self.is_there:
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_open = False
        if self.is_there:
            self._thread.join()
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def _read(self) -> None:
        while self._is_open:
            if not select.select([sys.stdin], [], [], _PERIOD)[0]:
                continue
            key = sys.stdin.read(1)
            if not key:  # the terminal is gone
                return
            if key == STOP:
                self._stop()
            else:
                self.waiting.append(key)
