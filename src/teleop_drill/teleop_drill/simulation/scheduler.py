"""Scheduler: simulated time, and the strands that run in it, one at a time.

A strand is a thread of a simulated process. Only one strand runs at a time, until it waits for a time, a lock or a
message. Strands of one process share its interpreter, so in simulated time they exclude each other; strands of
different processes run in parallel. Events are ordered by time, then by the order in which they were scheduled. With a
depth, the priorities of strands decide instead, as in PCT (Burckhardt et al., ASPLOS 2010).
"""

import heapq
from collections.abc import Callable
from itertools import count
from random import Random
from typing import Any

import numpy as np
from greenlet import GreenletExit, getcurrent, greenlet

from teleop_drill.simulation.reach import BEGIN_NS, LOOK_NS

_BREAK_NS = 1_000_000
"""Longest time for which an interrupted thread waits for other threads of its process [ns]."""
_LATE_NS = 200_000
"""Lateness of the strand with the lowest priority, if priorities decide [ns]."""
_FAIR_NS = 10_000_000
"""Longest time for which strands with a higher priority pass a strand that waits for its interpreter [ns]."""
_SPAN_NS = 15_000_000_000
"""Time over which the changes of priorities are drawn, about the length of a schedule [ns]."""


class Deadlock(Exception):  # noqa: N818
    """No further event is scheduled, but the awaited event has not happened."""


class Costs:
    """Durations of all operations [ns].

    Args:
        random: Random generator of the durations.
    """

    def __init__(self, random: Random) -> None:
        self._random = random
        self.hiccups = 2e-4
        """Share of the turns after which a process gets no processor time for some time."""
        self.crowd_ns = 0.0
        """Mean time for which a process without priority waits for a processor while other processes run [ns]."""

    def turn(self) -> int:
        """Duration of a turn [ns], without the time for its messages."""
        random = self._random.random
        cost = 20_000.0 + 40_000.0 * random()
        if random() < self.hiccups:
            cost += 4e6 * random()
        return round(cost)

    def wake(self, *, has_priority: bool) -> int:
        """Delay from the time at which a strand is due until it runs [ns]."""
        late = self._random.expovariate(1.0 / 50_000.0)
        if self.crowd_ns and not has_priority:
            late += self._random.expovariate(1.0 / self.crowd_ns)
        return round(late)


class Strand:
    """Thread of a process.

    Args:
        scheduler: Scheduler of the strand.
        process: Process that owns the strand.
        name: Name of the thread.
        work: Function that the strand runs.

    Attributes:
        error: Error that ended the strand; None if it ended without an error.
    """

    _numbers = count(1)

    def __init__(self, scheduler: "Scheduler", process: "Turns", name: str, work: Callable[[], object]) -> None:
        self.name, self.process, self._work, self._scheduler = name, process, work, scheduler
        self.ident: int | None = next(self._numbers)
        self.native_id = self.ident
        self.token = 0  # a wake-up for an earlier wait is ignored
        self.has_priority = False
        self.used_ns = 0  # processor time of all turns
        self.rank = scheduler.priorities.random() if scheduler.depth else 0.0
        """Priority, if the scheduler has a depth: from two strands that can run, the one with the smaller rank runs."""
        self.waits_ns = 0
        """Time since which the strand waits for the interpreter of its process [ns]; 0 while it does not."""
        self.error: BaseException | None = None
        # When a greenlet ends, its creator continues, unless another parent is set.
        self.greenlet = greenlet(self._run, parent=scheduler.hub)
        self._has_begun = self._has_ended = False
        self._joined: list[Strand] = []

    def start(self) -> None:
        """Start the strand."""
        self._has_begun = True
        self._scheduler.wake(self)

    def join(self, timeout: float | None = None) -> None:
        """Wait for the end of the strand, at most for ``timeout`` [s]."""
        if self.is_alive():
            self._joined.append(self._scheduler.current)
            self._scheduler.wait(timeout)

    def is_alive(self) -> bool:
        """Whether the strand has not ended."""
        return self._has_begun and not self._has_ended and not self.process.is_dead

    def _run(self, _: object) -> None:
        try:
            self._work()
        except BaseException as error:
            self.error = error
        self._has_ended = True
        for strand in self._joined:
            self._scheduler.wake(strand)


class Turns:
    """The scheduler's data about a process."""

    def __init__(self) -> None:
        self.busy_ns = 0  # time until which the interpreter of the process is busy
        self.slow_ns = 0  # time by which each turn of the process takes longer [ns]
        self.is_dead = self.is_stopped = False
        self.parked: list[tuple[Strand, int, bool]] = []


