"""Strain: when a loop with priority gives way, and when it takes its priority again."""

from typing import Any

import pytest

from teleop_core.nodes.rate import Schedule
from teleop_core.nodes.strain import Strain

MS = 1_000_000


class Machine:
    """A clock, a processor that a loop uses, and what the loop asks of the machine."""

    def __init__(self) -> None:
        self.now_ns = self.used_ns = 0
        self.has_priority = True
        self.said: list[str] = []

    def monotonic_ns(self) -> int:
        return self.now_ns

    def thread_time_ns(self) -> int:
        return self.used_ns

    def give_way(self) -> None:
        self.has_priority = False

    def take(self) -> None:
        self.has_priority = True

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)

    def work(self, seconds: float) -> None:
        self.sleep(seconds)
        self.used_ns += round(seconds * 1e9)


def loop(machine: Machine) -> Schedule:
    world: Any = machine
    schedule = Schedule(machine.monotonic_ns, machine.sleep, max_catch_up=1000)
    schedule.strain = Strain(world, machine.take, machine.said.append)
    return schedule


def run(machine: Machine, schedule: Schedule, seconds: float, tick: float) -> int:
    """Ticks that a loop makes in a time, each of which takes ``tick`` [s]."""
    end_ns, ticks = machine.now_ns + round(seconds * 1e9), 0
    while machine.now_ns < end_ns:
        for _ in schedule.due():
            machine.work(tick)
            ticks += 1
    return ticks


@pytest.mark.parametrize("tick", [1e-5, 3e-4, 6.5e-4])
def test_a_loop_that_keeps_up_keeps_its_priority(tick: float) -> None:
    machine = Machine()
    schedule = loop(machine)
    assert abs(run(machine, schedule, 10.0, tick) - 10_000) <= 1
    assert (machine.has_priority, machine.said, schedule.counts.dropped) == (True, [], 0)


@pytest.mark.parametrize(("tick", "within"), [(7.5e-4, 2.1), (1.2e-3, 0.5), (3e-3, 0.5)])
def test_a_loop_that_cannot_keep_up_gives_way_says_so_once_and_skips_what_it_missed(tick: float, within: float) -> None:
    machine = Machine()
    schedule = loop(machine)
    run(machine, schedule, within, tick)
    assert not machine.has_priority
    made_up = schedule.counts.caught_up
    run(machine, schedule, 10.0, tick)
    assert len(machine.said) == 1
    assert schedule.counts.caught_up == made_up
    assert schedule.counts.missed == schedule.counts.caught_up + schedule.counts.dropped


def test_a_loop_takes_its_priority_again_when_there_is_room() -> None:
    machine = Machine()
    schedule = loop(machine)
    run(machine, schedule, 3.0, 2e-3)
    assert not machine.has_priority
    run(machine, schedule, 4.1, 2e-4)
    assert machine.has_priority
    assert len(machine.said) == 2
    before = schedule.counts.dropped
    run(machine, schedule, 1.0, 2e-4)
    assert schedule.counts.dropped == before


def test_one_standstill_is_made_up_with_priority() -> None:
    machine = Machine()
    schedule = loop(machine)
    run(machine, schedule, 0.5, 1e-4)
    machine.sleep(0.08)
    run(machine, schedule, 0.5, 1e-4)
    assert (machine.has_priority, schedule.counts.dropped, schedule.counts.caught_up) == (
        True,
        0,
        schedule.counts.missed,
    )
