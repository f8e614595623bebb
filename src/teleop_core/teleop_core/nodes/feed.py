"""Feed: sends messages from a loop to the recorder of the same machine, without the middleware.

A loop writes all messages of a tick to a socket at once, and never waits. Messages that the socket does not accept are
queued, at most :data:`MOST` bytes. Further messages are lost; the recorder detects this by the numbers of later
messages. A loop looks for a recorder once a second. Without a feed, and from other machines, the recorder gets
messages by the middleware.
"""

import json
import struct
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, Protocol

import numpy as np

from teleop_core.kernels import records
from teleop_core.kernels.fields import Cells, fields_of
from teleop_core.middleware.platform import Line, Listener, Platform
from teleop_core.nodes.wire import Block

MOST = 16 << 20
"""Largest queue for a recorder that reads nothing [bytes]; about 7 s of a session of one arm."""
_HEAD = struct.Struct("<IHHIq")  # head of a frame: size, topic, word, number, time [ns]
_NAMES, _MESSAGE, _JOINED, _LEFT, _END = 0, 1, 2, 3, 4
_AGAIN_NS = 1_000_000_000  # time between two searches for a recorder
_BLOCK = 1 << 16
"""Size of the block that kernels fill [bytes]: some twenty ticks of a session."""
NO_BLOCK: Any = records(fields_of(Block))[0]
"""Block of a loop that feeds no recorder."""
_READ = 1 << 20  # largest number of bytes per read


class Channel:
    """Topic whose messages a loop feeds to the recorder.

    Args:
        feed: Feed of the loop.
        index: Index of the topic in the feed.

    Attributes:
        index: As given.
        number: Number of the last message of the topic, if kernels do not feed it.
    """

    def __init__(self, feed: "Feed", index: int) -> None:
        self._feed, self.index = feed, index
        self.number, self._is_inside = 0, False

    def give(self, data: bytes, sent_ns: int) -> None:
        """Feed a message that was sent at a time [ns]."""
        self.number += 1
        if self._feed.is_open and len(self._feed.waiting) < MOST:
            self._feed.put(self.index, _MESSAGE, data, self.number, sent_ns)

    def join(self, is_inside: bool) -> None:
        """Tell the recorder whether this process sends the topic; False if another process does."""
        if is_inside is not self._is_inside:
            self._is_inside = is_inside
            self.tell()

    def tell(self) -> None:
        """Tell a new recorder whether this process sends the topic."""
        if self._feed.is_open:
            word = _JOINED if self._is_inside else _LEFT
            self._feed.put(self.index, word, time_ns=self._feed.platform.time_ns())


class Feed:
    """A loop's connection to the recorder.

    Args:
        names: Topics that the loop may send, with the names that the recorder uses.
        platform: Platform of the loop.

    Attributes:
        platform: As given.
        channels: Channel of each topic, by its name.
        waiting: Queued bytes that are not written yet.
        block: Record of :class:`~teleop_core.nodes.wire.Block`: messages that kernels have fed since the last flush.
    """

    def __init__(self, names: Iterable[str], platform: Platform) -> None:
        self._names, self.platform = tuple(names), platform
        self._line: Line | None = None
        self._looked_ns = -_AGAIN_NS
        self.waiting = bytearray()
        self.block: Any = records(fields_of(Block))[0]
        self._bytes = np.zeros(_BLOCK, np.uint8)
        cells = Cells(self.block)
        self._view, self._fill, self._is_open = self._bytes.data, cells.number("fill"), cells.number("is_open")
        self.block["at"], self.block["room"] = self._bytes.ctypes.data, _BLOCK
        self.channels = {name: Channel(self, index) for index, name in enumerate(self._names)}

    @property
    def is_open(self) -> bool:
        """Whether a recorder listens."""
        return bool(self._is_open[0])

    def spill(self) -> None:
        """Move the messages of the block to the queue."""
        fill = self._fill[0]
        if fill and len(self.waiting) < MOST:
            self.waiting += self._view[:fill]
        self._fill[0] = 0

    def put(self, index: int, word: int, data: bytes = b"", number: int = 0, time_ns: int = 0) -> None:
        """Append a frame to the queue."""
        self.spill()
        self.waiting += _HEAD.pack(len(data), index, word, number, time_ns)
        self.waiting += data

    def flush(self) -> None:
        """Write as much of the queue as the socket accepts; at intervals, look for a recorder."""
        if self._line is None and self._names:
            now_ns = self.platform.monotonic_ns()
            if now_ns - self._looked_ns > _AGAIN_NS:
                self._looked_ns = now_ns
                self._connect()
        fill = self._fill[0]
        if self._line is None or not (fill or self.waiting):
            return
        is_straight = not self.waiting  # nothing has to be copied if the socket accepts everything
        if not is_straight:
            self.spill()
        try:
            written = self._line.send(self._view[:fill] if is_straight else self.waiting)
        except BlockingIOError:
            return
        except OSError:  # the recorder has ended; a new recorder may start
            self.close()
            return
        if is_straight and written == fill:
            self._fill[0] = 0
        else:
            self.spill()
            del self.waiting[:written]

    def close(self) -> None:
        """Write as much of the queue as the socket accepts, and disconnect from the recorder."""
        if self._line is not None:
            self.put(0, _END)
            with suppress(OSError):
                self._line.send(self.waiting)
            self._line.close()
        self._line, self.block["is_open"], self.block["fill"] = None, 0, 0
        self.waiting.clear()

    def _connect(self) -> None:
        try:
            line = self.platform.connect(self.platform.feed_place())
        except OSError:  # no recorder listens
            return
        self._line, self.block["is_open"] = line, 1
        self.put(0, _NAMES, json.dumps(self._names).encode())
        for channel in self.channels.values():
            channel.tell()


