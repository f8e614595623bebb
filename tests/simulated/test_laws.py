"""Laws in schedules that no random one of the first thousands has; mutants that each law finds."""

import pytest

from broken_copies import MUTANTS, Mutant
from mutants import scheduled
from teleop_core.nodes.crews import Processes
from teleop_core.slave.operation.states import COMMANDS
from teleop_drill.simulation.laws import LAWS
from teleop_drill.simulation.schedules import Fault
from teleop_drill.simulation.seeds import run_seed
from teleop_drill.simulation.sometimes import UNKNOWN_STOP

_NAMES = sorted((*COMMANDS, "release"))
HOME = (_NAMES.index("home") + 0.5) / len(_NAMES)
FOUND_BY_LAWS = {one.schedule.law: one for one in MUTANTS if one.schedule is not None}
"""One mutant of each law."""


def test_a_stop_in_the_middle_of_a_move_leaves_nothing_to_go_on_with() -> None:
    faults = (Fault(1.0, "command", "", 0.1, HOME), Fault(1.15, "press", "", 0.5, 0.5))
    found = run_seed(0, faults)
    assert not found.broken
    assert found.met["press", "ENABLED"] == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "disk", ["slow", "gone", *(pytest.param(disk, marks=pytest.mark.soak) for disk in ("full", "read-only"))]
)
def test_a_disk_that_fails_costs_what_the_recorder_says_and_harms_nobody_else(disk: str) -> None:
    found = run_seed(0, (Fault(2.0, f"{disk} disk", "", 1.0, 0.5),))
    assert found.broken == ()
    assert found.looks["recorded"] == 1
    assert found.looks["owner"] > 5000


@pytest.mark.slow
def test_a_recorder_that_starts_while_its_disk_is_gone_says_so() -> None:
    """Of seed 2001, composed: the law had asked it for what it had saved."""
    faults = (Fault(1.0, "kill", "recorder", 0.2, 0.5), Fault(1.4, "gone disk", "", 1.5, 0.5))
    assert run_seed(2001, faults, None, Processes.ONE).broken == ()


@pytest.mark.slow
def test_a_disk_that_fails_between_a_chunk_and_its_index_keeps_more_than_was_said() -> None:
    """Of seed 40113: the law wanted no more."""
    faults = (Fault(1.858, "slow disk", "", 3.0, 0.98551), Fault(4.1117, "read-only disk", "", 0.27, 0.5))
    assert run_seed(40113, faults).broken == ()


@pytest.mark.slow
def test_a_recorder_says_that_a_process_was_killed_with_what_waited_in_it() -> None:
    """Of seed 60060: it made up for a standstill, faster than its socket took what it recorded."""
    faults = (
        Fault(1.8555, "standstill", "teleop_session", 0.8036, 0.7),
        Fault(2.79, "kill", "teleop_session", 1.0, 0.5),
    )
    assert run_seed(60060, faults, None, Processes.ONE).broken == ()


@pytest.mark.slow
def test_a_slave_that_was_started_while_the_clock_was_behind_follows_once_it_is_right() -> None:
    """Of seed 10003: it refused every command as one of the future."""
    faults = (Fault(1.3, "kill", "slave_side", 1.0, 0.5), Fault(2.57, "clock step", "", 0.5, 0.91))
    assert run_seed(10003, faults).broken == ()


@pytest.mark.slow
def test_an_intruder_under_a_clock_that_was_ahead_does_not_shut_the_hand_out_for_good() -> None:
    """Of seed 21039: the slave, started anew, took the first it heard, of the future."""
    faults = (
        Fault(6.913, "kill", "slave_side", 1.0, 0.5),
        Fault(7.854, "intruder", "", 1.52, 0.0658),
        Fault(8.179, "clock step", "", 0.595, 0.9609472),
    )
    assert run_seed(21039, faults).broken == ()


@pytest.mark.slow
def test_a_session_that_began_under_a_slow_clock_stamps_by_it_and_moves_by_new_commands() -> None:
    """Of seed 61046: the law took them for old ones."""
    faults = (Fault(4.109, "kill", "teleop_session", 1.0, 0.5), Fault(4.633, "clock step", "", 1.5546, 0.5542206))
    assert run_seed(61046, faults, None, Processes.ONE).broken == ()


@pytest.mark.slow
def test_a_press_counts_from_the_time_at_which_the_slave_can_hear_it() -> None:
    """The button has discovered the new slave before the slave has discovered the button."""
    found = run_seed(217, (Fault(1.679, "kill", "slave_side", 0.205, 0.5), Fault(2.45, "press", "", 0.689, 0.455767)))
    assert found.broken == ()
    assert found.sometimes[UNKNOWN_STOP]


@pytest.mark.slow
def test_a_press_that_is_on_the_way_when_a_delay_ends_is_waited_for() -> None:
    faults = (Fault(3.27, "delay", "teleop_session", 1.239, 0.961), Fault(4.269, "press", "", 0.392, 0.153))
    assert run_seed(830008, faults, None, Processes.ONE, 0.0005).broken == ()


def test_each_law_has_a_mutant_that_breaks_it() -> None:
    assert set(FOUND_BY_LAWS) == set(LAWS)


@pytest.mark.slow
@pytest.mark.parametrize(
    "mutant",
    [
        pytest.param(one, marks=[pytest.mark.soak] * (k % 3 > 0), id=one.name)
        for k, one in enumerate(FOUND_BY_LAWS.values())
    ],
)
def test_a_schedule_finds_what_a_law_forbids(mutant: Mutant) -> None:
    """The other mutants, and that no schedule breaks a law of the sound package: make drill-mutants."""
    schedule = mutant.schedule
    assert schedule is not None
    assert schedule.law in dict(scheduled(mutant, schedule))
