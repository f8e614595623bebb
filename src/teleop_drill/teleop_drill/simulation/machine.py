"""Machine: simulated processes, their faults, and the sockets between them."""

import traceback
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from teleop_core.kernels.fields import record
from teleop_drill.simulation.reach import BEGIN_NS, EPOCH_NS, Context
from teleop_drill.simulation.scheduler import Scheduler, Turns

_ROOM = 212_992
"""Size of the buffer of a socket between processes [bytes], as in Linux."""


class Clock:
    """The system's clock of a machine.

    Args:
        offset_ns: Error of the clock [ns].
        drift: Relative error of the clock's rate.
    """

    def __init__(self, offset_ns: int = 0, drift: float = 0.0) -> None:
        self._offset_ns, self._drift = offset_ns, drift
        self.users: list[Any] = []
        """Records of :class:`~teleop_drill.simulation.reach.Context` of processes that have this clock."""

    @property
    def offset_ns(self) -> int:
        """Error of the clock [ns]; can be set."""
        return self._offset_ns

    @offset_ns.setter
    def offset_ns(self, value: int) -> None:
        self._offset_ns = value
        self.tell()

    @property
    def drift(self) -> float:
        """Relative error of the clock's rate; can be set."""
        return self._drift

    @drift.setter
    def drift(self, value: float) -> None:
        self._drift = value
        self.tell()

    def tell(self) -> None:
        """Write the errors into the records of its users."""
        for one in self.users:
            one["offset_ns"], one["drift"] = self._offset_ns, self._drift

    def ahead_ns(self, now_ns: int) -> int:
        """How far this machine's clock is ahead of the given monotonic time [ns]."""
        ahead_ns = EPOCH_NS + self._offset_ns
        return ahead_ns + round(self._drift * (now_ns - BEGIN_NS)) if self._drift else ahead_ns


@dataclass
class Said:
    """Line of a log."""

    time_ns: int
    node: str
    level: str
    text: str


class Process(Turns):
    """Process of a machine.

    Args:
        machine: Machine of the process.
        name: Name of the process.
        work: Function of the main thread; its return value is the exit code.

    Attributes:
        exit_code: Exit code; None while the process runs, negative if a signal ended it.
    """

    def __init__(self, machine: "Machine", name: str, work: Callable[[], int]) -> None:
        super().__init__()
        self.machine, self.name, self._work = machine, name, work
        self.exit_code: int | None = None
        self.stopped_ns = 0
        self.context: Any = record(Context)
        """Clocks of the process for kernels."""
        self.context["now_at"] = machine.scheduler.now_at
        self.clock = machine.clock
        self.use_clock(machine.clock)
        self.room: int | None = None
        """Number of bytes that the process may still write; None for no limit."""
        self.disk_delay = 0.0
        """Time that each write of the process waits for the disk [s]."""
        self.disk_error = 0
        """Number of the error with which writes of the process fail; 0 for no error."""
        self.due: list[deque[Callable[[], object]]] = []
        """Requests that wait for each executor of the process."""
        self.lines: list[SocketEnd] = []
        self.listeners: list[Listener] = []
        self.on_end: list[Callable[[bool], None]] = []
        """Functions that are called when the process ends; the argument is whether it ended in order."""
        self.on_resume: list[Callable[[int], None]] = []
        """Functions that are called when the process continues; the argument is the time at which it was stopped [ns].
        """
        self.main = machine.scheduler.spawn(self, "main", self._run)

    def use_clock(self, clock: Clock) -> None:
        """Read the system's time from a clock from now on."""
        former, self.clock = self.clock, clock
        former.users = [one for one in former.users if one is not self.context]
        clock.users.append(self.context)
        clock.tell()

    def start(self) -> None:
        """Start the process."""
        self.main.start()

    def stop(self) -> None:
        """Stop the process as SIGSTOP does; it does not run until :meth:`go_on`."""
        if not self.is_stopped:
            self.is_stopped, self.stopped_ns = True, self.machine.scheduler.now_ns

    def go_on(self) -> None:
        """Continue the process as SIGCONT does."""
        if self.is_stopped and not self.is_dead:
            for told in self.on_resume:
                told(self.stopped_ns)
            self.machine.scheduler.resume(self)

    def end(self, exit_code: int, *, is_orderly: bool) -> None:
        """End the process with all its threads."""
        if self.is_dead:
            return
        self.is_dead, self.exit_code = True, exit_code
        for line in self.lines:
            line.close()
        for listener in self.listeners:
            listener.close()
        for told in self.on_end:
            told(is_orderly)

    def _run(self) -> None:
        code = 1
        try:
            code = self._work()
        except BaseException as error:
            self.main.error = error
            self.machine.fail(self, error)
        self.end(code, is_orderly=True)


