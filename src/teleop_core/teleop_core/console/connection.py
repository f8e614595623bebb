"""Connection: a browser's connection, with bounds on what it may send and what it may leave."""

from typing import Any, Protocol

import websockets.asyncio.server as ws
from websockets.typing import Data, DataLike

from teleop_core.console.filter import Budget

STUCK = 10.0
"""Time in which a page must have taken something of what waits for it [s]."""
OPENING = 32
"""Connections that may be opening or fetching files at once; the oldest gives way."""
_PART = 4096  # bytes that are looked at before the budget is asked again


class Gate(Protocol):
    """Decides about the messages of connections."""

    def passed(self, connection: "Connection", data: Data) -> bytes:
        """What of a message goes on to viser; empty if nothing does."""

    def cut(self, connection: "Connection") -> None:
        """Take note of a connection that is cut for a flood."""

    def come(self, connection: "Connection") -> None:
        """Take note of a connection that becomes a page."""


class Connection(ws.ServerConnection):
    """A connection that is filtered, and that ends when it floods or stands still.

    It ends when the other side takes nothing for :data:`STUCK` seconds, sends more than its
    :class:`~teleop_core.console.filter.Budget`, or has not become a page while :data:`OPENING`
    newer ones have come. Of each of viser's two queues one message can wait here, and the newest of
    each kind wait in the queues: so what a slow page costs is bounded, and what a dead one costs
    ends.

    Args:
        gate: Decides about its messages.
        opening: Connections of the same server that are no page yet, the oldest first.
        arguments: As the library gives them.
        options: As the library gives them.

    Attributes:
        silent_until: Time of the loop until which its page is told nothing more [s].
    """

    def __init__(
        self, *arguments: Any, gate: Gate, opening: dict["Connection", None], **options: Any
    ) -> None:
        super().__init__(*arguments, **options)
        self._gate, self._opening, self._budget = gate, opening, Budget()
        self._is_cut = False
        self.silent_until = 0.0

    def connection_made(self, transport: Any) -> None:
        """Begin; the oldest that is still opening gives way if there are too many."""
        super().connection_made(transport)
        self._opening[self] = None
        if len(self._opening) > OPENING:
            oldest = next(iter(self._opening))
            del self._opening[oldest]
            oldest.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._opening.pop(self, None)
        super().connection_lost(exc)

    def start_keepalive(self) -> None:
        """The handshake is done: it is a page now."""
        self._opening.pop(self, None)
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
        if not self._is_cut and not self._budget.spend(frames, size):
            self._is_cut = True
            self._gate.cut(self)
            self.transport.abort()
        return not self._is_cut


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
