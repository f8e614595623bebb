"""The prediction of five studies, and the tasks that they need."""

import csv
from importlib.resources import files

import numpy as np
import pytest

from teleop_core.graph.layers import config_folder
from teleop_core.graph.topics import TASK_STATE
from teleop_core.hand.tasks import MEMORY, SCENE, Act, Task
from teleop_core.hand.tasks.catch import CATCH, CatchParameters
from teleop_core.hand.tasks.point import POINT, PointParameters
from teleop_core.hand.tasks.trace import TRACE, TraceParameters
from teleop_lab.experiments import blind
from teleop_lab.studies.study import read_study

COLUMN = {name: i for i, name in enumerate(TASK_STATE.columns)}
LAGS = ("0", "62.5", "125", "250")
CELLS = {
    "a_instructions": [
        f"{i}_{a}_{w}" for i in ("neutral", "fast", "accurate") for a in (400, 770) for w in (8, 24, 70)
    ],
    "b_one_click": [f"{kind}_{lag}" for kind in ("still", "straight") for lag in LAGS],
    "c_latency_rounds": [f"lag_{lag}" for lag in (0, 75, 150, 225)],
    "d_teleoperated_ring": ["118_20", "236_20", "118_10", "236_10"],
    "e_small_course": [
        f"{cell}_{lag}" for cell in ("40_400", "60_400", "90_400", "60_250", "60_550", "pooled") for lag in (0, 150)
    ],
}
MEASURES = {"a_instructions": 4, "b_one_click": 5, "c_latency_rounds": 4, "d_teleoperated_ring": 2, "e_small_course": 3}


class Judged:
    """A task, and a tip and a hand that go where they are told."""

    def __init__(self, task: Task, parameters: object) -> None:
        self._task, self._numbers = task, task.numbers(parameters)
        self._memory, self.scene = np.zeros(MEMORY), np.zeros(len(SCENE))
        self.state = np.zeros(len(TASK_STATE.columns))
        self.scene[1:4] = 0.3, 0.0, 0.0
        self.judge()

    def judge(self, time: float = 0.0) -> None:
        """One tick at a later time [s]."""
        self.scene[0] += time
        self._task.judge(self._numbers, self._memory, self.scene, self.state)

    def press(self) -> None:
        """Close the hand and open it."""
        for closing in (1.0, 0.0):
            self.scene[SCENE.index("closing")] = closing
            self.judge(1e-3)

    @property
    def goal(self) -> np.ndarray:
        """Where the goal is (3,) [m]."""
        return self.state[COLUMN["goal_x"] : COLUMN["goal_x"] + 3].copy()

    def value(self, name: str) -> float:
        """A number of ``task/state``."""
        return float(self.state[COLUMN[name]])


@pytest.mark.parametrize("study", CELLS)
def test_every_cell_of_a_design_is_predicted_once_with_an_interval_around_it(study: str) -> None:
    rows = [row for row in blind.registered() if row.study == study]
    main = [row for row in rows if "@" not in row.cell]
    assert sorted({row.cell for row in main}) == sorted(CELLS[study])
    assert len(main) == len({row[:3] for row in main}) == MEASURES[study] * len(CELLS[study])
    assert all(row.low <= row.predicted <= row.high for row in rows)


def test_both_simpler_models_predict_a_time_in_each_cell_that_is_not_a_mean_of_cells() -> None:
    with files("teleop_lab.experiments").joinpath("blind_simple.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    cells = sum(len(cells) for cells in CELLS.values()) - 2
    assert len(rows) == 2 * cells
    assert {(row["study"], row["cell"]) for row in rows} <= {(s, c) for s, cells in CELLS.items() for c in cells}
    assert [row["predicted"] for row in rows] == [f"{row[4]:.4g}" for row in blind.predict_simply()]


@pytest.mark.parametrize("study", CELLS)
def test_the_file_of_each_study_describes_sessions_that_can_run(study: str) -> None:
    assert read_study(config_folder() / "studies" / f"blind_{study}.yaml").points()


def test_a_target_that_stays_is_set_anew_only_by_a_hit_and_its_time_runs_on() -> None:
    task = Judged(POINT, PointParameters(stays=True))
    first, number = task.goal, task.value("number")
    task.judge(1.0)
    task.press()
    assert (task.goal == first).all()
    assert (task.value("errors"), task.value("number")) == (1.0, number + 1.0)
    task.scene[1:4] = first
    task.judge(1.0)
    task.press()
    assert task.value("successes") == 1.0
    assert task.value("time") == pytest.approx(2.002, abs=0.002)
    assert np.linalg.norm(task.goal - first) > 0.02


@pytest.mark.parametrize("stays", [False, True])
def test_a_ring_by_entering_counts_the_tip_inside_once_without_a_press(stays: bool) -> None:
    task = Judged(POINT, PointParameters(by_entering=True, stays=stays))
    assert task.value("act") == Act.PASS
    for count in range(1, 4):
        task.scene[1:4] = task.goal
        task.judge(0.5)
        assert (task.value("attempts"), task.value("successes")) == (count, count)


def test_a_point_that_waits_goes_on_by_a_step_each_time_the_tip_is_near() -> None:
    parameters = TraceParameters(waits=True, diameter=0.04, step=0.5, period=4.0)
    task = Judged(TRACE, parameters)
    begin = task.goal.copy()
    for count in range(1, 5):
        task.scene[1:4] = begin + np.array([0.1, 0.0, 0.0])
        task.judge(3.0)
        assert task.value("attempts") == count - 1, "it waits, whatever the time"
        task.scene[1:4] = task.goal
        task.judge(0.002)
        assert task.value("successes") == count
    assert task.goal - begin == pytest.approx([0.0, 0.0, 0.04], abs=1e-12)  # half of the ring in four of eight steps


def test_a_target_to_catch_accelerates_from_rest_and_one_press_ends_the_turn() -> None:
    task = Judged(CATCH, CatchParameters(acceleration=0.2, distance=0.02))
    begin = task.goal
    assert np.linalg.norm(begin - task.scene[1:4]) == pytest.approx(0.02)
    task.judge(0.5)
    assert np.linalg.norm(task.goal - begin) == pytest.approx(0.5 * 0.2 * 0.25)
    task.scene[1:4] = task.goal
    task.press()
    assert task.value("attempts") == 1.0
    assert task.value("miss") == 0.0
    assert np.linalg.norm(task.goal - task.scene[1:4]) == pytest.approx(0.02, rel=1e-3)
