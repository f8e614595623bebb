"""Connection: a browser's connection, with limits for the data that it sends and the data that it does not read."""

from typing import Any, Protocol

import websockets.asyncio.server as ws
from websockets.typing import Data, DataLike

from teleop_console.filter import Budget

STUCK = 10.0
"""Longest time for which a page may read none of its waiting data [s]."""
OPENING = 32
"""Largest number of connections that open or fetch files at the same time; if there are more, the oldest is closed."""
ALL = 3.0
"""Common budget of all pages of a server, as a multiple of the budget of one page."""
_PART = 4096  # bytes that are read between two checks of the budget


class Gate(Protocol):
    """Decides which messages of connections are passed on."""

    def passed(self, connection: "Connection", data: Data) -> bytes:
        """Part of a message that is passed on to viser; empty if nothing is passed on."""

    def cut(self, connection: "Connection") -> None:
        """Record that a connection was closed because it sent too much."""

    def come(self, connection: "Connection") -> None:
        """Record that a connection now belongs to an open page."""


class Crowd:
    """All connections of one server, and the common budget of its pages.

    Attributes:
        opening: Connections that do not belong to an open page yet, the oldest first.
        pages: Connections of open pages.
    """

    def __init__(self) -> None:
        self.opening: dict[Connection, None] = {}
        self.pages: set[Connection] = set()
        self._budget = Budget(ALL)

    def spend(self, frames: int, size: int) -> None:
        """Subtract frames and bytes from the common budget; if it is exceeded, the page that sends most is closed."""
        if not self._budget.spend(frames, size) and self.pages:
            self._budget = Budget(ALL)
            min(self.pages, key=lambda page: page.budget.left).cut()


class Connection(ws.ServerConnection):
    """A connection whose messages are filtered; it is closed if the browser sends too much or stops reading.

    The connection is closed in four cases: the browser reads nothing for :data:`STUCK` seconds; the browser exceeds its
    :class:`~teleop_console.filter.Budget`; all pages together exceed the budget of the :class:`Crowd` and this page
    sends most; or :data:`OPENING` newer connections have come before this connection has become a page. At most one
    message of each of viser's two queues waits in the connection, and the newest messages of each kind wait in the
    queues. So the memory of a slow page is bounded, and the memory of a dead page is released.

    Args:
        gate: Object that decides about the messages.
        crowd: Connections of the same server.
        arguments: Arguments from the websockets library.
        options: Options from the websockets library.

    Attributes:
        budget: Frames and bytes that the browser may still send.
        silent_until: Loop time [s] until which nothing is sent to the page.
    """

    def __init__(self, *arguments: Any, gate: Gate, crowd: Crowd, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._gate, self._crowd, self.budget = gate, crowd, Budget()
        self._is_cut = False
        self.silent_until = 0.0

    def connection_made(self, transport: Any) -> None:
        """Begin the connection; if too many connections are being opened, close the oldest of them."""
        super().connection_made(transport)
        opening = self._crowd.opening
        opening[self] = None
        if len(opening) > OPENING:
            oldest = next(iter(opening))
            del opening[oldest]
            oldest.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._crowd.opening.pop(self, None)
        self._crowd.pages.discard(self)
        super().connection_lost(exc)

    def start_keepalive(self) -> None:
        """Register the connection as a page, because the handshake is complete."""
        self._crowd.opening.pop(self, None)
        self._crowd.pages.add(self)
        self._gate.come(self)
        super().start_keepalive()

    def data_received(self, data: bytes) -> None:
        """Process received data in parts, as long as the budget lasts."""
        for start in range(0, len(data), _PART):
            part = data[start : start + _PART]
            if self._is_cut or not self._spend(0, len(part)):
                return
            super().data_received(part)

    def process_event(self, event: Any) -> None:
        """Process one frame and subtract it from the budget; frames of all kinds count, because each takes time."""
        if self._spend(1, 0):
            super().process_event(event)

    async def recv(self, decode: bool | None = None) -> Data:  # type: ignore[override]
        """Next message that may go on to viser."""
        while True:
            data = await super().recv(decode)
            if passed := self._gate.passed(self, data):
                return passed

    async def send(self, message: DataLike, text: bool | None = None) -> None:  # type: ignore[override]
        """Send, and wait until the other side has taken most of it."""
        watch = _Watch(self)
        try:
            await super().send(message, text)
        finally:
            watch.end()

    def _spend(self, frames: int, size: int) -> bool:
        if not self._is_cut and not self.budget.spend(frames, size):
            self.cut()
        if not self._is_cut:
            self._crowd.spend(frames, size)
        return not self._is_cut

    def cut(self) -> None:
        """Close the connection immediately, because the browser sends too much."""
        self._is_cut = True
        self._crowd.pages.discard(self)
        self._gate.cut(self)
        self.transport.abort()


class _Watch:
    """Checks whether the unread data of a connection decreases."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._waited = connection, float("inf")
        self._again()

    def end(self) -> None:
        self._timer.cancel()

    def _again(self) -> None:
        self._timer = self._connection.loop.call_later(STUCK, self._look)

    def _look(self) -> None:
        waits = self._connection.transport.get_write_buffer_size()
        if waits >= self._waited:
            self._connection.transport.abort()
            return
        self._waited = waits
        self._again()
