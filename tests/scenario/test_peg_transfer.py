"""Peg transfer in its three kinds: what the task says is what the board says, step by step."""

from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.base.errors import ParameterError
from teleop_core.graph.topics import TASK_STATE
from teleop_core.hand.tasks import MEMORY, SCENE, Act, Miss
from teleop_core.hand.tasks.peg_transfer import PEG_TRANSFER, PegTransferParameters
from teleop_core.hand.tasks.transfer import STEPS
from teleop_core.kernels.geometry import Array

COLUMN = {name: i for i, name in enumerate(TASK_STATE.columns)}
AT = {name: i for i, name in enumerate(SCENE)}
SEEING: dict[str, Any] = {
    "teleop.stages": ["jaw_command", "jaw", "jaw_sim", "display", "task"],
    "operator": "observer",
    "operator.tremor_amplitude": 0.0,
    "operator.buttons.jaw": (),
    "task": "peg_transfer",
    "jaw_sim.pegs.clearance": 0.003,
    "task.peg_transfer.clearance": 0.003,
}
TWO: dict[str, Any] = {"jaw_sim.second_base": (0.0, -0.03, 0.0), "right/seed": 2}


def transferred(arms: str, duration: float, more: dict[str, Any] | None = None) -> tc.Recording:
    """Session of a kind of transfer by one or two people who see."""
    names = [] if arms == "one" else ["left", "right"]
    settings = {**SEEING, **(TWO if names else {}), "task.peg_transfer.arms": arms, **(more or {})}
    return tc.run("peg_transfer", duration=duration, arms=names, settings=settings)


@pytest.mark.parametrize(
    ("arms", "duration", "counts"), [("one", 32.0, [3]), ("two", 26.0, [2, 1]), ("hand_over", 45.0, [3, 3])]
)
def test_every_kind_of_transfer_is_done_and_told_as_the_board_tells_it(
    arms: str, duration: float, counts: list[int]
) -> None:
    recording = transferred(arms, duration)
    for score, count in zip(recording.scores(), counts, strict=True):
        assert score.value("task.attempts") == score.value("task.successes") == count
        assert score.value("transfer.transferred") == 3
        assert score.value("transfer.dropped") == 0
        # Each moment of a transfer is in one of its steps, but those in which an arm waits.
        steps = sum(score.value(f"step_s.{name}") or 0.0 for name in STEPS[1:])
        time = score.value("task.time_s") or 0.0
        waits = arms == "hand_over" and score.session.arm == "left"
        assert steps < time if waits else steps == pytest.approx(time, abs=0.05)


def test_a_session_may_end_with_its_tasks_and_is_the_same_until_then() -> None:
    whole, short = (transferred("two", 40.0, {"teleop.ends_with_task": ends}) for ends in (False, True))
    tasks = [name for name in short.topics if name.endswith("task/state")]
    for name in tasks:
        states = [one[name].values for one in (whole, short)]
        count = len(states[1])
        assert states[1][-1, COLUMN["is_over"]] == 1.0
        assert count < 30_000
        assert np.array_equal(states[0][:count], states[1])
    assert min(short[name].values[-1001, COLUMN["is_over"]] for name in tasks) == 0.0


@pytest.mark.slow
def test_the_time_of_a_transfer_is_a_straight_line_over_the_delay() -> None:
    """Ferrell 1965: the number of waits does not depend on the delay."""
    times = []
    for delay in (0.0, 1.0, 2.0):
        behind: dict[str, Any] = {
            "teleop.stages": ["network", *SEEING["teleop.stages"]],
            "network.there.least_delay": delay,
            "feedback_timeout": 5.0,
            "operator.observer.longest_wait": 6.0,
            "task.peg_transfer.longest": 600.0,
        }
        times.append(transferred("one", 35.0 + 65.0 * delay, behind).score().value("task.time_s") or 999.0)
    assert times[2] == pytest.approx(2.0 * times[1] - times[0], rel=0.1)  # as in the experiment move_and_wait


def test_in_a_hand_over_the_first_lets_go_once_the_second_holds() -> None:
    recording = transferred("hand_over", 14.0)
    first, second = (recording[f"{arm}slave/jaw/grip"] for arm in ("", "right/"))
    taken = second.stamp_ns[np.flatnonzero(second.values[:, 1] > 0.0)[0]]
    let_go = first.stamp_ns[np.flatnonzero(np.diff(first.values[:, 1]) < 0.0)[0] + 1]
    assert let_go > taken
    told = recording["task/state"]
    asked = told.stamp_ns[told.values[:, COLUMN["step"]] == STEPS.index("release")][0]
    assert taken <= asked < let_go
    for arm, steps in (("", STEPS[1:8]), ("right/", ("meet", "take", "release", "carry", "place"))):
        found = recording[f"{arm}task/state"].values[:, COLUMN["step"]].astype(int)
        order = [STEPS[a] for a, b in zip(found[1:], found[:-1], strict=True) if a != b]
        assert tuple(order[: len(steps)]) == steps