class Fed(Protocol):
    """Receiver of the messages of one topic."""

    def take(self, data: bytes, sent_ns: int, lost: int) -> None:
        """Receive a message; ``lost`` messages before it were lost."""

    def join(self, is_inside: bool, since_ns: int) -> None:
        """Receive messages sent since ``since_ns`` [ns] from the feed if ``is_inside``, else from the middleware."""


class FeedReader:
    """The recorder's side of all feeds of its machine. It accepts only loops of the same user.

    Args:
        channels: Receiver of the messages of each topic, by its name.
        platform: Platform of the recorder. If another recorder already listens in it, this one gets no feeds.

    Attributes:
        cut: Number of feeds that ended without notice: the queued messages of a killed process are lost.
    """

    def __init__(self, channels: Mapping[str, Fed], platform: Platform) -> None:
        self._channels, self._platform, self.cut = channels, platform, 0
        self._loops: list[_Source] = []
        self._opened: Listener | None = None
        with suppress(OSError):
            self._opened = platform.listen(platform.feed_place())

    def drain(self) -> None:
        """Pass on all messages that have arrived."""
        while self._opened is not None and (line := self._opened.accept()) is not None:
            self._loops.append(_Source(line, self._channels, self._platform))
        for one in self._loops:
            one.drain()
        self.cut += sum(not (one.is_open or one.has_ended) for one in self._loops)
        self._loops = [one for one in self._loops if one.is_open]

    def close(self) -> None:
        """Close all feeds."""
        for one in self._loops:
            one.close()
        if self._opened is not None:
            self._opened.close()
        self._loops, self._opened = [], None


class _Source:
    """Feed of one loop. When it ends, other senders may send its topics."""

    def __init__(self, line: Line, channels: Mapping[str, Fed], platform: Platform) -> None:
        self._line, self._known, self._platform, self._came = line, channels, platform, bytearray()
        self._channels: list[Fed | None] = []
        self._last: dict[int, int] = {}
        self.is_open, self.has_ended = True, False

    def drain(self) -> None:
        """Pass on all messages that have arrived."""
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
        """Close the feed; the recorder receives its topics by the middleware again."""
        self._line.close()
        self.is_open = False
        for channel in self._channels:
            if channel is not None:
                channel.join(False, self._platform.time_ns())

    def _hand_on(self) -> None:
        """Pass on whole frames. A sender of malformed frames is not a loop of this package; it is disconnected."""
        try:
            self._take_frames()
        except (IndexError, ValueError, TypeError):
            self.close()

    def _take_frames(self) -> None:
        at, came, last, channels, head = 0, bytes(self._came), self._last, self._channels, _HEAD.size
        while len(came) - at >= head:
            size, index, word, number, time_ns = _HEAD.unpack_from(came, at)
            end = at + head + size
            if size > MOST:
                raise ValueError("a frame that no loop sends")
            if len(came) < end:
                break
            data = came[at + head : end]
            at = end
            if word == _MESSAGE:
                if (channel := channels[index]) is not None:
                    lost = number - last.get(index, number - 1) - 1
                    last[index] = number
                    channel.take(data, time_ns, lost)
            elif word == _END:
                self.has_ended = True
            elif word == _NAMES:
                self._channels = channels = [self._known.get(name) for name in json.loads(data)]
            elif (channel := channels[index]) is not None:
                channel.join(word == _JOINED, time_ns)
        del self._came[:at]
