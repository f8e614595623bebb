"""Search: draws schedules where earlier ones have met least, and breeds others from those that met something first."""

import os
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from random import Random
from threading import Lock
from typing import TYPE_CHECKING, Any

from teleop_core.base.cluster import TRIES, check_code, check_codes
from teleop_core.base.errors import SessionError
from teleop_core.base.workers import workers
from teleop_core.graph.operation import State
from teleop_core.nodes.crews import Processes
from teleop_core.slave.operation.states import COMMANDS
from teleop_drill.simulation import sometimes
from teleop_drill.simulation.branches import Branches
from teleop_drill.simulation.planned import Schedule
from teleop_drill.simulation.schedules import BEGIN, KINDS, OF_PROCESS, Fault, commanded
from teleop_drill.simulation.seeds import PROCESSES, Found, Starts, warm
from teleop_drill.simulation.store import Store, code_digest
from teleop_drill.simulation.visits import PLAIN, SESSIONS

if TYPE_CHECKING:
    from distributed import Client

_MOST = 30
"""Largest number of faults of a schedule."""
_FRESH = 0.4
"""Share of schedules that are drawn anew; the others are bred from kept ones."""
_LONG = 0.2
"""Share of faults that last about as long as the longest outage after which an arm goes on by itself."""
_AHEAD = 4
"""A schedule is chosen when all but this many before it are known, so that the number of cores changes nothing."""
_AHEAD_OF_CLUSTER = 32
_BREAKS = 0.0005
_END = 5.0
"""Latest time of a drawn fault [s]: many faults at once need less time than one after the other."""
_DEEP, _DEPTHS = 0.25, (1, 2, 2, 3, 4)
"""Share of schedules in which priorities of threads decide, and the depths of these."""
_PLAIN = 0.6
"""Share of schedules with the plain session at least; the others draw from all kinds."""
_LEADS = {
    State.DISABLED.name: ("reset", "disable"),
    State.ENABLED.name: ("reset", "enable", "resume"),
    State.PAUSED.name: ("reset", "enable", "pause"),
}
"""Commands that bring an arm into a state from any other; the arm refuses those that it does not need."""