class Board:
    """A task before a board of two blocks that the test moves by hand."""

    def __init__(self, **given: Any) -> None:
        self.numbers = PEG_TRANSFER.numbers(PegTransferParameters(**given))
        self.memory, self.scene = np.zeros(MEMORY), np.zeros(len(SCENE))
        self.state = np.zeros(len(TASK_STATE.columns))
        self.put(0, [0.2, -0.2, -0.1])
        self.put(1, [0.25, -0.2, -0.1])
        self.tick()

    def put(self, block: int, place: Any) -> None:
        """Say where a block is."""
        self.scene[AT[f"x{block}"] : AT[f"x{block}"] + 3] = place

    def tick(self, time: float = 0.001) -> None:
        """Let the task judge."""
        PEG_TRANSFER.judge(self.numbers, self.memory, self.scene, self.state)
        self.scene[0] += time

    def go(self, step: str) -> None:
        """Do as the task says until a step; the tip is where it shall be."""
        for _ in range(20):
            if STEPS[int(self.state[COLUMN["step"]])] == step:
                return
            self.scene[1:4] = self.state[COLUMN["goal_x"] : COLUMN["goal_x"] + 3]
            self.scene[AT["grips"]] = float(self.state[COLUMN["act"]] == Act.GRIP)
            self.tick()
        raise AssertionError(step)

    def rest(self, place: Any, *, on_peg: bool) -> Array:
        """The first block comes to rest; returns ``task/state``."""
        self.go("place")
        self.scene[AT["grips"]] = 0.0
        self.scene[AT["transferred" if on_peg else "dropped"]] += 1.0
        self.put(0, place)
        self.tick()
        return self.state


@pytest.mark.parametrize(
    ("place", "on_peg", "miss"),
    [
        ([0.2, -0.24, -0.1], True, Miss.NONE),
        ([0.2014, -0.24, -0.1], True, Miss.NONE),
        ([0.2014, -0.24, -0.1], False, Miss.DROP),
        ([0.25, -0.24, -0.1], True, Miss.WRONG),
        ([0.22, -0.24, -0.1], False, Miss.DROP),
    ],
)
def test_a_block_counts_on_the_peg_of_its_colour_alone(place: list[float], on_peg: bool, miss: Miss) -> None:
    state = Board(tries=1).rest(place, on_peg=on_peg)
    assert state[COLUMN["miss"]] == miss
    assert state[COLUMN["successes"]] == (miss == Miss.NONE)
    assert state[COLUMN["attempts"]] == 1
    assert STEPS[int(state[COLUMN["step"]])] == "reach"  # of the second block
    assert state[COLUMN["goal_x"]] == 0.25


def test_a_transfer_that_takes_too_long_is_late_and_the_last_one_ends_the_task() -> None:
    board = Board(longest=5.0)
    for count in (1, 2):
        board.tick(5.1)
        board.tick()
        assert board.state[COLUMN["errors"]] == count
        assert board.state[COLUMN["miss"]] == Miss.LATE
    assert STEPS[int(board.state[COLUMN["step"]])] == "wait"
    board.tick(100.0)
    board.tick()
    assert board.state[COLUMN["attempts"]] == 2


def test_a_dropped_block_is_taken_up_again_where_it_lies_as_often_as_it_may() -> None:
    board = Board(tries=2)
    state = board.rest([0.22, -0.23, -0.1], on_peg=False)
    assert (state[COLUMN["errors"]], STEPS[int(state[COLUMN["step"]])]) == (1, "reach")
    assert state[COLUMN["goal_x"] : COLUMN["goal_x"] + 3].tolist() == [0.22, -0.23, -0.1]
    state = board.rest([0.2, -0.24, -0.1], on_peg=True)
    assert (state[COLUMN["attempts"]], state[COLUMN["successes"]], state[COLUMN["goal_x"]]) == (2, 1, 0.25)
    board = Board(tries=2)
    for _ in range(2):
        state = board.rest([0.22, -0.23, -0.1], on_peg=False)
    assert (state[COLUMN["errors"]], state[COLUMN["goal_x"]]) == (2, 0.25)


def test_a_late_block_that_is_held_is_carried_on_in_the_same_step() -> None:
    board = Board(longest=5.0)
    board.go("carry")
    goal = board.state[1:6].copy()
    board.tick(5.1)
    board.tick()
    assert (board.state[COLUMN["errors"]], board.state[COLUMN["miss"]]) == (1, Miss.LATE)
    assert STEPS[int(board.state[COLUMN["step"]])] == "carry"
    assert np.array_equal(board.state[1:6], goal)


def test_the_board_of_the_uva_study_leads_each_colour_to_its_peg() -> None:
    made = tc.configuration("uva_board")
    jaw, task = made.group("jaw_sim"), made.group("task").kind.parameters.ways
    blocks = np.reshape(jaw.object.place, (6, 3))[:, :2]
    pegs = np.reshape(jaw.pegs.place, (12, 2))
    assert np.array_equal(blocks, pegs[:6])
    assert blocks + np.reshape(task, (6, 2)) == pytest.approx(pegs[6:], abs=1e-12)
    printed = [-33, -27, -21.5, -7.1, 1.5, -7.1, -21.5, -46.9, 1.5, -46.9, 13, -27]
    assert 1e3 * pegs[6:].ravel() == pytest.approx(printed)


def test_ways_are_one_or_six() -> None:
    with pytest.raises(ParameterError) as caught:
        PegTransferParameters(ways=(0.0, 0.1, 0.2))
    assert caught.value.name == "task.peg_transfer.ways"
