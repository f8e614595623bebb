"""Feed: messages on their way from a loop's process to the recorder, past the middleware.

A loop writes all messages of a tick to a pipe at once, and never waits: what the pipe does not take
waits here, up to :data:`MOST` bytes. What exceeds that is lost, and the recorder sees it in the
numbers of the messages that follow.
"""

import fcntl
import json
import os
import struct
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple, Protocol

from teleop_core.graph.graph import Graph
from teleop_core.graph.topics import Kind

WRITES, READS = "TELEOP_FEED", "TELEOP_FEEDS"
"""Environment variables: the pipe that a process writes to with its topics; those that are read."""
MOST = 16 << 20
"""Bytes that wait for a recorder that takes nothing; about 7 s of a session of one arm."""
_PIPE = 1 << 20  # bytes, the most that Linux grants everybody
_HEAD = struct.Struct("<IHHIq")  # size, topic, word, number, time [ns]
_MESSAGE, _JOINED, _LEFT = 0, 1, 2
_READ = 1 << 20  # bytes at once


class Fed(Protocol):
    """Who takes the messages of one topic."""

    def take(self, number: int, data: bytes, sent_ns: int) -> None:
        """Take a message, by its number in the feed, 1 for the first."""

    def join(self, is_inside: bool) -> None:
        """Take messages of the feed, or those of the topic."""


def fed_topics(graph: Graph, members: Iterable[str]) -> list[str]:
    """Names of the topics that some members of a graph feed: reports go by the middleware."""
    wanted = frozenset(members)
    return [
        topic.name for member in graph.members if member.name in wanted
        for topic in member.writes if topic.kind is not Kind.REPORT
    ]  # fmt: skip


class Pipe(NamedTuple):
    """One end of a pipe, and the topics that it feeds.

    Attributes:
        file: Number of the file; as text where the starter of a process puts it in.
        names: Topics, in the order in which both ends count them.
    """

    file: int | str
    names: Sequence[str]


def variable(*pipes: Pipe) -> str:
    """Value of :data:`WRITES` or :data:`READS`."""
    return json.dumps(pipes)


def pipes_of_environment(name: str) -> list[Pipe]:
    """Pipes that were left open for this process, and for none that it starts."""
    found = [Pipe(int(file), names) for file, names in json.loads(os.environ.pop(name, "[]"))]
    for pipe in found:
        os.set_inheritable(int(pipe.file), False)
        os.set_blocking(int(pipe.file), False)
    return found


class _Channel:
    """Topic that is fed."""

    def __init__(self, feed: "Feed", index: int) -> None:
        self._feed, self._index = feed, index
        self._number, self._is_inside = 0, True

    def give(self, data: bytes, sent_ns: int) -> None:
        """Feed a message that was sent at a time [ns]."""
        self._number += 1
        waiting = self._feed.waiting
        if len(waiting) < MOST:
            waiting += _HEAD.pack(len(data), self._index, _MESSAGE, self._number, sent_ns)
            waiting += data

    def join(self, is_inside: bool) -> None:
        """Say whether this process sends the topic, or whoever else does."""
        if is_inside is not self._is_inside:
            self._is_inside = is_inside
            word = _JOINED if is_inside else _LEFT
            self._feed.waiting += _HEAD.pack(0, self._index, word, 0, 0)


class Feed:
    """Pipe to the recorder.

    Args:
        pipe: The end to write to; it is this object's.

    Attributes:
        channels: Where the messages of each topic go, by its name.
        waiting: What is to be written.
    """

    def __init__(self, pipe: Pipe) -> None:
        self._file, self.waiting = int(pipe.file), bytearray()
        self.channels = {name: _Channel(self, index) for index, name in enumerate(pipe.names)}
        with suppress(OSError):
            fcntl.fcntl(self._file, fcntl.F_SETPIPE_SZ, _PIPE)

    def flush(self) -> None:
        """Write what waits, as far as the pipe takes it."""
        if not self.waiting:
            return
        try:
            written = os.write(self._file, self.waiting)
        except BlockingIOError:
            return
        except OSError:  # the recorder has ended; the middleware has all that it misses
            written = len(self.waiting)
        del self.waiting[:written]

    def close(self) -> None:
        """Write the rest as far as it goes, and end it."""
        if self._file >= 0:
            self.flush()
            os.close(self._file)
            self._file = -1


class FeedReader:
    """The recorder's end of a feed.

    Args:
        pipe: The end to read from; it is this object's.
        channels: Who takes the messages of each topic, by its name.
    """

    def __init__(self, pipe: Pipe, channels: Mapping[str, Fed]) -> None:
        self._file, self._came = int(pipe.file), bytearray()
        self._channels = [channels.get(name) for name in pipe.names]

    def drain(self) -> None:
        """Hand on all that has come; a feed whose process ended leaves its topics to others."""
        while self._file >= 0:
            try:
                data = os.read(self._file, _READ)
            except BlockingIOError:
                break
            if not data:
                self.close()
            self._came += data
        self._hand_on()

    def _hand_on(self) -> None:
        at, came = 0, self._came
        while len(came) - at >= _HEAD.size:
            size, index, word, number, time_ns = _HEAD.unpack_from(came, at)
            end = at + _HEAD.size + size
            if len(came) < end:
                break
            channel = self._channels[index]
            if channel is not None and word == _MESSAGE:
                channel.take(number, bytes(came[end - size : end]), time_ns)
            elif channel is not None:
                channel.join(word == _JOINED)
            at = end
        del came[:at]
        if self._file < 0:
            for channel in self._channels:
                if channel is not None:
                    channel.join(False)

    def close(self) -> None:
        """End it."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
