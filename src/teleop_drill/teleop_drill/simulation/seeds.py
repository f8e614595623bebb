"""Seeds: runs random schedules, checks the laws in each, and finds the shortest schedule that breaks a law."""

import os
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

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
_ROUND = 20  # schedules that are chosen together


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
    with tempfile.TemporaryDirectory(prefix="drill_") as place:
        machine = Machine(Scheduler(seed, breaks, depth))
        bus = Bus(machine.scheduler)
        begun = Found(seed, planned, processes, breaks, depth, session)
        try:
            found: Found = machine.run(lambda owner: _Run(bus, owner, begun, folder or Path(place)).run())
        except Exception as error:  # an error in one schedule must not end all others
            at = 1e-9 * (machine.scheduler.now_ns - BEGIN_NS)
            text = "".join(traceback.format_exception(error)[-2:])
            found = Found(seed, planned, processes, breaks, depth, session, (Broken("runs", at, text),), seconds=at)
    return found


class _Run:
    """One running schedule."""

    def __init__(self, bus: Bus, owner: Process, found: Found, folder: Path) -> None:
        bus.watch(owner)
        self._bus = bus
        kind = SESSIONS[found.session]
        texts = (*(_CIRCLE if kind.has_circle else ()), "real_time.priority=20", *kind.texts)
        made = api.configuration(kind.scenario, texts=texts)
        numbers = Numbers.of(made)
        self._found, self._scheduler = found, owner.machine.scheduler
        self._stage = DrilledSession(bus, owner, made, numbers.robot, folder, found.processes)
        self._laws = Laws(self._stage, numbers)
        self._ends: list[Callable[[], None]] = []
        self._visitor: Visitor | None = None
        if kind.is_visited:
            self._visit(made)

    def run(self) -> Found:
        """Run the schedule."""
        begin_ns = self._scheduler.now_ns
        self._stage.session.start()
        self._laws.judge_recovery(self._await(_START), _START)
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
        self._found.seconds = 1e-9 * (self._scheduler.now_ns - begin_ns)
        for process in self._stage.session.running.values():
            self._stage.killed.add(process)  # from now on the processes are ordered to end
        (first, *more), was_killed = self._stage.session.recordings, self._was("kill", "recorder")
        recorder = None if more else self._stage.session.node(RECORDER_NAME)
        self._stage.sometimes[sometimes.SEVERAL_BAGS] += bool(more)
        readers = (reader for several in self._bus.readers.values() for reader in several)
        self._stage.sometimes[sometimes.LOST] += any(reader.lost for reader in readers)
        outlives = self._stage.lost_disk - self._laws.lost_recorders
        self._stage.sometimes[sometimes.DISK_STAYS] += any(not one.is_dead for one in outlives)
        self._stage.session.close()
        if not (was_killed or self._visitor or self._was("clock step") or self._was("clock drift")):
            self._laws.judge_recording(first, {} if recorder is None else recorder.values())
        self._found.broken = tuple(self._laws.broken.values())
        self._found.looks.update(self._laws.looks)
        self._found.under.update(self._laws.under)
        self._found.sometimes.update(self._stage.sometimes)
        return self._found

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


def warm() -> None:
    """Load and compile whatever schedules need, so that copies of this process have it."""
    for processes in PROCESSES:
        run_seed(0, (), processes=processes)


def _run_apart(processes: Processes, breaks: float, seed: int) -> Found:
    return apart(partial(run_seed, seed, processes=processes, breaks=breaks))


def rarest(seeds: Sequence[int], met: Counter[tuple[str, str]], processes: Processes) -> int:
    """The seed whose faults have met their rarest states least often so far."""
    return min(seeds, key=lambda seed: _known(seed, met, processes))


def _known(seed: int, met: Counter[tuple[str, str]], processes: Processes) -> float:
    """Mean over the faults of a schedule: the number of times that the fault met its rarest state."""
    states = [state.name for state in State]
    rarest = [min(met[one.kind, s] for s in states) for one in draw(seed, PROCESSES[processes])]
    return sum(rarest) / len(rarest)
