"""Bus: topics and services between simulated processes, with the behaviour of ROS 2 on Fast DDS.

In this model, writer and reader of a topic discover each other at different times. Messages before the discovery reach
only readers that request the last messages of a latched topic. A full queue loses its oldest message. A full socket
loses arriving messages; reliable writers send a lost message again if their history still contains it. Each writer
numbers its messages.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from random import Random

from teleop_core.middleware.platform import Endpoint, Taken
from teleop_drill.simulation.ends import Match, Reader, Service, Writer
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.reach import functions
from teleop_drill.simulation.scheduler import Scheduler

_SOCKET = 4 << 20
"""Size of the receive buffer of a process [bytes], as in the middleware's profile."""
_LEASE_NS = 20_000_000_000
"""Time after which a process that was killed counts as gone [ns]."""
_GID = 16
_TOLD_NS = 1_000_000  # shortest time in which a known process announces a new topic [ns]
_TOLD_SPREAD_NS = 20_000_000  # largest random addition to this time [ns]
_CALL_NS = 150_000  # shortest time of a request or an answer [ns]
_SPREAD_NS = 300_000  # largest random addition to the time of a request or an answer [ns]


@dataclass
class Line:
    """Quality of the line between two processes.

    Attributes:
        loss: Share of messages that are lost.
        delay: Delay of each message in addition to the delay in a machine [s].
        jitter: Mean of the random addition to the delay [s].
        repeats: Share of messages that arrive twice.
        reorders: Share of messages that are overtaken.
    """

    loss: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    repeats: float = 0.0
    reorders: float = 0.0


