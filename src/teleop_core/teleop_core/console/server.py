"""ConsoleServer: serves the page to browsers of this machine, and knows which page drives."""

import secrets
import threading

from teleop_core.console.answers import Answers
from teleop_core.console.drivers import PATIENCE, Drivers
from teleop_core.console.guard import Guard, is_loopback, is_wildcard
from teleop_core.console.hooks import Server
from teleop_core.console.port import listen

PORT = 8080
"""Where the page is if nothing else is asked."""
_LOOK = 0.5  # s, between looks at the driver
_FORGET = 20  # looks between clearing up


class ConsoleServer:
    """Server of the page, running from its making to :meth:`close`.

    Without a token it serves this machine alone; other addresses always have one. Pages of other
    origins, names that were made to lead here, and requests without the token get 403. Messages of
    pages go through a :class:`~teleop_core.console.filter.Filter`.

    Attributes:
        viser: The server to which scene and panel are added.
        drivers: Which page drives.
        answers: What pages are told beside viser's elements, and where their stop goes.
        token: Secret that the address must carry; empty for none.

    Args:
        port: Port; 0 for any free one.
        host: Address of this machine to serve at; the loopback by default.
        token: Secret; made if the address is not the loopback and none is given.
        label: Heading of the panel.
        patience: Time without a sign of life after which a page loses a held stylus [s].

    Raises:
        SessionError: The port is taken; the text says by what, and names a free one.
        ParameterError: The address is none of this machine.
    """

    def __init__(
        self,
        port: int = PORT,
        host: str = "127.0.0.1",
        token: str = "",
        *,
        label: str = "",
        patience: float = PATIENCE,
    ) -> None:
        opened = listen(host, port)
        self.port = int(opened.getsockname()[1])
        self.host = host
        self.token = token or ("" if is_loopback(host) else secrets.token_urlsafe(24))
        self.drivers = Drivers(patience)
        self.answers = Answers(self.drivers)
        guard = Guard(host, self.port, self.token)
        self.viser = Server(opened, guard, self.drivers, self.answers, label)
        self._ends = threading.Event()
        self._watch = threading.Thread(target=self._look, name="console pages", daemon=True)
        self._watch.start()

    @property
    def url(self) -> str:
        """Address of the page, token included, as people of this machine open it."""
        host = "localhost" if is_wildcard(self.host) else self.host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/" + (f"?token={self.token}" if self.token else "")

    def close(self) -> None:
        """End the server; pages that are open show that they have lost it."""
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
