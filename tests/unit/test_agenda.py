"""Agenda: timers, guards and deferred work of a node, which the executor serves."""

import time

import pytest

from teleop_core.middleware.agenda import NEVER_NS, Agenda, GuardCondition


def served(agenda: Agenda, until_ns: int) -> None:
    """Serve everything that is due until a time [ns], each at its own time."""
    while (due_ns := agenda.next_ns()) <= until_ns:
        assert agenda.serve(max(due_ns, 1))
    assert not agenda.serve(until_ns) or agenda.next_ns() <= until_ns


@pytest.mark.parametrize(("period", "count"), [(0.1, 100), (0.25, 40), (2.0, 5)])
def test_a_timer_calls_once_a_period_however_late_each_call_is(period: float, count: int) -> None:
    agenda, calls = Agenda(), []
    agenda.timer(period, lambda: calls.append(1))
    begin_ns = time.monotonic_ns()
    served(agenda, begin_ns + 10_000_000_000)
    assert abs(len(calls) - count) <= 1


def test_calls_that_were_missed_are_not_made_up_and_later_ones_keep_their_times() -> None:
    agenda, calls = Agenda(), []
    timer = agenda.timer(0.1, lambda: calls.append(1))
    due_ns = timer.due_ns
    assert agenda.serve(due_ns + 1_234_567_890)
    assert (len(calls), timer.due_ns - due_ns) == (1, 1_300_000_000)


def test_timers_of_one_period_wake_together() -> None:
    agenda = Agenda()
    times = {agenda.timer(0.1, lambda: None).due_ns % 100_000_000 for _ in range(5)}
    assert times == {0}


def test_a_cancelled_or_dropped_timer_calls_no_more_until_it_is_reset() -> None:
    agenda, calls = Agenda(), []
    timer = agenda.timer(0.1, lambda: calls.append(1))
    timer.cancel()
    assert timer.is_canceled()
    assert agenda.next_ns() == NEVER_NS
    timer.reset()
    assert agenda.next_ns() < NEVER_NS
    agenda.drop(timer)
    assert agenda.next_ns() == NEVER_NS
    assert calls == []


def test_deferred_work_comes_before_timers_and_a_guard_calls_once_for_all_its_triggers() -> None:
    agenda, calls, woken = Agenda(), [], []
    agenda.wake = lambda: woken.append(1)
    guard = GuardCondition(agenda, lambda: calls.append("guard"))
    for _ in range(3):
        guard.trigger()
    agenda.defer(calls.append, "work")
    assert (agenda.next_ns(), len(woken)) == (0, 2)
    while agenda.next_ns() == 0:
        agenda.serve(0)
    assert calls == ["guard", "work"]
    guard.trigger()
    guard.cancel()
    assert agenda.serve(0)
    assert calls == ["guard", "work"]