class Lock:
    """Simulated form of :class:`~teleop_core.middleware.platform.Lock`."""

    def __init__(self, scheduler: "Scheduler") -> None:
        self._scheduler, self._waiting = scheduler, list[Strand]()
        self._is_taken = False

    def acquire(self, blocking: bool = True, timeout: float = -1.0, /) -> bool:
        """Acquire the lock; returns whether this was possible within the timeout [s]."""
        scheduler = self._scheduler
        deadline_ns = scheduler.now_ns + round(1e9 * timeout)
        while self._is_taken:
            left_ns = deadline_ns - scheduler.now_ns
            if not blocking or (timeout >= 0.0 and left_ns <= 0):
                return False
            self._waiting.append(scheduler.current)
            scheduler.wait(None if timeout < 0.0 else 1e-9 * left_ns)
        self._is_taken = True
        return True

    def release(self) -> None:
        """Release the lock."""
        self._is_taken = False
        if self._waiting:
            self._scheduler.wake(self._waiting.pop(0))

    def __enter__(self) -> object:
        if self._is_taken:
            return self.acquire()
        self._is_taken = True
        return True

    def __exit__(self, *_: object) -> None:
        self._is_taken = False
        if self._waiting:
            self.release()


class Scheduler:
    """Simulated time.

    Args:
        seed: Seed of all random numbers.
        breaks: Share of the clock readings after which the interpreter switches to another thread.
        depth: Number of ordering constraints of the faults that are searched for, at most 9. Each strand has a random
            priority, and at ``depth - 1`` random times the strand that runs gets a low one. 0: no priorities.

    Attributes:
        now: Memory of the monotonic time [ns], with one element; as :attr:`now_ns`, but faster.
        now_at: Address of this memory, for kernels.
        error: Error that cannot pass through compiled code; it ends the simulation.
        hub: Greenlet in which the scheduler decides.
        current: The running strand, or the creator of the scheduler outside of the simulation.
        costs: Durations of all operations.
    """

    def __init__(self, seed: int, breaks: float = 0.0, depth: int = 0) -> None:
        self.seed, self.breaks, self.depth = seed, breaks, depth
        now = np.full(1, BEGIN_NS)
        self.now, self.now_at = now.data, int(now.ctypes.data)
        self.error: BaseException | None = None
        self._randoms: list[tuple[str, Random]] = []
        self.priorities = self.random("priorities")
        self._changes = self._drawn_changes()
        """Times of the remaining changes of priorities [ns]."""
        self._breaking = self.random("breaks")
        self.costs = Costs(self.random("costs"))
        self._queue: list[tuple[int, float, int, Any, int, bool]] = []
        self._orders, self.hub = count(), getcurrent()
        self._outside = Strand(self, Turns(), "outside", lambda: None)
        self.current = self._outside
        self._kept: list[Strand] = []  # strands are stored, because a deleted greenlet would run its `finally` blocks

    def random(self, name: str) -> Random:
        """Random generator for one purpose only."""
        made = Random(f"{self.seed}/{name}")
        self._randoms.append((name, made))
        return made

    def seed_again(self, seed: int, depth: int = 0) -> None:
        """Let all random generators go on from another seed, and priorities be of another depth."""
        self.seed, self.depth = seed, depth
        for name, one in self._randoms:
            one.seed(f"{seed}/{name}")
        self._changes = self._drawn_changes()
        for strand in self._kept:
            strand.rank = self.priorities.random() if depth else 0.0

    def _drawn_changes(self) -> list[int]:
        """Times at which the strand that runs gets a low priority [ns]."""
        return sorted(self.now_ns + self.priorities.randrange(_SPAN_NS) for _ in range(self.depth - 1))

    @property
    def now_ns(self) -> int:
        """Monotonic time [ns]; can be set."""
        return self.now[0]

    @now_ns.setter
    def now_ns(self, value: int) -> None:
        self.now[0] = value

    def keep(self, error: BaseException) -> None:
        """Keep the first error that cannot pass through compiled code, until the strand gives up its turn."""
        self.error = self.error or error

    # -- for strands -----------------------------------------------------------------------------

    def look_ns(self) -> int:
        """Time [ns] for a caller that reads a clock."""
        now = self.now
        now[0] = now_ns = now[0] + LOOK_NS
        return now_ns

    def look_and_pass(self) -> int:
        """Like :meth:`look_ns`; sometimes other threads of the process run before it returns."""
        if self._breaking.random() < self.breaks and getcurrent() is self.current.greenlet:
            self._switch(self.now_ns + round(_BREAK_NS * self._breaking.random()))
        return self.look_ns()

    def sleep(self, seconds: float) -> None:
        """Let the strand wait for a time [s]."""
        self._switch(self.now_ns + max(0, round(1e9 * seconds)) + self._late(self.current))

    def wait(self, seconds: float | None) -> bool:
        """Wait until this strand is woken, at most for a time [s]; returns whether it was woken."""
        return self._switch(None if seconds is None else self.now_ns + round(1e9 * seconds))

    def _switch(self, until_ns: int | None) -> bool:
        strand, here = self.current, getcurrent()
        if here is not (self.hub if strand is self._outside else strand.greenlet):
            raise GreenletExit  # ends a strand of a simulation that is over
        if until_ns is not None:
            self._push(until_ns, strand, strand.token, False)
        return self._pump() if strand is self._outside else bool(self.hub.switch())

    # -- for whoever arranges --------------------------------------------------------------------

    def wake(self, strand: Strand) -> None:
        """Wake a waiting strand, which then continues soon."""
        self._push(self.now_ns + self._late(strand), strand, strand.token, True)

    def _late(self, strand: Strand) -> int:
        """Delay from the time at which a strand is due until it runs [ns]."""
        late_ns = self.costs.wake(has_priority=strand.has_priority)
        if self.depth:  # strands that are due within `_LATE_NS` run by their priorities
            late_ns = round(_LATE_NS * min(1.0, strand.rank)) + max(0, late_ns - _LATE_NS)
        return late_ns

    def at(self, time_ns: int, event: Callable[[], object]) -> None:
        """Schedule an event at a time [ns]."""
        self._push(max(time_ns, self.now_ns), event, 0, False)

    def spawn(self, process: Turns, name: str, work: Callable[[], object]) -> Strand:
        """Create a strand; the caller must start it."""
        strand = Strand(self, process, name, work)
        self._kept.append(strand)
        return strand

    def strands(self, process: Turns) -> list[Strand]:
        """Threads of a process that have not ended."""
        return [strand for strand in self._kept if strand.process is process and strand.is_alive()]

    def resume(self, process: Turns) -> None:
        """Continue a process that was stopped."""
        process.is_stopped = False
        process.busy_ns = max(process.busy_ns, self.now_ns)
        parked, process.parked = process.parked, []
        for strand, token, value in parked:
            self._push(self.now_ns, strand, token, value)

    def run(self, strand: Strand) -> None:
        """Run the simulation until a strand has ended; raises the error that ended the strand.

        Raises:
            Deadlock: The strand can never end.
        """
        strand.start()
        strand.join()
        if strand.error is not None:
            raise strand.error

    def _pump(self) -> bool:
        """Run the simulation until the thread outside of it continues; return whether a strand woke that thread."""
        queue, pop = self._queue, heapq.heappop
        while queue:
            time_ns, _, _, what, token, value = pop(queue)
            if not isinstance(what, Strand):
                self.now_ns = time_ns
                what()
                continue
            process = what.process
            if token != what.token or process.is_dead:
                continue
            if process.is_stopped:
                process.parked.append((what, token, value))
                continue
            if process.busy_ns > time_ns:
                what.waits_ns = what.waits_ns or time_ns
                self._push(process.busy_ns, what, token, value)
                continue
            what.waits_ns = 0
            if self._changes and self._changes[0] <= time_ns:
                what.rank = float(len(self._changes))
                del self._changes[0]
            self.now_ns, self.current = time_ns, what
            what.token += 1
            if what is self._outside:
                return value
            what.greenlet.switch(value)
            if self.error is not None:
                raise self.error
            cost_ns = self.costs.turn() + process.slow_ns
            what.used_ns += cost_ns
            process.busy_ns = self.now_ns + cost_ns
        raise Deadlock("deadlock: every process waits for another one")

    def _push(self, time_ns: int, what: Any, token: int, value: bool) -> None:
        rank = 0.0
        if self.depth and isinstance(what, Strand) and not (what.waits_ns and time_ns - what.waits_ns > _FAIR_NS):
            rank = what.rank
        heapq.heappush(self._queue, (time_ns, rank, next(self._orders), what, token, value))
