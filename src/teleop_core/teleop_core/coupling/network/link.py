"""Link: packets in transit in one direction of a network.

A packet waits in a queue while the line is busy with earlier packets. Its transmission begins at ``max(sent, end of
the previous transmission)`` and lasts its size divided by the bandwidth: a queue of one server (Kleinrock 1975,
section 1.2). The
tick of its arrival is determined when its transmission begins. Packets due at the same tick share an entry in a
calendar of ticks, which keeps the newest packet. So the cost of a tick does not depend on the delay.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np

from teleop_core.coupling.network import CHANCES, MEMORY, packet_size
from teleop_core.kernels import Array, Fields, Integers, inner

LONGEST = 16384
"""Largest delay of a packet [ticks]; a packet that would take longer is lost."""
QUEUE = 1024
"""Largest number of packets in a queue."""
BLOCK = 1000
"""Number of ticks for which random numbers are drawn at once."""
_BothWays = Annotated[Integers, 2]


class LinkRecord(Fields):
    """Fields of a parameter record with the numbers of both directions."""

    least_delay: Annotated[Array, 2]  # [s]
    loss: Annotated[Array, 2]
    keeps_order: _BothWays
    every: _BothWays  # smallest number of ticks between two packets
    byte_ticks: Annotated[Array, 2]  # ticks that a byte takes; 0 without a bound
    queue: _BothWays  # largest number of waiting packets


class LinkState(Fields):
    """Fields of a state record with the state of both directions."""

    tick: int
    next: int  # number of random numbers used so far
    behind: int  # number of ticks by which the present tick is late
    sent: _BothWays
    lost: _BothWays
    newest: _BothWays  # numbers of the newest packets that arrived
    last_due: _BothWays  # latest arrival tick of a packet so far
    sent_tick: _BothWays
    arrived: _BothWays  # whether a packet arrived in this tick
    free: Annotated[Array, 2]  # tick, with fractions, at which the line is free
    head: _BothWays  # index of the packet that has waited longest
    waits: _BothWays  # number of waiting packets


class Direction(NamedTuple):
    """One direction: its draw kernel, the contents of a packet, and the calendar of due packets."""

    draw: Any
    numbers: Array
    memory: Array
    chances: Array  # random numbers of a block of ticks (BLOCK, CHANCES + 1)
    packet: Array  # values (W,) of the packet that is made; the next array contains the stamps of its topics (K,)
    packet_ns: Any
    came: Array  # values and stamps of the newest packet that arrived
    came_ns: Any
    values: Array  # calendar: values (LONGEST, W), stamps (LONGEST, K), tick and number of each
    stamps: Any
    due: Any
    number: Any
    sizes: Array  # bytes of a message of each topic (K,)
    waiting: Array  # queue: values, motion, bytes (QUEUE, W + 4); stamps, number (QUEUE, K + 1)
    waiting_ns: Any
    way: Array  # summed motion of all packets due at a tick (LONGEST, 3) [m]
    moved: Array  # motion of the packet that is being made, and of the packets that arrived (2, 3) [m]

    def clear(self) -> None:
        """Forget all packets in transit."""
        self.due[:] = 0
        for array in (self.memory, self.came, self.came_ns, self.moved):
            array[...] = 0


def make_way(width: int, sizes: Array, draw: Any, numbers: Array) -> Direction:
    """Make a direction whose packets have ``width`` numbers, of topics with message sizes ``sizes`` (K,)."""
    topics = len(sizes)
    return Direction(
        draw=draw, numbers=numbers, memory=np.zeros(MEMORY), chances=np.zeros((BLOCK, CHANCES + 1)),
        packet=np.zeros(width), packet_ns=np.zeros(topics, np.int64),
        came=np.zeros(width), came_ns=np.zeros(topics, np.int64),
        values=np.zeros((LONGEST, width)), stamps=np.zeros((LONGEST, topics), np.int64),
        due=np.zeros(LONGEST, np.int64), number=np.zeros(LONGEST, np.int64),
        sizes=sizes, waiting=np.zeros((QUEUE, width + 4)),
        waiting_ns=np.zeros((QUEUE, topics + 1), np.int64),
        way=np.zeros((LONGEST, 3)), moved=np.zeros((2, 3)),
    )  # fmt: skip


@inner
def may_send(p: LinkRecord, s: LinkState, k: int) -> bool:
    """Whether the rate of packets of direction ``k`` allows another packet in this tick."""
    return bool(s.sent[k] == 0 or s.tick - s.sent_tick[k] >= p.every[k])


@inner
def _due(p: LinkRecord, s: LinkState, way: Direction, k: int, dt: float) -> int:
    """Arrival tick of the packet whose transmission ends at ``s.free``; 0 if the packet is lost."""
    chances = way.chances[s.next]
    drawn = way.draw(way.numbers, way.memory, chances[:CHANCES], s.tick * dt)
    if drawn < 0.0 or chances[CHANCES] < p.loss[k]:
        return 0
    busy = s.free[k] - s.tick
    due = s.tick + s.behind + int((p.least_delay[k] + drawn) / dt + busy + 0.5)
    if p.keeps_order[k]:
        due = max(due, s.last_due[k])
    if due - s.tick >= LONGEST:
        return 0
    s.last_due[k] = due
    return due


@inner
def _packet_bytes(way: Direction) -> float:
    """Bytes of ``way.packet``; a topic that has not been written yet does not count."""
    size = float(packet_size.HEADER)
    for i in range(way.sizes.shape[0]):
        if way.packet_ns[i] != 0:
            size += way.sizes[i]
    return size


@inner
def send_packet(p: LinkRecord, s: LinkState, way: Direction, k: int, dt: float) -> None:
    """Send ``way.packet`` with the motion in ``way.moved[0]``; arguments as in :func:`serve_line`."""
    queue_packet(p, s, way, k)
    serve_line(p, s, way, k, dt)


@inner
def queue_packet(p: LinkRecord, s: LinkState, way: Direction, k: int) -> None:
    """Put ``way.packet`` into the queue of the line.

    If the queue is full, its oldest packet is lost. If the order of packets is kept, the new packet is lost instead.

    Args:
        p: Parameters.
        s: State; written.
        way: The direction; written.
        k: Index of the direction.
    """
    s.sent[k] += 1
    s.sent_tick[k] = s.tick
    if p.keeps_order[k] and s.waits[k] >= p.queue[k]:
        s.lost[k] += 1
        return
    while s.waits[k] >= p.queue[k]:
        s.lost[k] += 1
        _leave_queue(s, k)
    if s.waits[k] == 0:
        s.free[k] = max(s.free[k], float(s.tick))
    at = (s.head[k] + s.waits[k]) % QUEUE
    width, topics = way.packet.shape[0], way.packet_ns.shape[0]
    for i in range(width):
        way.waiting[at, i] = way.packet[i]
    for i in range(3):
        way.waiting[at, width + i] = way.moved[0, i]
    way.waiting[at, width + 3] = _packet_bytes(way)
    for i in range(topics):
        way.waiting_ns[at, i] = way.packet_ns[i]
    way.waiting_ns[at, topics] = s.sent[k]
    s.waits[k] += 1


@inner
def _leave_queue(s: LinkState, k: int) -> None:
    s.head[k] = (s.head[k] + 1) % QUEUE
    s.waits[k] -= 1


@inner
def serve_line(p: LinkRecord, s: LinkState, way: Direction, k: int, dt: float) -> None:
    """Begin the transmission of waiting packets while the line is free.

    Args:
        p: Parameters.
        s: State; written.
        way: The direction; written.
        k: Index of the direction.
        dt: Tick [s].
    """
    while s.waits[k] > 0 and s.free[k] <= s.tick:
        at = s.head[k]
        due = transmit(p, s, way, k, dt)
        if due != 0:
            _put_in_calendar(way, at, due)


@inner
def transmit(p: LinkRecord, s: LinkState, way: Direction, k: int, dt: float) -> int:
    """Transmit the packet that has waited longest; returns the tick of its arrival, or 0 if it is lost.

    Arguments as in :func:`serve_line`.
    """
    s.free[k] += way.waiting[s.head[k], way.packet.shape[0] + 3] * p.byte_ticks[k]
    due = _due(p, s, way, k, dt)
    if due == 0:
        s.lost[k] += 1
    _leave_queue(s, k)
    return due


@inner
def _put_in_calendar(way: Direction, waiting: int, due: int) -> None:
    """Put the packet at index ``waiting`` of the queue into the calendar, at the tick ``due``."""
    width, topics = way.packet.shape[0], way.packet_ns.shape[0]
    at = due % LONGEST
    if way.due[at] != due:
        way.due[at] = due
        for i in range(3):
            way.way[at, i] = 0.0
    way.number[at] = way.waiting_ns[waiting, topics]  # this packet is newer than the packet already due at that tick
    for i in range(width):
        way.values[at, i] = way.waiting[waiting, i]
    for i in range(topics):
        way.stamps[at, i] = way.waiting_ns[waiting, i]
    for i in range(3):
        way.way[at, i] += way.waiting[waiting, width + i]


@inner
def take_packet(s: LinkState, way: Direction, k: int) -> None:
    """Take the packets that are due now; write the newest into ``way.came``, and whether it is new into ``s.arrived``.

    ``way.moved[1]`` gets the summed motion of all due packets, including overtaken packets.
    """
    s.arrived[k] = 0
    at = s.tick % LONGEST
    is_due = way.due[at] == s.tick
    for i in range(3):
        way.moved[1, i] = way.way[at, i] if is_due else 0.0
    if not is_due or way.number[at] <= s.newest[k]:
        return
    s.newest[k], s.arrived[k] = way.number[at], 1
    for i in range(way.came.shape[0]):
        way.came[i] = way.values[at, i]
    for i in range(way.came_ns.shape[0]):
        way.came_ns[i] = way.stamps[at, i]