class Bus:
    """The middleware of all processes.

    Args:
        scheduler: Scheduler with the simulated time.
    """

    def __init__(self, scheduler: Scheduler) -> None:
        self.scheduler = scheduler
        self._random = scheduler.random("bus")
        self._finding: Random = scheduler.random("discovery")
        self.writers: dict[str, list[Writer]] = {}
        self.readers: dict[str, list[Reader]] = {}
        self.services: dict[str, Service] = {}
        self._known: dict[tuple[Process, object], int] = {}
        self._meetings: dict[tuple[Process, Process], int] = {}
        self._born_ns: dict[Process, int] = {}
        self._called_ns: dict[tuple[Process, Process], int] = {}
        self._gids = self._orders = 0
        self.lines: dict[tuple[str, str], Line] = {}
        """Lines that are not perfect, by the names of both processes; * stands for any process."""
        self.seen: dict[str, Callable[[Taken], None]] = {}
        """Observers of the messages of a topic when they are sent, by the full name of the topic."""
        self.heard: dict[str, Callable[[Reader, Taken], None]] = {}
        """Observers of the messages of a topic when readers take them, by the full name of the topic."""
        self.called: dict[str, Callable[[], None]] = {}
        """Observers of the requests to a service when they are sent, by the full name of the service."""
        self.reaches = bool(functions()) and not scheduler.breaks
        """Whether kernels take and publish themselves; Python code does it where threads are interrupted."""
        self._plain = Line()
        self.find = (0.07, 0.3, 1.6)
        """Shortest, usual and longest time in which one process discovers another [s]."""

    # -- who is there ----------------------------------------------------------------------------

    def next_gid(self) -> bytes:
        """Number of a new writer."""
        self._gids += 1
        return self._gids.to_bytes(_GID, "big")

    def next_order(self) -> int:
        """Number of an arriving message, by which messages of the same time are ordered."""
        self._orders += 1
        return self._orders

    def watch(self, process: Process) -> None:
        """Register for the end and the continuation of a process."""
        self._born_ns[process] = self.scheduler.now_ns
        process.on_end.append(lambda is_orderly: self._leave(process, is_orderly=is_orderly))
        process.on_resume.append(lambda since_ns: self._wake_up(process, since_ns))

    def open_writer(self, writer: Writer) -> Writer:
        """Add a writer, which readers then discover."""
        self.writers.setdefault(writer.topic, []).append(writer)
        for reader in self.readers.get(writer.topic, ()):
            self._match(writer, reader)
        return writer

    def open_reader(self, reader: Reader) -> Reader:
        """Add a reader, which writers then discover."""
        self.readers.setdefault(reader.topic, []).append(reader)
        for writer in self.writers.get(reader.topic, ()):
            self._match(writer, reader)
        return reader

    def leave_writer(self, writer: Writer) -> None:
        """Remove a writer."""
        writer.is_open, writer.links = False, []
        if writer in self.writers.get(writer.topic, ()):
            self.writers[writer.topic].remove(writer)

    def leave_reader(self, reader: Reader) -> None:
        """Remove a reader."""
        reader.is_open = False
        if reader in self.readers.get(reader.topic, ()):
            self.readers[reader.topic].remove(reader)
        for writer in self.writers.get(reader.topic, ()):
            writer.links = [link for link in writer.links if link.reader is not reader]
            writer.note_links()

    def found(self, process: Process, ends: Iterable[Writer | Reader]) -> list[Endpoint]:
        """Return those writers or readers that a process has discovered."""
        return [
            Endpoint(one.node, one.sender, one.ros_type, one.qos.is_reliable, one.qos.is_latched)
            for one in ends
            if self.knows(process, one)
        ]

    def knows(self, process: Process, entity: Writer | Reader | Service) -> bool:
        """Whether a process has discovered a writer, reader or service."""
        return self.found_ns(process, entity) <= self.scheduler.now_ns

    def found_ns(self, process: Process, entity: Writer | Reader | Service) -> int:
        """Time at which a process discovers a writer, reader or service of another process [ns].

        Processes first discover each other, which takes long. Then they exchange their topics quickly.
        """
        key = (process, entity)
        if key not in self._known:
            moment = _TOLD_NS + round(_TOLD_SPREAD_NS * self._finding.random())
            since_ns = max(self._met(process, entity.process), entity.born_ns)
            self._known[key] = since_ns + (0 if process is entity.process else moment)
        return self._known[key]

    def _met(self, one: Process, other: Process) -> int:
        """Time at which one process discovers another [ns]."""
        pair = one, other
        if pair not in self._meetings:
            both_ns = max(self._born_ns.get(process, 0) for process in pair)
            least, usual, longest = self.find
            drawn = least + self._finding.expovariate(1.0 / (usual - least))
            took = 0.0 if one is other else min(longest, drawn)
            self._meetings[pair] = both_ns + round(1e9 * took)
        return self._meetings[pair]

    def topics(self) -> list[str]:
        """Topics that have writers or readers."""
        names = {*(t for t, w in self.writers.items() if w), *(t for t, r in self.readers.items() if r)}
        return sorted(names)

    def _match(self, writer: Writer, reader: Reader) -> None:
        """Connect a writer and a reader, if their types and QoS are compatible."""
        wanted, offered = reader.qos, writer.qos
        if writer.ros_type != reader.ros_type:
            return
        if wanted.is_reliable and not offered.is_reliable:
            return
        if wanted.is_latched and not offered.is_latched:
            return
        link = Match(
            reader,
            self.found_ns(writer.process, reader),
            self.found_ns(reader.process, writer),
            wanted.is_reliable and offered.is_reliable,
        )
        writer.links.append(link)
        writer.note_links()
        if wanted.is_latched:
            link.awaits_last = True
            self.scheduler.at(link.writer_knows_ns, lambda: self._send_last(writer, link))

    def _send_last(self, writer: Writer, link: Match) -> None:
        """Send the stored messages of a latched topic to a late reader."""
        link.awaits_last = False
        if writer.is_open and not writer.process.is_dead:
            for taken in tuple(writer.history):
                self.carry(writer, link, taken)

    # -- messages --------------------------------------------------------------------------------

    def line(self, one: Process, other: Process) -> Line:
        """Quality of the line between two processes."""
        if not self.lines or one is other:
            return self._plain
        for key in ((one.name, other.name), (one.name, "*"), ("*", other.name), ("*", "*")):
            if key in self.lines:
                return self.lines[key]
        return self._plain

    def carry(self, writer: Writer, link: Match, taken: Taken) -> None:
        """Deliver a message to a reader."""
        reader, draw = link.reader, self._random.random
        line = self.line(writer.process, reader.process) if self.lines else self._plain
        now_ns = self.scheduler.now_ns
        came_ns = now_ns + 40_000 + round(60_000 * draw())
        if line is not self._plain:
            came_ns += round(1e9 * line.delay)
            if line.jitter:
                came_ns += round(1e9 * self._random.expovariate(1.0 / line.jitter))
            if line.loss and draw() < line.loss:
                if not link.is_reliable:
                    reader.lost += 1
                    return
                came_ns += round(2e6 + 2e7 * draw())
        if came_ns < link.reader_knows_ns:
            if not link.is_reliable:
                return
            came_ns = link.reader_knows_ns
        if not (line.reorders and not link.is_reliable and draw() < line.reorders):
            came_ns = max(came_ns, link.last_ns + 1)
        link.last_ns = max(came_ns, link.last_ns)
        reader.put(came_ns, taken)
        if line.repeats and not link.is_reliable and draw() < line.repeats:
            reader.put(came_ns + 50_000, taken)

    def send_again(self, reader: Reader, taken: Taken) -> bool:
        """Whether a message that a reader's socket lost still arrives, because the writer sends it again."""
        for writer in self.writers.get(reader.topic, ()):
            if writer.sender != taken.sender:
                continue
            for link in writer.links:
                if link.reader is reader and link.is_reliable and taken in writer.history:
                    reader.put(max(self.scheduler.now_ns + 3_000_000, link.last_ns + 1), taken)
                    return True
        return False

    def _wake_up(self, process: Process, since_ns: int) -> None:
        room = _SOCKET
        for readers in tuple(self.readers.values()):
            for reader in tuple(readers):
                if reader.process is process:
                    room = reader.wake_up(since_ns, room)

    def _leave(self, process: Process, *, is_orderly: bool) -> None:
        """Remove the writers and readers of a process that has ended; other processes notice the end later."""
        for reader in [r for rs in self.readers.values() for r in rs if r.process is process]:
            self.leave_reader(reader)
        writers = [w for ws in self.writers.values() for w in ws if w.process is process]
        services = [name for name, s in self.services.items() if s.process is process]

        def forget() -> None:
            for writer in writers:
                self.leave_writer(writer)

        for name in services:
            self.services.pop(name).is_open = False
        self.scheduler.at(self.scheduler.now_ns + (1_000_000 if is_orderly else _LEASE_NS), forget)

    def call(self, one: Process, other: Process, event: Callable[[], object]) -> None:
        """Run an event after the time of a request or an answer; events keep their order."""
        due_ns = self.scheduler.now_ns + _CALL_NS + round(_SPREAD_NS * self._random.random())
        due_ns = max(due_ns, self._called_ns.get((one, other), 0) + 1)
        self._called_ns[one, other] = due_ns
        self.scheduler.at(due_ns, event)
