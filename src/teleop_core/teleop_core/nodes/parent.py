"""Parent: the connection between a node's process and the live session that started it.

Both ends are sockets of one pair. The system closes an end when its process has ended for any reason, so a node
detects the end of its parent at once. In the other direction, a separate thread of the node reports ten times a second
what the process is doing. A process that is starting or compiling thus still reports; a stopped process does not. A
process that was started by hand has no such connection.
"""

import os
import socket

VARIABLE = "TELEOP_PARENT"
"""Environment variable with the number of the file through which a process is watched."""


class Parent:
    """A process's own end of the connection.

    Args:
        line: Socket to the parent.
    """

    def __init__(self, line: socket.socket) -> None:
        line.setblocking(False)
        self._line = line

    @classmethod
    def of_environment(cls) -> "Parent | None":
        """Connection that the parent opened for this process; None if the process was started by hand.

        Only this process uses the connection; its own children do not inherit it.
        """
        number = os.environ.pop(VARIABLE, "")
        if not number.isdecimal():
            return None
        os.set_inheritable(int(number), False)
        return cls(socket.socket(fileno=int(number)))

    def fileno(self) -> int:
        """File descriptor of the connection, for ``select``."""
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
        """Close the connection."""
        self._line.close()

    def tell(self, word: str) -> None:
        """Report what this process is doing; the report is lost if the parent itself is stopped."""
        try:
            self._line.send(f"{word}\n".encode())
        except OSError:
            return
