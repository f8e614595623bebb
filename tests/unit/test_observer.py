"""The operator who sees: alone before a screen, without arm and device."""

from collections import deque

import numpy as np
import pytest
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.chain.operators.observer import AHEAD, Observer, ObserverParameters
from teleop_core.chain.operators.parameters import OperatorParameters
from teleop_core.chain.tasks import Act
from teleop_core.graph import STATE, topics

Array = NDArray[np.float64]
# MacKenzie and Ware 1993: lags of the screen [s], mean times of movement [s].
PUBLISHED = {0.0083: 0.911, 0.025: 0.934, 0.075: 1.059, 0.225: 1.493}
WAYS, WIDTHS = (0.096, 0.192, 0.384), (0.006, 0.012, 0.024, 0.048)
TICK = 1e-3
COLUMN = {name: i for i, name in enumerate(topics.TASK_STATE.columns)}


def pointing(lag: float, way: float, width: float, trials: int, seed: int = 1) -> list[float]:
    """Times [s] from target to target of an observer whose pointer is seen late, to and fro."""
    seen = tc.Seen(np.zeros(7), np.zeros(7), np.zeros(6), np.zeros(len(STATE)), np.zeros(len(COLUMN)))
    seen.slave[3] = seen.state[STATE["gain"]] = 1.0
    p = ObserverParameters(fastest=10.0, noise_across=0.0, axes=("+x", "+y", "+z"))
    setting = tc.Setting(OperatorParameters(), np.zeros((6, 4)), seed, seen)
    person = Observer(p, setting)
    late = round(lag / TICK)
    begins = np.array([0.3, -0.2, 0.0])  # of the pointer: a tip at 0 is one that nobody told
    seen.slave[:3] = begins
    pointer = deque([begins] * (late + 1), maxlen=late + 1)
    task, begin, closed = seen.task, 0.0, 0.0
    times: list[float] = []
    task[COLUMN["number"]], task[COLUMN["width"]] = 1.0, width
    goal = task[COLUMN["goal_x"] : COLUMN["goal_x"] + 3]
    goal[:] = begins + np.array([way, 0.0, 0.0])
    tick = 0
    while len(times) < trials:
        assert tick < 10_000 * trials, "it does not press"
        block = np.arange(tick + 1, tick + 1 + AHEAD, dtype=np.float64) * TICK
        for time, row in zip(block, person(block), strict=True):
            pointer.append(begins + row[:3])
            if row[12] > closed:
                times.append(time - begin)
                begin = time
                task[COLUMN["number"]] += 1.0
                goal[0] = begins[0] + (way if goal[0] == begins[0] else 0.0)
            closed = row[12]
        seen.slave[:3] = pointer[0]
        tick += AHEAD
    return times


@pytest.mark.parametrize("lag", PUBLISHED)
def test_a_person_who_sees_late_takes_as_long_as_people_did(lag: float) -> None:
    means = [
        np.mean(pointing(lag, way, width, 24, seed))
        for seed, (way, width) in enumerate((w, v) for w in WAYS for v in WIDTHS)
    ]
    assert np.mean(means) == pytest.approx(PUBLISHED[lag], rel=0.06)


def test_a_smaller_target_takes_longer_and_so_does_a_farther_one() -> None:
    near, far, small = (
        np.mean(pointing(0.02, way, width, 30)) for way, width in ((0.1, 0.02), (0.4, 0.02), (0.1, 0.005))
    )
    assert far > near
    assert small > near


@pytest.mark.parametrize("lag", [0.02, 0.2])
def test_a_goal_that_is_suddenly_elsewhere_is_not_run_after_as_one_that_moves(lag: float) -> None:
    seen = tc.Seen(np.zeros(7), np.zeros(7), np.zeros(6), np.zeros(len(STATE)), np.zeros(len(COLUMN)))
    seen.slave[3] = seen.state[STATE["gain"]] = 1.0
    p = ObserverParameters(fastest=10.0, noise=0.0, axes=("+x", "+y", "+z"))
    person = Observer(p, tc.Setting(OperatorParameters(), np.zeros((6, 4)), 1, seen))
    begins, way, late = np.array([0.3, -0.2, 0.0]), 0.1, round(lag / TICK)
    pointer, went = deque([begins] * (late + 1), maxlen=late + 1), list[float]()
    seen.task[COLUMN["number"]], seen.task[COLUMN["act"]], seen.task[COLUMN["width"]] = 1.0, Act.PASS, 0.01
    goal = seen.task[COLUMN["goal_x"] : COLUMN["goal_x"] + 3]
    goal[:] = begins
    for tick in range(0, 4000, AHEAD):
        goal[0] = begins[0] + (way if tick > 1000 else 0.0)
        seen.slave[:3] = pointer[0]
        for row in person(np.arange(tick + 1, tick + 1 + AHEAD, dtype=np.float64) * TICK):
            pointer.append(begins + row[:3])
            went.append(row[0])
    assert max(went) < way + 0.005
    assert went[-1] == pytest.approx(way, abs=0.005)


def test_nobody_moves_without_a_goal() -> None:
    seen = tc.Seen(*(np.zeros(n) for n in (7, 7, 6, len(STATE), len(COLUMN))))
    person = Observer(ObserverParameters(), tc.Setting(OperatorParameters(), np.zeros((6, 4)), 1, seen))
    rows = np.vstack([person(np.arange(16 * k, 16 * k + 16, dtype=np.float64) * TICK) for k in range(100)])
    assert not rows.any()


def test_an_operator_who_needs_a_task_is_refused_without_one() -> None:
    with pytest.raises(tc.ParameterError, match=r"observer.*teleop.stages=\[task\]"):
        tc.configuration(operator="observer")
