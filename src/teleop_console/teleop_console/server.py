"""ConsoleServer: serves the page to browsers of this machine, and knows which page drives.

If the port is taken, an error names the process that uses it; the port is never changed silently.
"""

import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from teleop_console.answers import Answers
from teleop_console.drivers import PATIENCE, Drivers
from teleop_console.guard import Guard, is_wildcard
from teleop_console.hooks import Server
from teleop_console.start import Form
from teleop_core.base.errors import ParameterError, SessionError

_LISTENS = "0A"  # state in /proc/net/tcp
_SHOWN = 80


def listen(host: str, port: int) -> socket.socket:
    """Open a listening socket.

    Args:
        host: Address of this machine.
        port: Number of the port; 0 for any free port.

    Returns:
        The bound and listening socket.

    Raises:
        ParameterError: The port is not a port number, or the address does not belong to this machine.
        SessionError: The port is in use. The message names the process that uses it, and a free port.
    """
    if not 0 <= port < 1 << 16:
        raise ParameterError("port", port, "0 to 65535, 0 for any free one")
    try:
        found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
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
    """Error for an address on which the socket cannot listen."""
    import errno

    if error.errno == errno.EADDRINUSE:
        free = free_port(host)
        return SessionError(f"port {port} is taken by {owner(port)}; {free} is free: --port {free}")
    if error.errno == errno.EACCES:
        return SessionError(f"you may not use port {port}; choose one above 1023")
    return ParameterError("host", host, f"an address of this machine ({error.strerror})")


def free_port(host: str = "127.0.0.1") -> int:
    """Number of a port that is free now."""
    with listen(host, 0) as opened:
        return int(opened.getsockname()[1])


def owner(port: int) -> str:
    """Text that names the process that listens on a port; ``another process`` if it is unknown."""
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


def own_address() -> str:
    """Address of this machine in its network; the loopback address without a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        try:
            asked.connect(("192.0.2.1", 9))  # documentation address; a datagram socket sends nothing to connect
        except OSError:
            return "127.0.0.1"
        return str(asked.getsockname()[0])


PORT = 8080
"""Default port of the page."""
_LOOK = 0.5  # time between two checks of the driving page [s]
_FORGET = 20  # number of checks between two removals of closed pages


class ConsoleServer:
    """Server of the page; it runs from its construction to :meth:`close`.

    Requests of pages of other origins, or without the token, are answered by status 403. A
    :class:`~teleop_console.filter.Filter` checks the messages of pages.

    Attributes:
        viser: The server to which scene and panel are added.
        drivers: Object that knows which page drives.
        answers: Object with the data for pages in addition to viser's elements; it also receives the pages' stops.
        token: Secret that the address must contain.

    Args:
        port: Number of the port; 0 for any free port.
        host: Address of this machine that the server uses; the loopback address by default.
        token: Secret of letters, digits and . _ ~ -; a new one if it is empty.
        label: Heading of the panel.
        form: Function that makes, from the drivers, the form that is shown while no session runs. None for the form
            that chooses a session.
        patience: Time without a sign of life after which a page loses a held stylus [s].

    Raises:
        SessionError: The port is in use. The message names the process that uses it, and a free port.
        ParameterError: The address does not belong to this machine, or the token has other characters.
    """

    def __init__(
        self,
        port: int = PORT,
        host: str = "127.0.0.1",
        token: str = "",
        *,
        label: str = "",
        form: Callable[[Drivers], Form] | None = None,
        patience: float = PATIENCE,
    ) -> None:
        self.token = token or secrets.token_urlsafe(24)
        opened = listen(host, port)
        self.port = int(opened.getsockname()[1])
        self.host = host
        self.drivers = Drivers(patience)
        self.answers = Answers(self.drivers, form and form(self.drivers))
        guard = Guard(self.port, self.token)
        self.viser = Server(opened, guard, self.drivers, self.answers, label)
        self._ends = threading.Event()
        self._watch = threading.Thread(target=self._look, name="console pages", daemon=True)
        self._watch.start()

    @property
    def url(self) -> str:
        """Address with which people at this machine open the page; it includes the token."""
        return self._url("localhost" if is_wildcard(self.host) else self.host)

    @property
    def url_elsewhere(self) -> str:
        """Address with which people at other machines open the page; it includes the token."""
        return self._url(own_address() if is_wildcard(self.host) else self.host)

    def _url(self, host: str) -> str:
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/?token={self.token}"

    def close(self) -> None:
        """Stop the server; open pages show that the connection is lost."""
        self._ends.set()
        self._watch.join()
        self.viser.stop()

    def __enter__(self) -> "ConsoleServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _look(self) -> None:
        looks = 0
        while not self._ends.wait(_LOOK):
            self.drivers.expire()
            looks += 1
            if looks % _FORGET == 0:
                self.viser.forget()
