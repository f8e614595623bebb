"""Connection: a browser's connection, with bounds on what it may send and what it may leave."""

from typing import Any, Protocol

import websockets.asyncio.server as ws
from websockets.typing import Data, DataLike

from teleop_console.filter import Budget

STUCK = 10.0
"""Time in which a page must have taken something of what waits for it [s]."""
OPENING = 32
"""Connections that may be opening or fetching files at once; the oldest gives way."""
ALL = 3.0
"""What all pages of a server may send together, in budgets of one."""
_PART = 4096  # bytes that are looked at before the budget is asked again


class Gate(Protocol):
    """Decides about the messages of connections."""

    def passed(self, connection: "Connection", data: Data) -> bytes:
        """Part of a message that goes on to viser; empty if none does."""

    def cut(self, connection: "Connection") -> None:
        """Take note of a connection that is cut for a flood."""

    def come(self, connection: "Connection") -> None:
        """Take note of a connection that becomes a page."""


class Crowd:
    """All connections of one server, and what all its pages may send together.

    Attributes:
        opening: Connections that are no page yet, the oldest first.
        pages: Those that are.
    """

    def __init__(self) -> None:
        self.opening: dict[Connection, None] = {}
        self.pages: set[Connection] = set()
        self._budget = Budget(ALL)

    def spend(self, frames: int, size: int) -> None:
        """Take some frames and bytes off; beyond that the page that sends most is cut."""
        if not self._budget.spend(frames, size) and self.pages:
            self._budget = Budget(ALL)
            min(self.pages, key=lambda page: page.budget.left).cut()


class Connection(ws.ServerConnection):
    """A connection that is filtered, and that ends when it floods or stands still.

    It ends when the other side takes nothing for :data:`STUCK` seconds, or sends more than its
    :class:`~teleop_console.filter.Budget`. It also ends when the other side sends most of all
    pages while these send more than the budget of the :class:`Crowd`, or has not become a page
    while :data:`OPENING` newer ones have come. Of each of viser's two queues one message can wait
    here, and the newest of each kind wait in the queues: so what a slow page costs is bounded, and
    what a dead one costs ends.

    Args:
        gate: Decides about its messages.
        crowd: Connections of the same server.
        arguments: As the library gives them.
        options: As the library gives them.

    Attributes:
        budget: What it may still send.
        silent_until: Time of the loop until which its page is told nothing more [s].
    """

    def __init__(self, *arguments: Any, gate: Gate, crowd: Crowd, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._gate, self._crowd, self.budget = gate, crowd, Budget()
        self._is_cut = False
        self.silent_until = 0.0

    def connection_made(self, transport: Any) -> None:
        """Begin; the oldest that is still opening gives way if there are too many."""
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
        """The handshake is done: it is a page now."""
        self._crowd.opening.pop(self, None)
        self._crowd.pages.add(self)
        self._gate.come(self)
        super().start_keepalive()

    def data_received(self, data: bytes) -> None:
        """Take in what has come, a part at a time, as long as the budget lasts."""
        for start in range(0, len(data), _PART):
            part = data[start : start + _PART]
            if self._is_cut or not self._spend(0, len(part)):
                return
            super().data_received(part)

    def process_event(self, event: Any) -> None:
        """Take in one frame of any kind; all of them cost time."""
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
        """End it at once, for a flood."""
        self._is_cut = True
        self._crowd.pages.discard(self)
        self._gate.cut(self)
        self.transport.abort()


class _Watch:
    """Looks whether what waits in a connection becomes less."""

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
