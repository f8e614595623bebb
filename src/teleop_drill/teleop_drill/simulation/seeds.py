"""Seeds: runs random schedules, checks the laws in each, and finds the shortest schedule that breaks a law."""

import os
import shutil
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import NamedTuple

from teleop_core.base.workers import apart, workers
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.graph.operation import State
from teleop_core.nodes.crews import Processes
from teleop_core.nodes.start import SESSION
from teleop_core.session import api
from teleop_core.session.configuration import Configuration
from teleop_drill.drill import hand
from teleop_drill.drill.numbers import Numbers
from teleop_drill.simulation import sometimes
from teleop_drill.simulation.branches import Branches
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.drilled_session import DrilledSession
from teleop_drill.simulation.laws import Broken, Laws
from teleop_drill.simulation.machine import Machine, Process
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.reach import BEGIN_NS
from teleop_drill.simulation.scheduler import Scheduler
from teleop_drill.simulation.schedules import KINDS, Fault, draw
from teleop_drill.simulation.visits import PLAIN, SESSIONS, Visitor

PROCESSES = {Processes.SIDES: ("hand_side", "slave_side", RECORDER_NAME), Processes.ONE: (SESSION, RECORDER_NAME)}
"""Processes that a schedule may affect, by the distribution of the nodes."""
_START = 20.0  # time limit until the arm follows after the start [s]
_CURED = 15.0  # time limit until the arm follows after the end of all faults [s]
_CIRCLE = (
    "operator.kind=circle",
    f"operator.size=[{2 * hand.RADIUS}, 0.0, {2 * hand.RADIUS}]",
    f"operator.period={hand.ROUND}",
    "operator.approach_time=1.0",
    "operator.patience=0.0",
    "operator.rotation=0.0",
    "slave.operation.tool_speed=0.5",
    "slave.start_speed=1.0",
)
_HINDER = (
    "standstill", "slow turns", "crowd", "hiccups", "loss", "delay", "disorder",
    "slow disk", "full disk", "read-only disk", "gone disk",
)  # fmt: skip
"""Faults under which a killed recorder may lose more than the last messages."""
_ROUND = 20  # schedules that are chosen together
STARTS = 4
"""Number of ways in which sessions start."""


@dataclass
class Found:
    """Result of one schedule.

    Attributes:
        seed: Seed of all random numbers.
        faults: The faults that were injected.
        processes: Distribution of the nodes over processes.
        breaks: Share of the clock readings after which another thread of the process runs.
        depth: As in :class:`~teleop_drill.simulation.scheduler.Scheduler`.
        session: Name of the kind of session, as in :data:`~teleop_drill.simulation.visits.SESSIONS`.
        broken: Breaches of laws.
        met: Number of times that each fault happened in each state of the arm.
        looks: Number of checks of each law.
        under: Number of checks of each law by present fault and state of the arm.
        sometimes: Number of times that each event of :mod:`sometimes` was met.
        pairs: Number of times that a fault began during another one in a state: the other one, the fault, the state.
        seconds: Simulated time [s].
    """

    seed: int
    faults: tuple[Fault, ...]
    processes: Processes = Processes.SIDES
    breaks: float = 0.0
    depth: int = 0
    session: str = PLAIN
    broken: tuple[Broken, ...] = ()
    met: Counter[tuple[str, str]] = field(default_factory=Counter)
    looks: Counter[str] = field(default_factory=Counter)
    under: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    sometimes: Counter[str] = field(default_factory=Counter)
    pairs: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    seconds: float = 0.0


def run_seed(
    seed: int,
    faults: Sequence[Fault] | None = None,
    folder: Path | None = None,
    processes: Processes = Processes.SIDES,
    breaks: float = 0.0,
    depth: int = 0,
    session: str = PLAIN,
) -> Found:
    """Run one schedule.

    A session starts in one of :data:`STARTS` ways, which the seed chooses. Then the seed itself gives all random
    numbers. So schedules can share a start, see :class:`Starts`.

    Args:
        seed: Seed of the machine, and of the schedule if no faults are given.
        faults: Faults of the schedule; None to draw them.
        folder: Folder of the recording; None for no recording.
        processes: Distribution of the nodes over processes: by side, or all nodes except the recorder in one process.
        breaks: Share of the clock readings after which another thread of the process runs.
        depth: As in :class:`~teleop_drill.simulation.scheduler.Scheduler`.
        session: As in :class:`Found`.
    """
    planned = draw(seed, PROCESSES[processes]) if faults is None else tuple(faults)
    with _inside(folder):
        return _Run(_Start.of(seed, processes, breaks, session)).run(seed, planned, depth)