class Search:
    """Chooses schedules by what earlier schedules have met.

    Half of the kinds of faults are off in each schedule that is drawn anew. Some faults hide others: an arm that is
    stopped meets no fault of its motion (Groce et al., Swarm Testing, ISSTA 2012). Kinds, states and moments are drawn
    with a weight that decreases with the number of times that they were met.

    Args:
        store: Schedules and counts so far.
        seed: Seed of the choice. The machine of the schedule ``k`` of a store has the seed ``seed + k``.
    """

    def __init__(self, store: Store, seed: int) -> None:
        self._store, self._seed = store, seed
        self._next = store.coverage.sessions
        self._tried: Counter[str] = Counter()
        """Number of times that an event was aimed at; an event that cannot happen is not aimed at without end."""
        self._moments: Counter[tuple[str, int]] = Counter()
        """Number of faults of a kind in each second of all schedules."""
        self._bred: Counter[Schedule] = Counter()
        for one in store.kept:
            self._count(one.schedule.faults)

    def _count(self, faults: Sequence[Fault]) -> None:
        self._moments.update((one.kind, int(one.at)) for one in faults)

    def choose(self) -> Schedule:
        """Next schedule."""
        seed = self._seed + self._next
        random = Random(f"{seed}/search")
        self._next += 1
        is_fresh = len(self._store.kept) < _AHEAD or random.random() < _FRESH
        chosen = self._fresh(random, seed) if is_fresh else self._child(random, seed)
        self._count(chosen.faults)
        return chosen

    # -- drawn anew ------------------------------------------------------------------------------

    def _fresh(self, random: Random, seed: int) -> Schedule:
        processes = random.choice((Processes.SIDES, Processes.SIDES, Processes.ONE))
        kinds = switched_on(random)
        faults = [one for _ in range(random.randint(2, 8)) for one in self._aimed(random, kinds, processes)]
        breaks = _BREAKS if random.random() < 0.2 else 0.0
        return Schedule(seed, _tidy(random, faults), processes, breaks, _depth(random), _session(random))

    def _aimed(self, random: Random, kinds: Sequence[str], processes: Processes) -> list[Fault]:
        """A fault in a state of the arm, and what brings the arm there."""
        aims = [(sometimes.met(kind, state), kind, state, "") for kind in kinds for state in sometimes.STATES]
        if "command" in kinds:
            names = (*COMMANDS, sometimes.RELEASE)
            aims += [(sometimes.asked(name, s), "command", s, name) for name in names for s in sometimes.STATES]
        met = self._store.times
        weights = [1.0 / ((1.0 + met[aim[0]]) * (1.0 + self._tried[aim[0]])) for aim in aims]
        ((event, kind, state, name),) = random.choices(aims, weights)
        self._tried[event] += 1
        fault = self._fault(random, kind, processes)
        if name:
            fault = commanded(fault.at, name)
        return [*_lead(random, state, fault.at, PROCESSES[processes][-2]), fault]

    def _fault(self, random: Random, kind: str, processes: Processes) -> Fault:
        seconds = [*range(int(BEGIN), int(_END))]
        (second,) = random.choices(seconds, [1.0 / (1.0 + self._moments[kind, one]) for one in seconds])
        where = random.choice(PROCESSES[processes]) if kind in OF_PROCESS else ""
        lasts = random.uniform(2.0, 3.0) if random.random() < _LONG else min(3.0, random.expovariate(1.0))
        lasts += 4.5 if kind == "slow turns" else 0.0
        return Fault(second + random.random(), kind, where, lasts, random.random())

    # -- bred ------------------------------------------------------------------------------------

    def _child(self, random: Random, seed: int) -> Schedule:
        """A kept schedule with one to three changes."""
        parent = self._parent(random)
        faults = list(parent.faults)
        for _ in range(random.randint(1, 3)):
            change = random.choice((self._add, self._move, self._swap, self._join, self._vary, self._leave_out))
            faults = change(random, faults, parent.processes) or faults
        seed = random.choice((seed, parent.seed))
        depth = parent.depth if random.random() < 0.8 else _depth(random)
        session = parent.session if random.random() < 0.8 else _session(random)
        return replace(parent, seed=seed, faults=_tidy(random, faults), depth=depth, session=session)

    def _parent(self, random: Random) -> Schedule:
        """A kept schedule; one with rare events and few children has the largest weight."""
        times = self._store.times
        rare = [0.1 + sum(1.0 / (1.0 + times[name]) for name in one.new) for one in self._store.kept]
        weights = [
            w / (1.0 + self._bred[one.schedule]) / SESSIONS[one.schedule.session].cost
            for w, one in zip(rare, self._store.kept, strict=True)
        ]
        (chosen,) = random.choices(self._store.kept, weights)
        self._bred[chosen.schedule] += 1
        return chosen.schedule

    def _add(self, random: Random, faults: list[Fault], processes: Processes) -> list[Fault]:
        """Add a fault in a state that it rarely met."""
        return [*faults, *self._aimed(random, sorted(KINDS), processes)]

    def _move(self, random: Random, faults: list[Fault], _: Processes) -> list[Fault]:
        """Begin a fault at another time, or shortly after another fault."""
        if not faults:
            return faults
        k, other = random.randrange(len(faults)), random.choice(faults)
        at = min(_END, other.at + random.expovariate(5.0)) if random.random() < 0.5 else random.uniform(BEGIN, _END)
        return [*faults[:k], replace(faults[k], at=at), *faults[k + 1 :]]

    def _swap(self, random: Random, faults: list[Fault], processes: Processes) -> list[Fault]:
        """Replace a fault by one of another kind at the same time."""
        if not faults:
            return faults
        k = random.randrange(len(faults))
        *_, new = self._aimed(random, sorted(KINDS), processes)
        return [*faults[:k], replace(new, at=faults[k].at), *faults[k + 1 :]]

    def _join(self, random: Random, faults: list[Fault], processes: Processes) -> list[Fault]:
        """Add the faults of another kept schedule."""
        names = PROCESSES[processes]
        return [
            *faults,
            *(
                replace(one, where=random.choice(names)) if one.where and one.where not in names else one
                for one in self._parent(random).faults
            ),
        ]

    def _vary(self, random: Random, faults: list[Fault], processes: Processes) -> list[Fault]:
        """Change place, duration and strength of a fault."""
        if not faults:
            return faults
        k = random.randrange(len(faults))
        new = self._fault(random, faults[k].kind, processes)
        return [*faults[:k], replace(new, at=faults[k].at), *faults[k + 1 :]]

    def _leave_out(self, random: Random, faults: list[Fault], _: Processes) -> list[Fault]:
        return faults if len(faults) < 2 else random.sample(faults, len(faults) - 1)


def _depth(random: Random) -> int:
    return random.choice(_DEPTHS) if random.random() < _DEEP else 0


def _session(random: Random) -> str:
    if random.random() < _PLAIN:
        return PLAIN
    (chosen,) = random.choices(sorted(SESSIONS), [1.0 / SESSIONS[name].cost for name in sorted(SESSIONS)])
    return chosen


