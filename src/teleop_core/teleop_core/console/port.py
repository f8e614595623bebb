"""Port: where the page is served; a taken one is told with who has it, never changed silently."""

import socket
from contextlib import suppress
from pathlib import Path

from teleop_core.errors import ParameterError, SessionError

_LISTENS = "0A"  # state in /proc/net/tcp
_SHOWN = 80


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens.

    Args:
        host: Address of this machine.
        port: Port; 0 for any free one.

    Returns:
        The socket, bound and listening.

    Raises:
        ParameterError: The port is none, or the address not one of this machine.
        SessionError: The port is taken; the text says by what, and names a free one.
    """
    if not 0 <= port < 1 << 16:
        raise ParameterError("port", port, "0 to 65535, 0 for any free one")
    try:
        found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM,
                                   flags=socket.AI_PASSIVE)[0]  # fmt: skip
    except OSError as error:
        raise ParameterError("host", host, f"an address of this machine ({error})") from error
    opened = socket.socket(found[0], found[1])
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind(found[4])
        opened.listen(64)
    except OSError as error:
        opened.close()
        raise _refusal(host, port, error) from error
    opened.setblocking(False)
    return opened


def _refusal(host: str, port: int, error: OSError) -> Exception:
    """What to say when an address cannot be listened at."""
    import errno

    if error.errno == errno.EADDRINUSE:
        free = free_port(host)
        return SessionError(f"port {port} is taken by {owner(port)}; {free} is free: --port {free}")
    if error.errno == errno.EACCES:
        return SessionError(f"port {port} is not allowed to you, take one above 1023")
    return ParameterError("host", host, f"an address of this machine ({error.strerror})")


def free_port(host: str = "127.0.0.1") -> int:
    """A port that is free now."""
    with listen(host, 0) as opened:
        return int(opened.getsockname()[1])


def owner(port: int) -> str:
    """Which process listens at a port, in words; ``another process`` where it cannot be known."""
    wanted = {f"socket:[{inode}]" for inode in _inodes(port)}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if any(str(link.readlink()) in wanted for link in (folder / "fd").iterdir()):
                return f"{_command(folder)} (process {folder.name})"
    return "another process"


def _inodes(port: int) -> set[str]:
    """Numbers of the sockets that listen at a port."""
    found = set()
    for table in ("tcp", "tcp6"):
        with suppress(OSError):
            for line in Path("/proc/net", table).read_text().splitlines()[1:]:
                column = line.split()
                if column[3] == _LISTENS and int(column[1].rpartition(":")[2], 16) == port:
                    found.add(column[9])
    return found


def _command(folder: Path) -> str:
    words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
    return repr(" ".join(words).strip()[:_SHOWN] or "a process")