class _Start(NamedTuple):
    """All that the start of a session depends on."""

    number: int
    processes: Processes
    breaks: float
    session: str

    @classmethod
    def of(cls, seed: int, processes: Processes, breaks: float, session: str) -> "_Start":
        """Start of a schedule; sessions of rare kinds have one start, because each that waits takes memory."""
        is_frequent = session == PLAIN and not breaks
        return cls(seed % STARTS if is_frequent else 0, processes, breaks, session)


@contextmanager
def _inside(folder: Path | None = None) -> Iterator[Path]:
    """Work in a folder, or in one of its own that is removed: names of recordings are the same wherever they lie."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="drill_") as own:
        place = Path(own) if folder is None else folder.absolute()
        place.mkdir(parents=True, exist_ok=True)
        os.chdir(place)
        try:
            yield place
        finally:
            os.chdir(before)


class Starts:
    """Sessions that have started and wait for schedules; each schedule goes on in a copy of this process (``fork``).

    A schedule has the same result as by :func:`run_seed`.

    Args:
        branches: Counts the branches of the code; None to count none.
    """

    def __init__(self, branches: Branches | None = None) -> None:
        self._branches = branches
        self._waiting: dict[_Start, tuple[_Run, Path, list[str]]] = {}
        self._ends = ExitStack()

    def run(
        self, seed: int, faults: Sequence[Fault] | None, processes: Processes = Processes.SIDES,
        breaks: float = 0.0, depth: int = 0, session: str = PLAIN,
    ) -> tuple[Found, list[str]]:  # fmt: skip
        """Run one schedule, see :func:`run_seed`; returns its result and the branches that ran."""
        planned = draw(seed, PROCESSES[processes]) if faults is None else tuple(faults)
        key = _Start.of(seed, processes, breaks, session)
        if key not in self._waiting:
            place = Path(self._ends.enter_context(tempfile.TemporaryDirectory(prefix="drill_"))).resolve()
            self._begin()
            with _inside(place):
                self._waiting[key] = _Run(key), place, self._ran()
        return apart(partial(self._go_on, key, seed, planned, depth))

    def _go_on(self, key: _Start, seed: int, faults: Sequence[Fault], depth: int) -> tuple[Found, list[str]]:
        """Run a schedule in a copy of the process that started the session, with copies of its files."""
        run, place, ran = self._waiting[key]
        self._begin()
        with _inside() as own:
            shutil.copytree(place, own, dirs_exist_ok=True)
            for number in map(int, os.listdir("/proc/self/fd")):
                with suppress(OSError):  # the descriptor of the list itself is closed again
                    file = Path(os.readlink(f"/proc/self/fd/{number}"))
                    if file.is_relative_to(place):
                        _reopen(number, own / file.relative_to(place))
            found = run.run(seed, faults, depth)
        return found, sorted({*ran, *self._ran()})

    def close(self) -> None:
        """Remove the files of the waiting sessions."""
        self._waiting.clear()
        self._ends.close()

    def _begin(self) -> None:
        if self._branches is not None:
            self._branches.begin()

    def _ran(self) -> list[str]:
        return [] if self._branches is None else self._branches.ran()


def _reopen(number: int, file: Path) -> None:
    """Let a file descriptor refer to another file at the same position."""
    other = os.open(file, os.O_RDWR)
    os.lseek(other, os.lseek(number, 0, os.SEEK_CUR), os.SEEK_SET)
    os.dup2(other, number)
    os.close(other)


class _Run:
    """A session that has started, and the schedule that it runs then."""

    def __init__(self, start: _Start) -> None:
        kind = SESSIONS[start.session]
        texts = (*(_CIRCLE if kind.has_circle else ()), "real_time.priority=20", *kind.texts)
        made = api.configuration(kind.scenario, texts=texts)
        numbers = Numbers.of(made)
        machine = Machine(Scheduler(start.number, start.breaks))
        self._scheduler, self._bus = machine.scheduler, Bus(machine.scheduler)
        owner = machine.outsider("drill")
        self._bus.watch(owner)
        self._start, self._found = start, Found(start.number, ())
        self._stage = DrilledSession(self._bus, owner, made, numbers.robot, Path(), start.processes)
        self._laws = Laws(self._stage, numbers)
        self._ends: list[Callable[[], None]] = []
        self._error: Exception | None = None
        self._visitor: Visitor | None = None
        try:
            if kind.is_visited:
                self._stage.is_alone = False
                self._visit(made)
            self._stage.session.start()
            self._laws.judge_recovery(self._await(_START), _START)
        except Exception as error:
            self._error = error

    def run(self, seed: int, faults: Sequence[Fault], depth: int) -> Found:
        """Run a schedule; an error in it breaks the law ``runs``, because it must not end all other schedules."""
        _, processes, breaks, session = self._start
        self._found = Found(seed, tuple(faults), processes, breaks, depth, session)
        try:
            if self._error is not None:
                raise self._error
            self._scheduler.seed_again(seed, depth)
            self._judge()
        except Exception as error:
            at = 1e-9 * (self._scheduler.now_ns - BEGIN_NS)
            text = "".join(traceback.format_exception(error)[-2:])
            broken = (Broken("runs", at, text),)
            return Found(seed, tuple(faults), processes, breaks, depth, session, broken, seconds=at)
        return self._found

    def _judge(self) -> None:
        self._laws.begin_ns = self._scheduler.now_ns
        if self._visitor is not None:
            self._visitor.may_act = True
        for fault in self._found.faults:
            at_ns = self._laws.begin_ns + round(1e9 * fault.at)
            self._scheduler.at(at_ns, partial(self._begin, fault))
        last = max((fault.at + fault.seconds for fault in self._found.faults), default=0.0)
        self._wait(last + 0.5)
        if self._visitor is not None:
            self._visitor.may_act = False
        for end in self._ends:
            end()
        self._stage.command(sometimes.RELEASE)
        recovery = self._await(_CURED)
        self._laws.judge_recovery(recovery, _CURED)
        if recovery is not None:
            self._stage.sometimes.update({sometimes.recovered(fault.kind) for fault in self._found.faults})
        self._found.seconds = 1e-9 * (self._scheduler.now_ns - BEGIN_NS)
        for process in self._stage.session.running.values():
            self._stage.killed.add(process)  # from now on the processes are ordered to end
        (first, *more), was_killed = self._stage.session.recordings, self._was("kill", "recorder")
        ends = ((p, ns) for p, ns in self._stage.killed_ns.items() if p.name == RECORDER_NAME)
        _, killed_ns = next(ends, (None, None))
        recorder = None if more else self._stage.session.node(RECORDER_NAME)
        self._stage.sometimes[sometimes.SEVERAL_BAGS] += bool(more)
        readers = (reader for several in self._bus.readers.values() for reader in several)
        self._stage.sometimes[sometimes.LOST] += any(reader.lost for reader in readers)
        outlives = self._stage.lost_disk - self._laws.lost_recorders
        self._stage.sometimes[sometimes.DISK_STAYS] += any(not one.is_dead for one in outlives)
        self._stage.session.close()
        with self._laws.reading():
            if self._visitor or self._was("clock step") or self._was("clock drift"):
                pass  # the times of a recording are those of the clock, and a visitor ends and splits recordings
            elif not was_killed:
                self._laws.judge_recording(first, {} if recorder is None else recorder.values())
            elif killed_ns is not None and not any(map(self._was, _HINDER)):
                self._laws.judge_killed(first, killed_ns)
        self._laws.finish()
        self._found.broken = tuple(self._laws.broken.values())
        self._found.looks.update(self._laws.looks)
        self._found.under.update(self._laws.under)
        self._found.sometimes.update(self._stage.sometimes)

    def _visit(self, made: Configuration) -> None:
        """Start the program that uses the session."""

        def work(process: Process) -> int:
            self._visitor = Visitor(SimulatedPlatform(self._bus, process), made)
            return self._visitor.run()

        self._bus.watch(self._stage.machine.start("visitor", work))

    def _begin(self, fault: Fault) -> None:
        state, seen = self._stage.state, self._stage.sometimes
        self._found.met[fault.kind, state] += 1
        seen[sometimes.met(fault.kind, state)] += 1
        seen[sometimes.together(fault.kind)] += bool(self._laws.in_force)
        self._found.pairs.update((other, fault.kind, state) for other in self._laws.in_force)
        process = self._stage.session.running.get(fault.where)
        if process is not None and process.is_dead:
            return
        end = KINDS[fault.kind](self._stage, fault)
        self._laws.in_force.append(fault.kind)
        end_ns = self._scheduler.now_ns + round(1e9 * fault.seconds)
        self._scheduler.at(end_ns, partial(self._laws.in_force.remove, fault.kind))
        if end is not None:
            self._ends.append(end)
            self._scheduler.at(end_ns, end)

    def _was(self, kind: str, where: str = "") -> bool:
        """Whether a fault of a kind was planned, for a process."""
        return any(one.kind == kind and one.where in {where, ""} for one in self._found.faults)

    def _wait(self, seconds: float) -> None:
        self._scheduler.sleep(seconds)

    def _await(self, patience: float) -> float | None:
        """Wait until the arm follows, and send the commands that it needs; returns the waiting time [s]."""
        begin_ns = self._scheduler.now_ns
        steady = 0
        while (elapsed := 1e-9 * (self._scheduler.now_ns - begin_ns)) < patience:
            steady = steady + 1 if self._stage.follows() else 0
            if steady >= 4:
                return elapsed
            if not steady:
                self._stage.help()
            self._wait(0.1)
        return None


def shrink(found: Found, law: str) -> Found:
    """Part of the faults of a schedule that still breaks a law, and needs each of its faults.

    First halves are left out, then quarters, and at last single faults, until none can be left out.
    """
    best, size = found, len(found.faults)
    while size > 0:
        for begin in range(0, len(best.faults), size):
            fewer = best.faults[:begin] + best.faults[begin + size :]
            again = run_seed(found.seed, fewer, None, found.processes, found.breaks, found.depth, found.session)
            if any(one.law == law for one in again.broken):
                best, size = again, min(size, len(again.faults))
                break
        else:
            size //= 2
    return best


def run_seeds(
    first: int, count: int, cores: int | None = None, processes: Processes = Processes.SIDES, breaks: float = 0.0
) -> Iterator[Found]:
    """Run schedules on all cores; of every three seeds, the one with the rarest combination of fault and state is run.

    The choice is made after every :data:`_ROUND` schedules, so that the same call runs the same seeds.

    Args:
        first: Seed of the first schedule, which is always run.
        count: Number of schedules to run.
        cores: Number of processes; None: one for each core.
        processes: Distribution of the nodes over processes.
        breaks: As in :func:`run_seed`.
    """
    cores = cores or len(os.sched_getaffinity(0))
    met: Counter[tuple[str, str]] = Counter()
    with workers(min(cores, count), warm) as pool:
        for begin in range(0, count, _ROUND):
            threes = (range(first + 3 * k, first + 3 * k + 3) for k in range(begin, min(begin + _ROUND, count)))
            seeds = [rarest(three, met, processes) for three in threes]
            for found in pool.map(partial(_run_apart, processes, breaks), seeds):
                met.update(found.met)
                yield found


_starts = Starts()


def warm() -> None:
    """Load and compile whatever schedules need, so that copies of this process have it."""
    for processes in PROCESSES:
        run_seed(0, (), processes=processes)


def _run_apart(processes: Processes, breaks: float, seed: int) -> Found:
    return _starts.run(seed, None, processes, breaks)[0]


def rarest(seeds: Sequence[int], met: Counter[tuple[str, str]], processes: Processes) -> int:
    """The seed whose faults have met their rarest states least often so far."""
    return min(seeds, key=lambda seed: _known(seed, met, processes))


def _known(seed: int, met: Counter[tuple[str, str]], processes: Processes) -> float:
    """Mean over the faults of a schedule: the number of times that the fault met its rarest state."""
    states = [state.name for state in State]
    rarest = [min(met[one.kind, s] for s in states) for one in draw(seed, PROCESSES[processes])]
    return sum(rarest) / len(rarest)