class Listener:
    """Simulated form of :class:`~teleop_core.middleware.platform.Listener`."""

    def __init__(self, machine: "Machine", place: str) -> None:
        self._machine, self._place = machine, place
        self.waiting: list[SocketEnd] = []

    def accept(self) -> "SocketEnd | None":
        """Return the next connection; None if none waits."""
        return self.waiting.pop(0) if self.waiting else None

    def close(self) -> None:
        """Stop accepting connections."""
        self._machine.places.pop(self._place, None)


class SocketEnd:
    """Simulated form of :class:`~teleop_core.middleware.platform.Line`."""

    def __init__(self) -> None:
        self.came = bytearray()
        self.other: SocketEnd | None = None
        self.is_open = True

    def send(self, data: bytes | bytearray | memoryview) -> int:
        """Write as many bytes as the buffer accepts; raises BlockingIOError or OSError."""
        other = self.other
        if not self.is_open or other is None or not other.is_open:
            raise BrokenPipeError
        taken = min(len(data), _ROOM - len(other.came))
        if taken <= 0:
            raise BlockingIOError
        other.came += data[:taken]
        return taken

    def recv(self, size: int) -> bytes:
        """Read the bytes that have arrived; raises BlockingIOError if there are none."""
        if not self.came:
            if self.other is None or not self.other.is_open:
                return b""
            raise BlockingIOError
        data = bytes(self.came[:size])
        del self.came[:size]
        return data

    def close(self) -> None:
        """Close the socket."""
        self.is_open = False


@dataclass
class Machine:
    """One simulated computer.

    Attributes:
        scheduler: Simulated time of the machine.
        clock: System clock, for all processes without their own clock.
        processes: All processes that were started, in the order of their start.
        places: Listeners by address.
        log: Log lines of the nodes.
    """

    scheduler: Scheduler
    clock: Clock = field(default_factory=Clock)
    processes: list[Process] = field(default_factory=list)
    places: dict[str, Listener] = field(default_factory=dict)
    log: list[Said] = field(default_factory=list)

    def start(self, name: str, work: Callable[[Process], int], after: float = 0.0) -> Process:
        """Start a process, whose main thread begins after a time [s]."""
        box: list[Process] = []

        def main() -> int:
            if after:
                self.scheduler.sleep(after)
            return work(box[0])

        box.append(Process(self, name, main))
        self.processes.append(box[0])
        box[0].start()
        return box[0]

    def run(self, work: Callable[[Process], Any]) -> Any:
        """Run a function in its own process, and run the simulation until the function returns."""
        found: list[Any] = []

        def main() -> int:
            found.append(work(process))
            return 0

        process = Process(self, "drill", main)
        self.processes.append(process)
        self.scheduler.run(process.main)
        return found[0]

    def outsider(self, name: str) -> Process:
        """Process for a caller outside of the simulation that advances the simulated time, such as a test."""
        process = Process(self, name, lambda: 0)
        self.processes.append(process)
        return process

    def fail(self, process: Process, error: BaseException) -> None:
        """Store the unexpected error that has ended a process."""
        text = "".join(traceback.format_exception(error))
        self.log.append(Said(self.scheduler.now_ns, process.name, "fatal", text))

    def connect(self, process: Process, place: str) -> SocketEnd:
        """Connect to the listener at an address; raises ConnectionRefusedError if there is none."""
        listener = self.places.get(place)
        if listener is None:
            raise ConnectionRefusedError(place)
        near, far = SocketEnd(), SocketEnd()
        near.other, far.other = far, near
        process.lines.append(near)
        listener.waiting.append(far)
        return near

    def listen(self, process: Process, place: str) -> Listener:
        """Listen at an address; raises OSError if another process already listens at this address."""
        if place in self.places:
            raise OSError(place)
        self.places[place] = listener = Listener(self, place)
        process.listeners.append(listener)
        return listener
