"""Parent: the line between a node's process and the live session that started it.

Both ends are sockets of one pair. The system closes an end when its process is gone, however it
went: so a node knows at once that nobody watches it any more. The other way it says ten times a
second, from a thread of its own, what it is doing: a process that is busy starting, even compiling,
is heard, and one that stands still is not. Started by hand, a process has no such line.
"""

import os
import socket

VARIABLE = "TELEOP_PARENT"
"""Environment variable with the number of the file through which a process is watched."""


class Parent:
    """A process's own end of the line.

    Args:
        line: Socket to the parent.
    """

    def __init__(self, line: socket.socket) -> None:
        line.setblocking(False)
        self._line = line

    @classmethod
    def of_environment(cls) -> "Parent | None":
        """Line that the parent left open for this process; None if it was started by hand.

        It is for this process alone: what it starts itself does not get it.
        """
        number = os.environ.pop(VARIABLE, "")
        if not number.isdecimal():
            return None
        os.set_inheritable(int(number), False)
        return cls(socket.socket(fileno=int(number)))

    def fileno(self) -> int:
        """Number of the file, to wait for."""
        return self._line.fileno()

    def has_gone(self) -> bool:
        """Whether the parent's process has ended."""
        try:
            return self._line.recv(64) == b""
        except BlockingIOError:
            return False
        except OSError:
            return True

    def close(self) -> None:
        """Let go of the line."""
        self._line.close()

    def tell(self, word: str) -> None:
        """Say what this process is doing; lost if the parent stands still itself."""
        try:
            self._line.send(f"{word}\n".encode())
        except OSError:
            return
