"""Rate: the schedule of a 1 kHz loop; clock and sleep are passed as functions."""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from teleop_core.graph.signals import TICK_NS
from teleop_core.nodes.strain import Strain

REPORT_PERIOD = 1.0
"""Time between two reports of a node [s]."""


def report_phase(stage: str, stages: Sequence[str], arm: str = "") -> float:
    """Phase of a node's reports: their times modulo the period [s].

    A report takes milliseconds. The phases are chosen so that no two nodes of a session report at the same time, in
    any process.

    Args:
        stage: Name of the node's stage.
        stages: Names of all stages.
        arm: Name of the node's arm; the phase of a named arm lies between the phases of two stages.
    """
    place = stages.index(stage) if stage in stages else len(stages)
    between = zlib.crc32(arm.encode()) / 2**32 if arm else 0.0
    return REPORT_PERIOD * (place + between) / (len(stages) + 1)


@dataclass
class TickCounts:
    """Counts of the ticks of a loop so far.

    Attributes:
        ticks: Executed ticks.
        late: Wake-ups that were late by more than half a period.
        missed: Ticks that did not begin before the next tick was due.
        caught_up: Missed ticks that were executed later, in the next wake-up.
        dropped: Missed ticks that are never executed.
    """

    ticks: int = 0
    late: int = 0
    missed: int = 0
    caught_up: int = 0
    dropped: int = 0


class Phases:
    """Time that a loop has spent in each phase of its ticks since it began.

    Attributes:
        ticks: Number of ticks.
        used_ns: Time in each phase [ns], by its name.
    """

    def __init__(self, *names: str) -> None:
        self.ticks, self.used_ns = 0, dict.fromkeys(names, 0)

    def put(self, *times_ns: int) -> None:
        """Add a tick: its begin and the end of each of its phases, by a monotonic clock [ns]."""
        self.ticks += 1
        for name, begin_ns, end_ns in zip(self.used_ns, times_ns, times_ns[1:], strict=False):
            self.used_ns[name] += end_ns - begin_ns

    def values(self) -> dict[str, str]:
        """Names and texts for a report: ticks, and the time of each phase [µs]."""
        return {f"phase_us.{name}": str(used_ns // 1000) for name, used_ns in self.used_ns.items()} | {
            "phase_ticks": str(self.ticks)
        }


class Recent:
    """The last numbers of a stream, for their median and extremes.

    Args:
        size: Number of values that are stored.

    Attributes:
        numbers: Memory of the numbers (size,), which kernels also write.
        count: Number of values that were put so far, (1,).
    """

    def __init__(self, size: int = 1000) -> None:
        self.numbers, self.count = np.zeros(size), np.zeros(1, np.int64)

    def put(self, number: float) -> None:
        """Add a number, which replaces the oldest number."""
        count = self.count.item()
        self.numbers[count % len(self.numbers)] = number
        self.count[0] = count + 1

    def clear(self) -> None:
        """Delete all numbers."""
        self.count[0] = 0

    def summary(self) -> tuple[float, float, float]:
        """Median, 99th percentile and maximum; zeros without numbers."""
        kept = self.numbers[: self.count.item()]
        if not len(kept):
            return 0.0, 0.0, 0.0
        median, high = np.percentile(kept, (50.0, 99.0))
        return float(median), float(high), float(kept.max())


class Schedule:
    """Absolute schedule of ticks: one tick for every elapsed period, however late the wake-ups are.

    Args:
        clock: Returns the monotonic time [ns].
        sleep: Waits for some seconds; it may wait too long or too short.
        max_catch_up: Largest number of missed ticks that are executed in one wake-up; further missed ticks are dropped
            and counted.
        period_ns: Time between two ticks [ns].
        phase_ns: Times of all ticks modulo the period [ns]. Different phases keep the loops of one machine in order.
            None: the phase of the start.
    """

    def __init__(
        self,
        clock: Callable[[], int],
        sleep: Callable[[float], None],
        max_catch_up: int = 100,
        period_ns: int = TICK_NS,
        phase_ns: int | None = None,
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._max_catch_up, self._period_ns = max_catch_up, period_ns
        self._phase_ns = phase_ns
        self.strain: Strain | None = None
        """Judges whether the loop must give way; None for a loop without real-time priority."""
        self.counts = TickCounts()
        self.lateness = Recent()
        """Delay of each wake-up after the time of its tick, [ns]."""
        self.start()

    def start(self) -> None:
        """Begin now: the first tick is due after one period, or at the next phase after that time."""
        self._next_ns = self._clock() + self._period_ns
        if self._phase_ns is not None:
            self._next_ns += (self._phase_ns - self._next_ns) % self._period_ns
        if self.strain is not None:
            self.strain.start()

    def due(self) -> range:
        """Sleep until the next tick is due.

        Returns:
            Nominal times [ns] of the ticks to execute now, at least one, oldest first.
        """
        now_ns = self._clock()
        while now_ns < self._next_ns:
            self._sleep((self._next_ns - now_ns) * 1e-9)
            now_ns = self._clock()
        late_ns = now_ns - self._next_ns
        missed = late_ns // self._period_ns
        has_given_way = self.strain is not None and self.strain.is_over
        dropped = missed if has_given_way else max(0, missed - self._max_catch_up)
        first_ns = self._next_ns + dropped * self._period_ns
        self._next_ns += (missed + 1) * self._period_ns
        self._count(late_ns, missed, dropped)
        if self.strain is not None:
            self.strain.note(now_ns, missed, is_late=late_ns > self._period_ns // 2)
        return range(first_ns, self._next_ns, self._period_ns)

    def _count(self, late_ns: int, missed: int, dropped: int) -> None:
        counts = self.counts
        counts.ticks += missed + 1 - dropped
        counts.late += late_ns > self._period_ns // 2
        counts.missed += missed
        counts.caught_up += missed - dropped
        counts.dropped += dropped
        self.lateness.put(late_ns)
