"""Ends: writers and readers of simulated topics, and services."""

import ctypes
import struct
from bisect import insort
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

from teleop_core.middleware.platform import Qos, Taken
from teleop_core.middleware.ros_messages import write_message
from teleop_core.nodes.sender import halves
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.reach import NEVER_NS, TAKE_NS, Reached
from teleop_drill.simulation.scheduler import Scheduler, Strand

_PUBLISH_NS = 12_000  # time that the middleware needs to publish a message, measured with rclpy [ns]
_OK, _EMPTY = 0, 401  # RCL_RET_OK, RCL_RET_SUBSCRIPTION_TAKE_FAILED
_ROOM = 1024  # initial size of the buffer of a taken message [bytes]
_Two = ctypes.c_int64 * 2
_MESSAGE, _INFO = struct.Struct("2q"), struct.Struct("7q")
_halves = cache(halves)


def _name_of(kind: Any) -> str:
    """Name of the ROS type of a message class, such as ``sensor_msgs/msg/JointState``."""
    return f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"


@dataclass
class Match:
    """A writer and a reader that have discovered each other, or will do so."""

    reader: "Reader"
    writer_knows_ns: int
    reader_knows_ns: int
    is_reliable: bool
    last_ns: int = 0
    awaits_last: bool = False
    """Whether the stored messages of a latched topic, including the present one, must still be sent."""


class _Carrier(Protocol):
    """Methods of the middleware (:class:`~teleop_drill.simulation.bus.Bus`) that writers and readers use."""

    scheduler: Scheduler
    reaches: bool
    seen: dict[str, Callable[[Taken], None]]
    heard: dict[str, Callable[["Reader", Taken], None]]

    def next_gid(self) -> bytes: ...
    def next_order(self) -> int: ...
    def carry(self, writer: "Writer", link: Match, taken: Taken) -> None: ...
    def send_again(self, reader: "Reader", taken: Taken) -> bool: ...
    def leave_reader(self, reader: "Reader") -> None: ...


class Writer:
    """Writer of a topic, with the interface of :class:`~teleop_core.middleware.platform.Publisher`.

    Args:
        bus: The simulated middleware.
        process: Process that owns the writer.
        node: Name of the writer's node, with the namespace.
        topic: Full name of the topic.
        kind: Class of the messages.
        qos: QoS of the writer.
    """

    def __init__(self, bus: _Carrier, process: Process, node: str, topic: str, kind: Any, qos: Qos) -> None:
        self._bus, self.process, self.node, self.topic, self.qos = bus, process, node, topic, qos
        self.ros_type = _name_of(kind)
        self.sender, self.born_ns, self._clock = bus.next_gid(), bus.scheduler.now_ns, process.machine.clock
        self._now = bus.scheduler.now
        self.number, self.is_open, self.is_active = 0, True, True
        self.links: list[Match] = []
        self.history: deque[Taken] = deque(maxlen=None if qos.keeps_all else qos.depth)
        self._reached = Reached(bus.scheduler.now_at, self._send_at, bus.scheduler.keep)
        self._place, self._view = (0, 0), memoryview(b"")
        """Address and size of the last message that a kernel sent, and its memory."""
        self.note_links()

    @property
    def pointer(self) -> int:
        """Address for kernels; 0 while the writer sends nothing, or if kernels cannot reach the middleware."""
        is_reached = self.is_active and self.is_open and self._bus.reaches
        return self._reached.address if is_reached else 0

    def hold(self) -> None:
        """Do nothing, because a writer is never destroyed."""

    def release(self) -> None:
        """Do nothing, because a writer is never destroyed."""

    def note_links(self) -> None:
        """Tell kernels from which time on somebody reads the topic; an observer is a reader from the begin on."""
        times = [0] if self.topic in self._bus.seen else [link.writer_knows_ns for link in self.links]
        self._reached.since(min(times, default=NEVER_NS))

    def _send_at(self, message_at: int, _: int) -> int:
        place = at, size = tuple(_Two.from_address(message_at))
        if place != self._place:
            self._place, self._view = place, memoryview((ctypes.c_char * size).from_address(at))
        self.send(bytes(self._view))
        return 0

    def publish(self, message: Any) -> None:
        """Send a message, or the bytes of a message."""
        self.send(message if isinstance(message, bytes) else write_message(message))

    def send(self, data: bytes) -> None:
        """Send bytes, if the node is active."""
        if not (self.is_active and self.is_open):
            return
        bus, now = self._bus, self._now
        now[0] = now_ns = now[0] + _PUBLISH_NS
        self.number += 1
        # The middleware reads the machine's clock; the clock that the drill steps is used only by Python code.
        taken = Taken(data, self.sender, self.number, now_ns + self._clock.ahead_ns(now_ns), 0)
        self.history.append(taken)
        if self.topic in bus.seen:
            bus.seen[self.topic](taken)
        for link in self.links:
            if link.writer_knows_ns <= now_ns and not link.awaits_last:
                bus.carry(self, link, taken)

    def get_subscription_count(self) -> int:
        """Number of discovered readers."""
        now_ns = self._bus.scheduler.now_ns
        return sum(link.writer_knows_ns <= now_ns for link in self.links)

    def wait_for_all_acked(self, seconds: float) -> None:
        """Wait until all readers have all messages; in the simulation this is a short constant time."""
        self._bus.scheduler.sleep(min(seconds, 1e-3))


