"""Front: accepts the connections of the page's server, and answers the emergency stop without the event loop.

One event loop processes the messages of all pages, so a stop would wait for all of them. Therefore a separate thread
accepts the connections. It answers requests for the stop and signs of life immediately. Another thread answers slow
requests, one after the other. All other connections are passed on to the event loop unread.
"""

import logging
import queue
import re
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any
from urllib.parse import urlsplit

from websockets.exceptions import SecurityError
from websockets.http11 import Request as Head
from websockets.http11 import Response
from websockets.streams import StreamReader

WAITING = 64
"""Largest number of connections without a complete request; if there are more, the oldest is closed."""
PATIENCE = 10.0
"""Time in which a connection must send its request [s]."""
STOPPER = "console front"
"""Name of the thread that answers the stop."""
_LARGEST = 16 * 1024  # largest number of bytes of a request's head
_LOOK = 0.5  # time between two checks of connections that have sent nothing [s]
_SOON = 0.02  # time between two checks of an incomplete request [s]
_BACKLOG = 64
_LINE = 32  # largest number of slow requests that wait; a further request is not answered
_LENGTH = re.compile(rb"\r\nContent-Length: *([0-9]{1,9})(?=\r\n|$)", re.IGNORECASE)
_MALFORMED = (EOFError, SecurityError, ValueError, NotImplementedError)

Body = Callable[[int], bytes]
"""Function that reads the body of a request; it raises ValueError if the body has more bytes than the argument."""
Answer = Callable[[Head, Body], Response]


