"""Feed: messages on their way from a loop to the recorder of its machine, past the middleware.

A loop writes all messages of a tick to a socket at once, and never waits: what the socket does not
take waits here, up to :data:`MOST` bytes. What exceeds that is lost, and the recorder sees it in
the numbers of the messages that follow. A loop looks for a recorder once a second. Without one, or
from another machine, the recorder hears by the middleware.
"""

import json
import os
import socket
import struct
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Protocol

MOST = 16 << 20
"""Bytes that wait for a recorder that takes nothing; about 7 s of a session of one arm."""
_HEAD = struct.Struct("<IHHIq")  # size, topic, word, number, time [ns]
_NAMES, _MESSAGE, _JOINED, _LEFT = 0, 1, 2, 3
_AGAIN = 1.0  # from one look for a recorder to the next [s]
_READ = 1 << 20  # bytes at once
_LOOPS = 64  # that may be waiting to be heard
_CREDENTIALS = struct.Struct("3i")  # process, user, group


def address() -> str:
    """Where the recorder of this machine and of the ROS domain of this process listens."""
    return f"\0teleop_core.recorder.{os.environ.get('ROS_DOMAIN_ID') or 0}"


class Channel:
    """Topic that a loop feeds.

    Args:
        feed: Its feed.
        index: Its place there.
    """

    def __init__(self, feed: "Feed", index: int) -> None:
        self._feed, self._index = feed, index
        self._number, self._is_inside = 0, False

    def give(self, data: bytes, sent_ns: int) -> None:
        """Feed a message that was sent at a time [ns]."""
        self._number += 1
        if self._feed.is_open and len(self._feed.waiting) < MOST:
            self._feed.put(self._index, _MESSAGE, data, self._number, sent_ns)

    def join(self, is_inside: bool) -> None:
        """Say whether this process sends the topic, or whoever else does."""
        if is_inside is not self._is_inside:
            self._is_inside = is_inside
            self.tell()

    def tell(self) -> None:
        """Say it again, to a recorder that does not know."""
        if self._feed.is_open:
            word = _JOINED if self._is_inside else _LEFT
            self._feed.put(self._index, word, time_ns=time.time_ns())


class Feed:
    """A loop's way to the recorder.

    Args:
        names: Topics that it may send, as the recorder knows them.
        place: Where the recorder listens, as of :func:`address`.

    Attributes:
        channels: Where the messages of each topic go, by its name.
        waiting: What is to be written.
        is_open: Whether a recorder listens.
    """

    def __init__(self, names: Iterable[str], place: str) -> None:
        self._names, self._place = tuple(names), place
        self._line: socket.socket | None = None
        self._looked = -_AGAIN
        self.waiting, self.is_open = bytearray(), False
        self.channels = {name: Channel(self, index) for index, name in enumerate(self._names)}

    def put(
        self, index: int, word: int, data: bytes = b"", number: int = 0, time_ns: int = 0
    ) -> None:
        """Append a frame to what waits."""
        self.waiting += _HEAD.pack(len(data), index, word, number, time_ns)
        self.waiting += data

    def flush(self) -> None:
        """Write what waits, as far as the socket takes it; look for a recorder now and then."""
        if self._line is None and self._names and time.monotonic() - self._looked > _AGAIN:
            self._looked = time.monotonic()
            self._connect()
        if self._line is not None and self.waiting:
            try:
                written = self._line.send(self.waiting)
            except BlockingIOError:
                return
            except OSError:  # the recorder has ended; another one may come
                self.close()
                return
            del self.waiting[:written]

    def close(self) -> None:
        """Write the rest as far as it goes, and leave the recorder."""
        if self._line is not None:
            with suppress(OSError):
                self._line.send(self.waiting)
            self._line.close()
        self._line, self.is_open = None, False
        self.waiting.clear()

    def _connect(self) -> None:
        line = socket.socket(socket.AF_UNIX)
        line.setblocking(False)
        try:
            line.connect(self._place)
        except OSError:  # nobody listens
            line.close()
            return
        self._line, self.is_open = line, True
        self.put(0, _NAMES, json.dumps(self._names).encode())
        for channel in self.channels.values():
            channel.tell()


class Fed(Protocol):
    """Who takes the messages of one topic."""

    def take(self, data: bytes, sent_ns: int, lost: int) -> None:
        """Take a message, before which so many were lost."""

    def join(self, is_inside: bool, since_ns: int) -> None:
        """Take messages of the feed, or those of the middleware, that were sent since then [ns]."""


class FeedReader:
    """The recorder's ends of all feeds of its machine; it hears loops of its own user alone.

    Args:
        channels: Who takes the messages of each topic, by its name.
        place: Where it listens, as of :func:`address`; where another recorder does, it hears none.
    """

    def __init__(self, channels: Mapping[str, Fed], place: str) -> None:
        self._channels = channels
        self._loops: list[_Loop] = []
        self._opened: socket.socket | None = socket.socket(socket.AF_UNIX)
        self._opened.setblocking(False)
        try:
            self._opened.bind(place)
            self._opened.listen(_LOOPS)
        except OSError:
            self._opened.close()
            self._opened = None

    def drain(self) -> None:
        """Hand on all that has come."""
        while self._opened is not None:
            try:
                line, _ = self._opened.accept()
            except OSError:
                break
            if _is_ours(line):
                self._loops.append(_Loop(line, self._channels))
            else:
                line.close()
        for one in self._loops:
            one.drain()
        self._loops = [one for one in self._loops if one.is_open]

    def close(self) -> None:
        """Hear nobody any more."""
        for one in self._loops:
            one.close()
        if self._opened is not None:
            self._opened.close()
        self._loops, self._opened = [], None


class _Loop:
    """What one loop feeds; where it ends, its topics are left to others."""

    def __init__(self, line: socket.socket, channels: Mapping[str, Fed]) -> None:
        line.setblocking(False)
        self._line, self._known, self._came = line, channels, bytearray()
        self._channels: list[Fed | None] = []
        self._last: dict[int, int] = {}
        self.is_open = True

    def drain(self) -> None:
        """Hand on all that has come."""
        while self.is_open:
            try:
                data = self._line.recv(_READ)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            self._came += data
            if not data:
                self._hand_on()
                self.close()
                return
        self._hand_on()

    def close(self) -> None:
        """Leave its topics to others."""
        self._line.close()
        self.is_open = False
        for channel in self._channels:
            if channel is not None:
                channel.join(False, time.time_ns())

    def _hand_on(self) -> None:
        """Hand on whole frames; who sends others is no loop of ours, and is heard no more."""
        try:
            self._take_frames()
        except (IndexError, ValueError, TypeError):
            self.close()

    def _take_frames(self) -> None:
        at, came = 0, self._came
        while len(came) - at >= _HEAD.size:
            size, index, word, number, time_ns = _HEAD.unpack_from(came, at)
            end = at + _HEAD.size + size
            if size > MOST:
                raise ValueError("a frame that no loop sends")
            if len(came) < end:
                break
            data = bytes(came[end - size : end])
            if word == _NAMES:
                self._channels = [self._known.get(name) for name in json.loads(data)]
            elif (channel := self._channels[index]) is not None:
                if word == _MESSAGE:
                    lost = number - self._last.get(index, number - 1) - 1
                    self._last[index] = number
                    channel.take(data, time_ns, lost)
                else:
                    channel.join(word == _JOINED, time_ns)
            at = end
        del came[:at]


def _is_ours(line: socket.socket) -> bool:
    """Whether the other side is of the same user."""
    told = line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    return int(_CREDENTIALS.unpack(told)[1]) == os.getuid()
