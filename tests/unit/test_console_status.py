"""Status: who leads, what to do next, and how old what is seen is."""

import math

import numpy as np
import pytest

from teleop_console.link import ArmView, View
from teleop_console.status import closes, facts, leader, next_step, status_html, task_text
from teleop_core.graph.operation import State
from teleop_core.graph.topics import TASK_STATE
from teleop_core.hand.operators import OPERATORS
from teleop_core.hand.tasks import Act, Miss


def view_of(state: State, *, is_clutched: bool = False) -> View:
    operation = {"state": float(state), "fault": 0.0}
    told = {"is_clutched": float(is_clutched), "is_fine": 0.0, "gain": 1.0, "is_fixture_on": 0.0}
    arm = ArmView(state=told, operation=operation)
    return View(arms={"": arm}, is_fresh=True)


@pytest.mark.parametrize(
    ("state", "is_clutched", "is_led_here", "told"),
    [
        (State.FAULT, False, True, "Initialize"),
        (State.DISABLED, False, False, "Initialize"),
        (State.PAUSED, True, True, "Start"),
        (State.ENABLED, True, True, "drag the stylus"),
        (State.ENABLED, False, True, ""),
        (State.ENABLED, True, False, ""),
    ],
)
def test_next_step_is_the_button_that_is_blue_or_the_stylus_or_nothing(
    state: State, is_clutched: bool, is_led_here: bool, told: str
) -> None:
    step = next_step(view_of(state, is_clutched=is_clutched), is_led_here=is_led_here)
    assert step.startswith(told)
    assert bool(step) == bool(told)


@pytest.mark.parametrize("kind", list(OPERATORS))
def test_whoever_is_not_the_person_at_the_page_is_said_to_lead(kind: str) -> None:
    assert bool(leader(kind)) == (kind != "remote")


def test_ages_and_rate_are_told_as_far_as_they_are_known() -> None:
    assert facts(View()) == ""
    known = View(rate=1000.2, delay=(0.0013, 0.004), age=0.033)
    assert facts(known) == "1000 Hz · command 1.3 ms · picture 33 ms old"
    known.delay = (math.nan, math.nan)
    assert facts(known) == "1000 Hz · picture 33 ms old"
    known.phases = {"take": 0.0001, "step": 0.0002}
    assert facts(known) == "1000 Hz · tick 0.30 ms (take 0.10, step 0.20) · picture 33 ms old"


def test_nothing_is_red_that_is_not_wrong() -> None:
    for state in State:
        shown = status_html(view_of(state, is_clutched=True), "wall", "run 1", "next")
        assert ("t-wrong" in shown) == (state is State.FAULT)
    silent = view_of(State.ENABLED)
    silent.is_fresh = False
    assert "t-wrong" in status_html(silent, "wall", "run 1")


def arm_at_a_task(**told: float) -> ArmView:
    row = np.array([told.get(name, 0.0) for name in TASK_STATE.columns])
    return ArmView(streams={TASK_STATE.name: row})


def test_a_task_is_told_with_its_attempts_and_what_was_wrong_with_the_last() -> None:
    assert task_text(ArmView()) == ""
    assert task_text(arm_at_a_task(number=0)) == ""  # not begun
    begun = arm_at_a_task(number=1, act=Act.PRESS)
    assert task_text(begun) == "Task: press at the goal"
    tried = arm_at_a_task(number=4, act=Act.GRIP, attempts=3, successes=2, time=1.24, miss=Miss.DROP)
    assert task_text(tried) == (
        "Task: go to the goal, jaw closed · 2 of 3 attempts reached their goal · last 1.2 s, dropped"
    )


@pytest.mark.parametrize("act", list(Act))
@pytest.mark.parametrize("miss", list(Miss))
def test_every_act_and_every_error_has_words(act: Act, miss: Miss) -> None:
    text = task_text(arm_at_a_task(number=2, act=act, attempts=1, miss=miss))
    assert text.startswith("Task: ")
    assert text.endswith("s") == (miss is Miss.NONE)


@pytest.mark.parametrize(
    ("state", "is_homed", "has_task", "told"),
    [
        (State.ENABLED, True, True, True),
        (State.ENABLED, False, True, False),
        (State.PAUSED, True, True, False),
        (State.ENABLED, True, False, False),
    ],
)
def test_a_press_is_offered_at_a_task_while_the_arm_follows(
    state: State, is_homed: bool, has_task: bool, told: bool
) -> None:
    streams = {TASK_STATE.name: np.zeros(len(TASK_STATE.columns))} if has_task else {}
    arm = ArmView(streams, operation={"state": float(state), "is_homed": float(is_homed)})
    assert closes(arm) is told
    assert not closes(ArmView(streams))