class Reader:
    """Reader of a topic, with the interface of :class:`~teleop_core.middleware.platform.Taker`.

    Args:
        bus: The simulated middleware.
        process: Process that owns the reader.
        kind: Class of the messages.
        topic: Full name of the topic.
        qos: QoS of the reader.
        node: Name of the reader's node, with the namespace.
    """

    def __init__(self, bus: _Carrier, process: Process, kind: Any, topic: str, qos: Qos, node: str) -> None:
        self._bus, self.process, self.type, self.topic, self.qos = bus, process, kind, topic, qos
        self.node, self.ros_type, self.sender = node, _name_of(kind), bus.next_gid()
        self.lost, self.born_ns, self.is_open, self._now = 0, bus.scheduler.now_ns, True, bus.scheduler.now
        self.coming: deque[tuple[int, int, Taken]] = deque()
        self._ready: deque[tuple[int, int, Taken]] = deque(maxlen=None if qos.keeps_all else qos.depth)
        self.waiting: Strand | None = None
        self.told: Callable[[], None] | None = None
        """Function that is called when a message arrives; None if no executor serves the reader."""
        self._reached = Reached(bus.scheduler.now_at, self._take_at, bus.scheduler.keep)
        self._message, self._info = (ctypes.c_int64 * 2)(), (ctypes.c_int64 * 7)()
        """``rcutils_uint8_array_t`` and ``rmw_message_info_t`` of the last taken message, for kernels."""
        self._buffer, self._found = ctypes.create_string_buffer(_ROOM), (0, Taken(b"", b"", 0, 0, 0))
        self._at, self._room = ctypes.addressof(self._buffer), memoryview(self._buffer).cast("B")

    @property
    def places(self) -> tuple[int, int, int] | None:
        """Addresses of the reader, of a message, and of its information, for kernels; None if they cannot reach it."""
        if not self._bus.reaches:
            return None
        return self._reached.address, ctypes.addressof(self._message), ctypes.addressof(self._info)

    def taken(self) -> Taken:
        """The last message that was taken, also by a kernel."""
        came_ns, (data, sender, number, sent_ns, _) = self._found
        return Taken(data, sender, number, sent_ns, came_ns)

    def _take_at(self, _: int, __: int) -> int:
        """:meth:`take` for a kernel."""
        if (found := self._pop()) is None:
            return _EMPTY
        came_ns, (data, sender, number, sent_ns, _) = found
        self._found = found
        if (size := len(data)) > len(self._buffer):
            self._buffer = ctypes.create_string_buffer(size)
            self._at, self._room = ctypes.addressof(self._buffer), memoryview(self._buffer).cast("B")
        self._room[:size] = data
        _MESSAGE.pack_into(self._message, 0, self._at, size)
        _INFO.pack_into(self._info, 0, sent_ns, came_ns, number, 0, 0, *_halves(sender))
        return _OK

    def _note(self) -> None:
        """Tell kernels when the next message can be taken."""
        since_ns = 0 if self._ready else self.coming[0][0] if self.coming else NEVER_NS
        self._reached.since(since_ns)

    def take(self) -> Taken | None:
        """Remove and return the oldest waiting message; None if no message waits."""
        if (found := self._pop()) is None:
            return None
        came_ns, (data, sender, number, sent_ns, _) = found
        return Taken(data, sender, number, sent_ns, came_ns)

    def _pop(self) -> tuple[int, Taken] | None:
        """Remove the oldest waiting message; its time of arrival by the machine's clock [ns], and the message."""
        now = self._now
        now[0] = now_ns = now[0] + TAKE_NS
        coming, ready = self.coming, self._ready
        while coming and coming[0][0] <= now_ns:
            ready.append(coming.popleft())
        if not ready or not self.is_open:
            return None
        came_ns, _, taken = ready.popleft()
        self._note()
        if self.topic in self._bus.heard:
            self._bus.heard[self.topic](self, taken)
        return came_ns + self.process.machine.clock.ahead_ns(now_ns), taken

    def wait(self, seconds: float) -> None:
        """Wait until a message arrives, at most for a time [s]."""
        scheduler = self._bus.scheduler
        if self._ready or (self.coming and self.coming[0][0] <= scheduler.now_ns):
            return
        self.waiting = scheduler.current
        if self.coming:
            scheduler.at(self.coming[0][0], self.tell)
        scheduler.wait(seconds)
        self.waiting = None

    def tell(self) -> None:
        """Report that a message has arrived."""
        if self.waiting is not None:
            self._bus.scheduler.wake(self.waiting)
        if self.told is not None:
            self.told()

    def waits(self, least: int) -> int:
        """Number of waiting messages; 0 if there cannot be more than ``least``, which is faster to check."""
        if len(self._ready) + len(self.coming) <= least:
            return 0
        now_ns = self._bus.scheduler.now_ns
        came = len(self._ready) + sum(entry[0] <= now_ns for entry in self.coming)
        return came if self.qos.keeps_all else min(came, self.qos.depth)

    def close(self) -> None:
        """Close the reader."""
        self._bus.leave_reader(self)

    def put(self, came_ns: int, taken: Taken) -> None:
        """Add a message that arrives at a time [ns]."""
        entry = (came_ns, self._bus.next_order(), taken)
        if self.coming and self.coming[-1][0] > came_ns:
            ordered = list(self.coming)
            insort(ordered, entry)
            self.coming = deque(ordered)
        else:
            self.coming.append(entry)
        if self.coming[0] is entry:
            self._note()
        if self.waiting is not None or self.told is not None:
            self._bus.scheduler.at(came_ns, self.tell)

    def wake_up(self, since_ns: int, room: int) -> int:
        """Drop messages that arrived while the process did not run and for which its socket had no space.

        Args:
            since_ns: Time from which on the process did not run [ns].
            room: Free space of the socket [bytes].

        Returns:
            Remaining free space [bytes].
        """
        now_ns, kept, lost = self._bus.scheduler.now_ns, deque[tuple[int, int, Taken]](), []
        for entry in self.coming:
            if not since_ns <= entry[0] <= now_ns:
                kept.append(entry)
            elif room >= len(entry[2].data):
                room -= len(entry[2].data)
                kept.append(entry)
            else:
                lost.append(entry[2])
        self.coming = kept
        self._note()
        for taken in lost:
            if not self._bus.send_again(self, taken):
                self.lost += 1
        return room


class Service:
    """Service of a node.

    Args:
        process: Process that owns the service.
        answer: Function that is called with a request and sends the answer.
        born_ns: Time at which the service was created [ns].
    """

    def __init__(self, process: Process, answer: Callable[[Any, Callable[[Any], None]], object], born_ns: int) -> None:
        self.process, self.answer, self.born_ns, self.is_open = process, answer, born_ns, True