class Front:
    """Listening socket whose connections are first examined by a thread.

    Args:
        opened: Listening socket; it is closed at the end.
        paths: Paths of requests that this object answers.
        answer: Function that answers one of these requests; called in a thread of this object.
        slow: Paths whose answers may take long; they do not delay other answers.

    Attributes:
        passed_on: Socket for an event loop, which accepts from it the connections that are passed on.
    """

    def __init__(
        self, opened: socket.socket, paths: frozenset[str], answer: Answer, slow: frozenset[str] = frozenset()
    ) -> None:
        self._opened, self._paths, self._answer, self._slow = opened, paths, answer, slow
        self._line: queue.Queue[tuple[socket.socket, bytes] | None] = queue.Queue(_LINE)
        threading.Thread(target=self._work, name="console start", daemon=True).start()
        self._waiting: dict[socket.socket, float] = {}  # time limit of each connection without a complete request
        self._partial: set[socket.socket] = set()  # those connections that have begun to send a request
        inner, self._told = socket.socketpair()
        self.passed_on = PassedOn(inner, opened.getsockname())
        self._told.setblocking(False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(opened, selectors.EVENT_READ)
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name=STOPPER, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop accepting connections."""
        self._is_closed = True
        self._thread.join()
        with suppress(queue.Full):  # if the queue is full, the thread need not be woken
            self._line.put_nowait(None)
        for one in (self._opened, self._told, *self._waiting):
            one.close()
        self._selector.close()

    def _run(self) -> None:
        while not self._is_closed:
            partial = tuple(self._partial)
            for key, _ in self._selector.select(_SOON if partial else _LOOK):
                if key.fileobj is self._opened:
                    self._accept()
                else:
                    self._look(key.fileobj)
            for one in partial:
                if one in self._partial:  # the connection may have been closed for a newer one
                    self._look(one)
            now = time.monotonic()
            for one in [one for one, until in self._waiting.items() if until < now]:
                self._drop(one)

    def _accept(self) -> None:
        try:
            one, _ = self._opened.accept()
        except OSError:  # the client has closed the connection, or this process has too many open files
            time.sleep(_SOON)
            return
        one.setblocking(False)
        if len(self._waiting) >= WAITING:
            self._drop(next(iter(self._waiting)))
        self._waiting[one] = time.monotonic() + PATIENCE
        self._selector.register(one, selectors.EVENT_READ)

    def _look(self, one: Any) -> None:
        """Examine the received part of a request, without consuming it."""
        try:
            data = one.recv(_LARGEST, socket.MSG_PEEK)
        except OSError:
            data = b""
        line, is_line, _ = data.partition(b"\r\n")
        is_ours = bool(is_line) and _path(line) in self._paths
        is_whole = b"\r\n\r\n" in data if is_ours else bool(is_line)
        if not data:
            self._drop(one)
        elif not is_whole and len(data) < _LARGEST:
            if one not in self._partial:  # otherwise the socket would always be readable
                self._selector.unregister(one)
                self._partial.add(one)
        elif is_ours:
            self._forget(one)
            (self._later if _path(line) in self._slow else self._reply)(one, data)
        else:
            self._forget(one)
            self._pass_on(one)

    def _later(self, one: socket.socket, data: bytes) -> None:
        try:
            self._line.put_nowait((one, data))
        except queue.Full:
            one.close()

    def _work(self) -> None:
        while (waiting := self._line.get()) is not None:
            try:
                waiting[0].settimeout(PATIENCE)
                self._reply(*waiting)
            except Exception:  # whatever error an answer raises, the next request is answered
                logging.getLogger("teleop_console").exception("a request was not answered")

    def _reply(self, one: socket.socket, data: bytes) -> None:
        with one, suppress(OSError, *_MALFORMED):
            head, end, _ = data.partition(b"\r\n\r\n")
            one.recv(len(head + end))  # the whole head has arrived
            body: Body = _none
            if _path(head.partition(b"\r\n")[0]) in self._slow:
                head, length = _without_body(head)
                body = partial(_body, one, length)
            response = self._answer(_parsed(head + end), body)
            response.headers["Connection"] = "close"
            one.sendall(response.serialize())

    def _pass_on(self, one: socket.socket) -> None:
        self.passed_on.waiting.append(one)
        with suppress(OSError):  # the event loop already has many connections to accept, so a wake-up is not needed
            self._told.send(b"\0")

    def _forget(self, one: socket.socket) -> None:
        del self._waiting[one]
        if one in self._partial:
            self._partial.discard(one)
        else:
            self._selector.unregister(one)

    def _drop(self, one: socket.socket) -> None:
        self._forget(one)
        one.close()


class PassedOn(socket.socket):
    """Socket that an event loop uses like a listening socket; it accepts the connections that a front passes on.

    Args:
        inner: Socket that becomes readable with every connection that is passed on; this object closes it.
        address: Address of the listening socket.

    Attributes:
        waiting: Connections that are passed on.
    """

    def __init__(self, inner: socket.socket, address: Any) -> None:
        super().__init__(inner.family, inner.type, inner.proto, inner.detach())
        self.setblocking(False)
        self.waiting: deque[socket.socket] = deque()
        self._address = address

    def listen(self, backlog: int = _BACKLOG, /) -> None:
        """Do nothing, because another socket listens."""

    def getsockname(self) -> Any:
        """Address of the listening socket."""
        return self._address

    def accept(self) -> tuple[socket.socket, Any]:
        """Return the next connection.

        Raises:
            BlockingIOError: No connection waits.
        """
        if self.waiting:
            with suppress(BlockingIOError):
                self.recv(1)
            one = self.waiting.popleft()
            return one, self._address
        self.recv(_LARGEST)  # remove the byte of an accepted connection; raises an error if there is no byte
        raise BlockingIOError

    def close(self) -> None:
        """Close the socket, and the connections that were not accepted."""
        while self.waiting:
            self.waiting.popleft().close()
        super().close()


def _none(most: int) -> bytes:
    del most
    return b""


def _without_body(head: bytes) -> tuple[bytes, int]:
    """Head of a request without the entries about its body, and the length of the body [bytes]."""
    if not head.startswith(b"POST "):
        return head, 0
    found = _LENGTH.findall(head)
    if len(found) != 1:
        raise ValueError
    return b"GET " + _LENGTH.sub(b"", head).removeprefix(b"POST "), int(found[0])


def _body(one: socket.socket, length: int, most: int) -> bytes:
    """Read the body of a request; the client must send it within :data:`PATIENCE` seconds."""
    if length > most:
        raise ValueError
    end, found = time.monotonic() + PATIENCE, bytearray()
    while len(found) < length and (left := end - time.monotonic()) > 0.0:
        one.settimeout(left)
        more = one.recv(length - len(found))
        if not more:
            raise EOFError
        found += more
    one.settimeout(PATIENCE)
    return bytes(found)


def _parsed(data: bytes) -> Head:
    """Parse the head of a request."""
    reader = StreamReader()
    reader.feed_data(data)
    reader.feed_eof()
    parsing = Head.parse(reader.read_line)
    try:
        next(parsing)
    except StopIteration as end:
        request: Head = end.value
        return request
    raise EOFError


def _path(line: bytes) -> str:
    """Path in the first line of a request; empty if the line contains no path."""
    words = line.split(b" ")
    try:
        return urlsplit(words[1].decode("ascii")).path if len(words) == 3 else ""
    except ValueError:
        return ""
