"""Visits: in each kind of session the laws hold, and a program uses it as clients, displays and supervisors do."""

from contextlib import closing
from functools import cache

import pytest

from teleop_core.nodes.crews import Processes
from teleop_drill.simulation.branches import Branches
from teleop_drill.simulation.planned import Schedule
from teleop_drill.simulation.schedules import Fault, draw
from teleop_drill.simulation.seeds import PROCESSES, Found, Starts
from teleop_drill.simulation.visits import PLAIN, SESSIONS, Visitor

pytestmark = pytest.mark.slow
SIDES = PROCESSES[Processes.SIDES]


@pytest.mark.parametrize("node", ["haptic_master", "motion_scaling"])
def test_a_node_that_a_supervisor_makes_anew_between_two_ticks_is_connected_again(
    node: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All four changes of state come in one turn of the executor: the loop sees the node at work before and after."""

    def change(self: Visitor) -> int:
        while not self.may_act:
            self.listen()
        self.change(node, ("deactivate", "cleanup", "configure", "activate"))
        while True:
            self.listen()

    monkeypatch.setattr(Visitor, "run", change)
    found = Schedule(1, (Fault(2.0, "hiccups", "", 0.1, 0.3),), session="visited").run()
    assert found.broken == ()
    assert found.seconds < 15.0


@cache
def ran(session: str) -> tuple[Found, frozenset[str]]:
    """Result of a schedule, and the branches of CRTK's commands that ran."""
    with closing(Starts(Branches())) as starts:
        found, branches = Schedule(3, draw(3, SIDES)[:2], session=session).run_in(starts)
    return found, frozenset(one for one in branches if one.startswith("nodes/crtk"))


@pytest.mark.parametrize("session", SESSIONS)
def test_all_laws_hold_in_each_kind_of_session_and_all_but_the_plain_one_are_visited(session: str) -> None:
    found, branches = ran(session)
    assert found.broken == ()
    is_visited = bool(branches - ran(PLAIN)[1])  # the visitor sends commands of all kinds
    assert is_visited is (session != PLAIN)


def test_a_visited_schedule_has_the_same_result_again() -> None:
    schedule = Schedule(8, draw(8, SIDES)[:1], session="visited")
    with closing(Starts()) as starts:
        assert schedule.run_in(starts)[0] == schedule.run()
