"""Bus: topics and services between simulated processes, as ROS 2 on Fast DDS carries them.

The model: both sides of a topic discover each other at different times. Earlier messages reach only readers that ask
for the last messages of a latched topic. A full queue loses its oldest message. A full socket loses arriving messages,
and reliable writers send them again as long as they still have them. Each writer numbers its messages.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from random import Random

from teleop_core.middleware.world import Endpoint, Taken
from teleop_drill.simulation.ends import Match, Reader, Service, Writer
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.scheduler import Scheduler

_SOCKET = 4 << 20
"""Bytes that can wait for a process that does not run, as in the middleware's profile."""
_LEASE_NS = 20_000_000_000
"""Time after which a process that was killed counts as gone [ns]."""
_GID = 16
_TOLD_NS, _TOLD_SPREAD_NS = 1_000_000, 20_000_000
"""Least time in which a known process announces a new topic, and the largest random addition [ns]."""
_CALL_NS, _SPREAD_NS = 150_000, 300_000
"""Least time of a request or an answer, and the largest random addition [ns]."""


@dataclass
class Line:
    """Quality of the line between two processes.

    Attributes:
        loss: Share of messages that are lost.
        delay: Time that each message takes in addition to that of this machine [s].
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
        scheduler: Time.
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
        """Lines that are not perfect, by the names of both processes; * for any."""
        self.seen: dict[str, Callable[[Taken], None]] = {}
        """Observers of the messages of a topic when they are sent, by the full name of the topic."""
        self.heard: dict[str, Callable[[Reader, Taken], None]] = {}
        """Observers of the messages when they are taken."""
        self._plain = Line()
        self.find = (0.07, 0.3, 1.6)
        """Least, usual and longest time in which one end finds another [s]."""

    # -- who is there ----------------------------------------------------------------------------

    def next_gid(self) -> bytes:
        """Number of a new writer."""
        self._gids += 1
        return self._gids.to_bytes(_GID, "big")

    def next_order(self) -> int:
        """Number of a message that comes, which orders those of one moment."""
        self._orders += 1
        return self._orders

    def watch(self, process: Process) -> None:
        """Take part in the life of a process."""
        self._born_ns[process] = self.scheduler.now_ns
        process.on_end.append(lambda is_orderly: self._leave(process, is_orderly=is_orderly))
        process.on_resume.append(lambda since_ns: self._wake_up(process, since_ns))

    def open_writer(self, writer: Writer) -> Writer:
        """Let others find a writer."""
        self.writers.setdefault(writer.topic, []).append(writer)
        for reader in self.readers.get(writer.topic, ()):
            self._match(writer, reader)
        return writer

    def open_reader(self, reader: Reader) -> Reader:
        """Let others find a reader."""
        self.readers.setdefault(reader.topic, []).append(reader)
        for writer in self.writers.get(reader.topic, ()):
            self._match(writer, reader)
        return reader

    def leave_writer(self, writer: Writer) -> None:
        """Withdraw a writer."""
        writer.is_open, writer.links = False, []
        if writer in self.writers.get(writer.topic, ()):
            self.writers[writer.topic].remove(writer)

    def leave_reader(self, reader: Reader) -> None:
        """Withdraw a reader."""
        reader.is_open = False
        if reader in self.readers.get(reader.topic, ()):
            self.readers[reader.topic].remove(reader)
        for writer in self.writers.get(reader.topic, ()):
            writer.links = [link for link in writer.links if link.reader is not reader]

    def found(self, process: Process, ends: Iterable[Writer | Reader]) -> list[Endpoint]:
        """Ends of a topic that a process has found."""
        return [
            Endpoint(one.node, one.sender, one.ros_type, one.qos.is_reliable, one.qos.is_latched)
            for one in ends
            if self.knows(process, one)
        ]

    def knows(self, process: Process, entity: Writer | Reader | Service) -> bool:
        """Whether a process has found an entity."""
        return self.found_ns(process, entity) <= self.scheduler.now_ns

    def found_ns(self, process: Process, entity: Writer | Reader | Service) -> int:
        """Time at which a process discovers an entity of another process [ns].

        Processes first discover each other, which takes long; then they exchange their topics quickly.
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
        """Let a writer and a reader find each other, if their types and qualities go together."""
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
        if wanted.is_latched:
            link.awaits_last = True
            self.scheduler.at(link.writer_knows_ns, lambda: self._send_last(writer, link))

    def _send_last(self, writer: Writer, link: Match) -> None:
        """Send a late reader what a latched topic has."""
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
        """Bring a message to a reader."""
        reader, draw = link.reader, self._random.random
        line = self.line(writer.process, reader.process)
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
        """Whether a message that a reader's socket lost still arrives, because its writer sends it again."""
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
        """Remove the writers and readers of a process that has ended; other processes notice its end later."""
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
        """Let something happen after the time that a request or an answer takes, in their order."""
        due_ns = self.scheduler.now_ns + _CALL_NS + round(_SPREAD_NS * self._random.random())
        due_ns = max(due_ns, self._called_ns.get((one, other), 0) + 1)
        self._called_ns[one, other] = due_ns
        self.scheduler.at(due_ns, event)
