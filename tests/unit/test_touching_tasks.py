"""Tasks that touch something: palpate and insert, in worlds that the tests make themselves."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.graph.topics import TASK_STATE
from teleop_core.hand.tasks import MEMORY, SCENE, Miss, Task
from teleop_core.hand.tasks.insert import INSERT, InsertParameters
from teleop_core.hand.tasks.palpate import PALPATE, PalpateParameters

COLUMN = {name: i for i, name in enumerate(TASK_STATE.columns)}
DT = 0.01
SEEING: dict[str, Any] = {
    "teleop.stages": ["display", "task"],
    "operator": "observer",
    "operator.tremor_amplitude": 0.0,
}
Push = Callable[[np.ndarray], np.ndarray]


class Judged:
    """A task, a tip that goes where it is told, and a world that pushes by its place."""

    def __init__(self, task: Task, parameters: Any, tip: np.ndarray, push: Push) -> None:
        self._task, self._numbers, self.tip, self._push = task, task.numbers(parameters), tip, push
        self._memory, self._scene = np.zeros(MEMORY), np.zeros(len(SCENE))
        self.state = np.zeros(len(TASK_STATE.columns))
        self.judge()

    def judge(self) -> None:
        """One tick."""
        self._scene[1:4], self._scene[9:12] = self.tip, self._push(self.tip)
        self._task.judge(self._numbers, self._memory, self._scene, self.state)
        self._scene[0] += DT

    def follow(self, time: float, speed: float = 0.05) -> None:
        """Go towards the goal for a time [s], no faster than a speed [m/s]."""
        for _ in range(round(time / DT)):
            way = self.goal - self.tip
            self.tip = self.tip + way * min(1.0, speed * DT / max(float(np.linalg.norm(way)), 1e-12))
            self.judge()

    @property
    def goal(self) -> np.ndarray:
        """Where the goal is (3,) [m]."""
        return np.array(self.state[COLUMN["goal_x"] : COLUMN["goal_x"] + 3])

    def value(self, name: str) -> float:
        """A number of ``task/state``."""
        return float(self.state[COLUMN[name]])


def ground(stiffness: float) -> Push:
    """A spring [N/m] below z = 0 that pushes straight up."""
    return lambda tip: np.array([0.0, 0.0, stiffness * max(-tip[2], 0.0)])


def test_a_place_is_palpated_once_the_force_was_right_for_as_long_as_asked() -> None:
    p = PalpateParameters(force=1.0, tolerance=0.2, hold=0.5, yielding=0.005)
    one = Judged(PALPATE, p, np.array([0.3, 0.0, 0.02]), ground(200.0))
    while one.tip[2] > -0.8 / 200.0 - 1e-4:  # 0.8 N is the least that is right
        assert one.value("attempts") == 0
        one.follow(DT)
    one.follow(0.45)
    assert one.value("attempts") == 0
    one.follow(0.1)
    assert (one.value("attempts"), one.value("successes")) == (1, 1)
    assert one.goal[2] == 0.02  # it goes up again first
    assert one.value("miss") == Miss.NONE


def test_places_lie_in_a_row_around_the_beginning() -> None:
    p = PalpateParameters(count=3, spacing=0.01)
    one = Judged(PALPATE, p, np.array([0.3, 0.1, 0.02]), ground(200.0))
    places = [one.goal]
    while len(places) < 4:
        number = one.value("number")
        while one.value("number") == number:
            one.follow(DT)
        places.append(one.goal)
    y = [float(place[1]) for place in places]
    assert y == pytest.approx([0.09, 0.1, 0.11, 0.09])
    assert [float(place[2]) for place in places] == [0.02] * 4


def test_pressing_too_hard_and_taking_too_long_are_errors_of_their_kind() -> None:
    hard = Judged(PALPATE, PalpateParameters(most=2.0), np.array([0.3, 0.0, 0.01]), ground(200.0))
    hard.follow(0.5)  # above the place
    hard.tip = hard.goal * [1.0, 1.0, 0.0] + [0.0, 0.0, -2.1 / 200.0]
    hard.judge()
    assert (hard.value("errors"), hard.value("miss")) == (1, Miss.FORCE)
    hard.judge()  # it counts once
    assert hard.value("errors") == 1
    late = Judged(PALPATE, PalpateParameters(longest=3.0), np.array([0.3, 0.0, 5.0]), ground(200.0))
    late.follow(3.1)
    assert (late.value("errors"), late.value("miss")) == (1, Miss.LATE)


def test_a_way_in_counts_where_the_tip_is_as_deep_as_asked_and_the_way_out_does_not() -> None:
    p = InsertParameters(place=(0.3, 0.1, 0.0), axis=(0.0, 0.6, 0.8), depth=0.012, outside=0.01, width=0.002)
    one = Judged(INSERT, p, np.array([0.3, 0.1, 0.05]), lambda _: np.zeros(3))
    axis, mouth, last = np.array(p.axis), np.array(p.place), 0.0
    for _ in range(2000):
        one.follow(DT)
        if one.value("attempts") > last:
            last = one.value("attempts")
            way = mouth - one.tip
            assert way @ axis == pytest.approx(0.012, abs=0.001)
            assert np.linalg.norm(way - (way @ axis) * axis) < 0.001
            assert one.goal == pytest.approx(mouth + 0.01 * axis)
    assert last == one.value("successes") > 5


def test_a_wall_where_no_hole_is_is_an_error() -> None:
    p = InsertParameters(place=(0.3, 0.0, 0.0), most=1.0)
    one = Judged(INSERT, p, np.array([0.3, 0.0, 0.03]), ground(1000.0))
    one.follow(1.5)
    assert one.value("errors") >= 1
    assert one.value("successes") == 0
    assert one.value("miss") == Miss.FORCE


def test_a_person_who_sees_palpates_tissue_as_its_force_says() -> None:
    where: dict[str, Any] = {"world.place": (0.281, -0.236, -0.087), "task": "palpate"}
    recording = tc.run("palpation", duration=20.0, settings={**SEEING, **where})
    told, force = recording["task/state"], recording["slave/true_cf"]
    ends = told.stamp_ns[1:][np.diff(told.values[:, COLUMN["attempts"]]) > 0.0]
    assert len(ends) >= 2
    assert recording.score().value("task.successes") == len(ends)
    for end in ends:
        held = (force.stamp_ns > end - 480_000_000) & (force.stamp_ns < end)
        assert force.values[held, 2] == pytest.approx(0.5, abs=0.21)


def test_a_person_who_sees_leads_a_peg_into_its_hole_and_hard_walls_are_felt() -> None:
    hole: dict[str, Any] = {
        **SEEING,
        "task": "insert",
        "task.insert.place": (0.258, -0.2749, -0.0512),
        "task.insert.axis": (-0.9178, 0.0, 0.3971),
    }
    easy, hard = (tc.run("peg", duration=12.0, settings={**hole, "task.insert.most": most}) for most in (3.0, 0.05))
    depth = (easy["slave/true_cp"].values[:, :3] - [0.258, -0.2749, -0.0512]) @ [0.9178, 0.0, -0.3971]
    assert depth[easy["slave/true_cp"].stamp_ns > easy.bag.start_ns + 6_000_000_000].max() > 0.008
    assert easy.score().value("task.successes") == easy.score().value("task.attempts") != 0
    assert (hard.score().value("task.forced") or 0) > 0
    assert hard.score().value("task.forced_share") == hard.score().value("task.error_share")
    assert easy.score().value("task.forced_share") == 0.0
    assert hard.score().value("task.forced") == round(
        (hard.score().value("task.error_share") or 0.0) * (hard.score().value("task.attempts") or 0)
    )