def switched_on(random: Random) -> list[str]:
    """About half of the kinds of faults."""
    return [kind for kind in sorted(KINDS) if random.random() < 0.5] or sorted(KINDS)


def _lead(random: Random, state: str, at: float, slave: str) -> list[Fault]:
    """What brings an arm into a state shortly before a time [s], from whichever state."""
    if state == State.FAULT.name:  # somebody tries to reset the arm while the button is held
        begin = at - random.uniform(0.35, 0.5)
        reset = commanded(begin + random.uniform(0.2, 0.3), "reset")
        return [Fault(begin, "press", "", random.uniform(0.35, 0.8), random.random()), reset]
    if state == sometimes.NO_STATE:  # from the start of a new process of the slave until its first report
        dead = random.uniform(0.1, 0.5)
        return [Fault(at - dead - random.uniform(0.0, 0.4), "kill", slave, dead, 0.5)]
    begin, names = random.uniform(0.2, 0.7), _LEADS[state]
    return [commanded(at - begin * (1.0 - k / len(names)), name) for k, name in enumerate(names)]


def _tidy(random: Random, faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """At most :data:`_MOST` faults in the order of their times, with numbers that are short in a text."""
    some = random.sample(list(faults), min(_MOST, len(faults)))
    short = [
        replace(one, at=round(one.at, 3), seconds=round(one.seconds, 3), amount=round(one.amount, 6)) for one in some
    ]
    return tuple(sorted(short, key=lambda one: one.at))


Measured = tuple[Found, list[str]]
"""Result of a schedule, and the branches that it ran."""
Result = tuple[Found, tuple[str, ...]]
"""Result of a schedule, and what no earlier schedule had met."""


def search(
    store: Store,
    seed: int,
    seconds: float,
    cores: int | None = None,
    client: "Client | None" = None,
    ahead: int | None = None,
) -> Iterator[Result]:
    """Run schedules for a time, and keep in the store those that meet something first.

    The same store, seed, ``ahead`` and number of schedules give the same schedules, on any number of cores or workers.

    Args:
        store: Schedules and counts so far.
        seed: As of :class:`Search`.
        seconds: Time after which no further schedule begins [s].
        cores: Number of processes of this machine; None: one for each core.
        client: Connection to a Dask cluster, whose workers then run the schedules.
        ahead: A schedule is chosen when all but this many before it are known; None: 4, and 32 on a cluster. This is
            also the largest number of schedules that run at once.

    Returns:
        Iterator over the results, each with what no earlier schedule had met.

    Raises:
        SessionError: The code of a worker differs, there is no worker, or a process or worker died.
    """
    chosen, end = Search(store, seed), time.monotonic() + seconds
    ahead = ahead or (_AHEAD if client is None else _AHEAD_OF_CLUSTER)
    waiting: deque[Future[Measured]] = deque()

    def take() -> Result:
        found, branches = waiting.popleft().result()
        return found, store.add(found, branches)

    try:
        with _submitting(cores, client) as submit:
            while time.monotonic() < end:
                if len(waiting) >= ahead:
                    yield take()
                waiting.append(submit(chosen.choose()))
            while waiting:
                yield take()
    finally:
        store.save()


@contextmanager
def _submitting(cores: int | None, client: "Client | None") -> "Iterator[Callable[[Schedule], Future[Measured]]]":
    """Function that lets a process of this machine or of a cluster run a schedule."""
    if client is None:
        with workers(cores or len(os.sched_getaffinity(0)), warm) as pool:
            yield lambda schedule: pool.submit(run_measured, schedule)
        return
    from distributed import KilledWorker

    check_codes(client, code_digest)
    tasks: list[Any] = []

    def submit(schedule: Schedule) -> "Future[Measured]":
        tasks.append(client.submit(_run_there, schedule, code_digest(), pure=False, retries=TRIES))
        return tasks[-1]  # type: ignore[no-any-return]

    try:
        yield submit
    except KilledWorker as error:
        raise SessionError(f"a worker died in each of {TRIES + 1} tries of a schedule") from error
    finally:
        client.cancel(tasks)


_starts, _is_warm, _one_at_a_time = Starts(Branches()), False, Lock()


def run_measured(schedule: Schedule) -> Measured:
    """Run a schedule; returns its result and the branches that it ran."""
    return schedule.run_in(_starts)


def _run_there(schedule: Schedule, code: str) -> Measured:
    """Run a schedule on a worker of a cluster, in a copy of its process."""
    global _is_warm
    check_code(code, code_digest)
    with _one_at_a_time:  # a worker may have several threads, but a process has one working directory
        if not _is_warm:
            warm()
            _is_warm = True
        return run_measured(schedule)
