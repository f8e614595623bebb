"""The schedule of a 1 kHz loop, on a clock that the tests move."""

from itertools import pairwise

import pytest

from teleop_core.graph.stage import STAGES
from teleop_core.nodes.rate import REPORT_PERIOD, Recent, Schedule, report_phase

MS = 1_000_000


class FakeTime:
    """Clock [ns] whose sleep takes as long as it is told: what is asked, plus ``delays`` [ns]."""

    def __init__(self, *delays: int) -> None:
        self.now_ns, self.delays = 5 * MS, list(delays)

    def clock(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now_ns += round(seconds * 1e9) + (self.delays.pop(0) if self.delays else 0)


def schedule(time: FakeTime, **options: int) -> Schedule:
    return Schedule(time.clock, time.sleep, **options)


def test_lateness_does_not_add_up() -> None:
    time = FakeTime(*[300_000] * 1000)
    ticks = schedule(time)
    for _ in range(1000):
        ticks.due()
    assert time.now_ns == 5 * MS + 1000 * MS + 300_000
    assert ticks.counts.late == 0


def test_a_wake_up_later_than_half_a_period_counts_as_late() -> None:
    time = FakeTime(600_000)
    ticks = schedule(time)
    assert list(ticks.due()) == [6 * MS]
    assert (ticks.counts.late, ticks.counts.missed) == (1, 0)


def test_missed_ticks_are_made_up_for_each_with_its_own_time() -> None:
    time = FakeTime(3 * MS)
    ticks = schedule(time)
    assert list(ticks.due()) == [6 * MS, 7 * MS, 8 * MS, 9 * MS]
    assert list(ticks.due()) == [10 * MS]
    counts = ticks.counts
    assert (counts.ticks, counts.missed, counts.caught_up, counts.dropped) == (5, 3, 3, 0)


def test_beyond_the_bound_the_oldest_ticks_are_dropped_and_counted() -> None:
    time = FakeTime(10 * MS)
    ticks = schedule(time, max_catch_up=4)
    assert list(ticks.due()) == [k * MS for k in range(12, 17)]
    assert list(ticks.due()) == [17 * MS]
    counts = ticks.counts
    assert (counts.ticks, counts.missed, counts.caught_up, counts.dropped) == (6, 10, 4, 6)


@pytest.mark.parametrize("max_catch_up", [0, 1, 7, 100])
def test_ticks_and_dropped_ones_are_the_elapsed_periods(max_catch_up: int) -> None:
    delays = [k * k * 37_000 % 9_000_000 for k in range(500)]
    time = FakeTime(*delays)
    ticks = schedule(time, max_catch_up=max_catch_up)
    seen = [tick for _ in range(500) for tick in ticks.due()]
    assert seen == sorted(set(seen))
    counts = ticks.counts
    assert len(seen) == counts.ticks
    assert counts.ticks + counts.dropped == (time.now_ns - 5 * MS) // MS
    assert counts.missed == counts.caught_up + counts.dropped


def test_a_sleep_that_ends_early_is_slept_again() -> None:
    time = FakeTime(-400_000)
    assert list(schedule(time).due()) == [6 * MS]
    assert time.now_ns == 6 * MS


def test_starting_again_forgets_the_time_in_between() -> None:
    time = FakeTime()
    ticks = schedule(time)
    ticks.due()
    time.now_ns += 1000 * MS
    ticks.start()
    assert list(ticks.due()) == [1007 * MS]
    assert ticks.counts.missed == 0


def test_recent_numbers_replace_the_oldest() -> None:
    recent = Recent(3)
    assert recent.summary() == (0.0, 0.0, 0.0)
    for number in (100.0, 1.0, 2.0, 3.0):
        recent.put(number)
    median, _, largest = recent.summary()
    assert (median, largest) == (2.0, 3.0)


@pytest.mark.parametrize("begin_ns", [0, 1, 699_999, 700_000, 123_456_789])
def test_a_schedule_with_a_phase_keeps_it_wherever_it_starts(begin_ns: int) -> None:
    time = FakeTime()
    time.now_ns = begin_ns
    loop = schedule(time, phase_ns=700_000)
    ticks = [loop.due() for _ in range(3)]
    assert all(tick % 1_000_000 == 700_000 for due in ticks for tick in due)
    assert begin_ns + 1_000_000 <= ticks[0][0] < begin_ns + 2_000_000


@pytest.mark.parametrize("arms", [("",), ("", "left"), ("left", "right"), ("a", "b", "c")])
def test_no_two_nodes_of_a_session_report_within_three_milliseconds(arms: tuple[str, ...]) -> None:
    stages = tuple(STAGES)
    phases = sorted(report_phase(stage, stages, arm) for arm in arms for stage in stages)
    assert min(after - before for before, after in pairwise([*phases, phases[0] + 1.0])) > 3e-3
    assert 0.0 <= phases[0] <= phases[-1] < REPORT_PERIOD


def test_a_stage_that_is_not_registered_reports_at_a_time_of_its_own() -> None:
    stages = tuple(STAGES)
    assert report_phase("mine", stages) not in {report_phase(stage, stages) for stage in stages}
