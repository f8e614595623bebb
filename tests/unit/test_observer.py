"""The operator who sees: alone before a screen, without arm and device."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.graph import STATE, topics
from teleop_core.graph.topics import Limit
from teleop_core.hand.operators.behaviour import OperatorParameters, RoomParameters
from teleop_core.hand.operators.observer import AHEAD, Observer
from teleop_core.hand.operators.observer_parameters import ObserverParameters
from teleop_core.hand.operators.submovement import chance_inside
from teleop_core.hand.tasks import Act
from teleop_core.kernels.geometry import invert_quaternion, multiply_quaternions, rotate_by_vector
from teleop_lab.experiments import look_and_move as lm

Array = NDArray[np.float64]
# MacKenzie and Ware 1993: lags of the screen [s], mean times of movement [s].
PUBLISHED = {0.0083: 0.911, 0.025: 0.934, 0.075: 1.059, 0.225: 1.493}
WAYS, WIDTHS = (0.096, 0.192, 0.384), (0.006, 0.012, 0.024, 0.048)
TICK = 1e-3
WIDE = OperatorParameters(device=RoomParameters(workspace=(1.0, 1.0, 1.0)))
COLUMN = {name: i for i, name in enumerate(topics.TASK_STATE.columns)}


def looker(p: ObserverParameters, seed: int = 1) -> tuple[tc.Seen, Observer]:
    """A person before a screen, and what it shows."""
    seen = tc.Seen(np.zeros(7), np.zeros(7), np.zeros(6), np.zeros(len(STATE)), np.zeros(len(COLUMN)))
    seen.slave[3] = seen.state[STATE["gain"]] = 1.0
    return seen, Observer(p, tc.Setting(WIDE, np.zeros((6, 4)), seed, seen))


def pointing(lag: float, way: float, width: float, trials: int, seed: int = 1) -> list[float]:
    """Times [s] from target to target of an observer whose pointer is seen late, to and fro."""
    return pressed(lag, way, width, trials, seed)[0]


def pressed(
    lag: float, way: float, width: float, trials: int, seed: int = 1, across: float = 0.0
) -> tuple[list[float], list[float]]:
    """Times [s] and distances from the target's middle [m] of the presses of an observer who sees late."""
    seen, person = looker(ObserverParameters(fastest=10.0, noise_across=across, axes=("+x", "+y", "+z")), seed)
    late = round(lag / TICK)
    begins = np.array([0.3, -0.2, 0.0])  # of the pointer: a tip at 0 is one that nobody told
    seen.slave[:3] = begins
    pointer = deque([begins] * (late + 1), maxlen=late + 1)
    task, begin, closed = seen.task, 0.0, 0.0
    times, beside = list[float](), list[float]()
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
                beside.append(float(np.linalg.norm(pointer[-1] - goal)))
                begin = time
                task[COLUMN["number"]] += 1.0
                goal[0] = begins[0] + (way if goal[0] == begins[0] else 0.0)
            closed = row[12]
        seen.slave[:3] = pointer[0]
        tick += AHEAD
    return times, beside


@pytest.mark.parametrize("lag", PUBLISHED)
def test_a_person_who_sees_late_takes_as_long_as_people_did(lag: float) -> None:
    means = [
        np.mean(pointing(lag, way, width, 24, seed))
        for seed, (way, width) in enumerate((w, v) for w in WAYS for v in WIDTHS)
    ]
    assert np.mean(means) == pytest.approx(PUBLISHED[lag], rel=0.09)


@pytest.mark.parametrize(("lag", "missed"), [*zip(PUBLISHED, (0.036, 0.036, 0.049, 0.113), strict=True)])
def test_a_person_who_sees_late_misses_as_often_as_people_did(lag: float, missed: float) -> None:
    presses = [(lm.presses(lm.constants(), way, width, lag, count=4000), width) for way in WAYS for width in WIDTHS]
    assert np.mean([(found[:, lm.BESIDE] > 0.5 * width).mean() for found, width in presses]) == pytest.approx(
        missed, abs=0.015
    )
    assert np.mean([found[:, lm.TIME].mean() for found, _ in presses]) == pytest.approx(PUBLISHED[lag], rel=0.07)


@pytest.mark.parametrize(("lag", "way", "width"), [(0.008, 0.384, 0.012), (0.2, 0.192, 0.024)])
def test_the_rules_alone_take_as_long_as_the_operator_at_a_screen(lag: float, way: float, width: float) -> None:
    p = lm.constants(dimensions=1)
    alone = lm.presses(p, way, width, lag)[:, lm.TIME].mean()
    assert np.mean(pointing(lag, way, width, 150)[1:]) == pytest.approx(alone, rel=0.08)


def test_an_operator_at_a_screen_misses_as_often_as_the_rules_alone() -> None:
    found = lm.presses(lm.constants(dimensions=1), 0.2, 0.02, 0.2)
    beside = np.array(pressed(0.2, 0.2, 0.02, 300)[1])
    assert (beside > 0.01).mean() == pytest.approx((found[:, lm.BESIDE] > 0.01).mean(), abs=0.045)


def test_only_a_goal_that_is_believed_inside_is_pressed_however_late_the_screen_is() -> None:
    beside = np.array(pressed(1.0, 0.2, 0.02, 60)[1])
    assert (beside > 0.01).mean() < 0.35


def test_a_goal_that_runs_away_is_tried_before_it_is_pressed() -> None:
    bench = Bench(ObserverParameters(**PLAIN))
    bench.ask(np.array([0.1, 0.0, 0.0]), Act.PRESS, 0.01)
    while not bench.rows or bench.rows[-1][12] == 0.0:
        assert len(bench.rows) < 3000, "it never presses"
        bench.seen.task[COLUMN["goal_x"]] += 0.4 * 0.016
        bench.go_on(0.016)
    assert np.linalg.norm(bench.tip[:3] - np.array([0.3, -0.2, 0.0])) > 0.1


def test_who_fears_errors_more_looks_more_often_and_misses_less() -> None:
    looks, misses = list[float](), list[float]()
    for cost in (0.4, 0.9, 4.0):
        p = lm.constants()
        p[6] = cost
        found = lm.presses(p, 0.2, 0.02, 0.1)
        looks.append(found[:, lm.LOOKS].mean())
        misses.append((found[:, lm.BESIDE] > 0.01).mean())
    assert looks == sorted(looks)
    assert misses == sorted(misses, reverse=True)


@pytest.mark.parametrize(("off", "spread", "chance"), [(0.0, 0.5, 0.6827), (1.0, 0.0, 0.0), (0.5, 1e-9, 0.5)])
def test_the_believed_chance_is_that_of_a_normal_error(off: float, spread: float, chance: float) -> None:
    assert chance_inside(off, spread, 1.0) == pytest.approx(chance, abs=1e-4)


def test_a_smaller_target_takes_longer_and_so_does_a_farther_one() -> None:
    near, far, small = (
        np.mean(pointing(0.02, way, width, 30)) for way, width in ((0.1, 0.02), (0.4, 0.02), (0.1, 0.005))
    )
    assert far > near
    assert small > near


def test_nobody_begins_while_the_arm_is_seen_to_go_to_its_start() -> None:
    seen, person = looker(ObserverParameters(fastest=10.0, axes=("+x", "+y", "+z")))
    seen.task[COLUMN["number"]], seen.task[COLUMN["width"]], seen.task[COLUMN["goal_x"]] = 1.0, 0.01, 0.2
    rests, began = 1.0, None
    for tick in range(0, 2000, AHEAD):
        seen.slave[0] = 0.1 * min(tick * TICK, rests) + 0.01
        rows = person(np.arange(tick + 1, tick + AHEAD + 1, dtype=np.float64) * TICK)
        if began is None and rows[-1, 0] != 0.0:
            began = tick * TICK
    assert began is not None
    assert rests < began < rests + 0.3


@pytest.mark.parametrize("lag", [0.02, 0.2])
def test_a_goal_that_is_suddenly_elsewhere_is_not_run_after_as_one_that_moves(lag: float) -> None:
    seen, person = looker(ObserverParameters(fastest=10.0, noise=0.0, axes=("+x", "+y", "+z")))
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
    _, person = looker(ObserverParameters())
    rows = np.vstack([person(np.arange(16 * k, 16 * k + 16, dtype=np.float64) * TICK) for k in range(100)])
    assert not rows.any()


class Bench:
    """A slave that follows the hand at once, and a person who sees it late and feels what it touches at once.

    Args:
        p: Constants of the person.
        late: How late it is seen [s].
        room: Of the hand (3,) [m], with the start in its middle.
        push: Force on the hand (3,) [N] by the place of the tip (3,) [m].
        arm: Corners of where the tip can go [m].
    """

    def __init__(
        self,
        p: ObserverParameters,
        late: float = 0.02,
        room: tuple[float, ...] = (1.0, 1.0, 1.0),
        push: Callable[[Array], Array] = np.zeros_like,
        arm: float = 10.0,
        seed: int = 1,
    ) -> None:
        self.seen = tc.Seen(np.zeros(7), np.zeros(7), np.zeros(6), np.zeros(len(STATE)), np.zeros(len(COLUMN)))
        common = OperatorParameters(device=RoomParameters(workspace=room, start=(0.0, 0.0, 0.0)))
        self.person = Observer(p, tc.Setting(common, np.zeros((6, 4)), seed, self.seen))
        self.tip = np.array([0.3, -0.2, 0.0, 1.0, 0.0, 0.0, 0.0])
        self.hand, self.aligned = np.zeros(6), self.tip[3:].copy()  # tool at a stylus that is not turned
        self._shown = deque([self.tip.copy()], maxlen=1 + round(late / TICK))
        self._push, self._arm, self._begins, self.tick = push, arm, self.tip[:3].copy(), 0
        self.rows, self.tips = list[Array](), list[Array]()
        self.seen.state[STATE["gain"]] = 1.0

    def ask(self, goal: Array, act: Act = Act.GRIP, width: float = 0.004, /, **more: float) -> None:
        """Set the next goal at a place (3,) [m] from the beginning."""
        task = self.seen.task
        task[COLUMN["number"]] += 1.0
        task[COLUMN["act"]], task[COLUMN["width"]] = act, width
        task[COLUMN["goal_x"] : COLUMN["goal_x"] + 3] = self._begins + goal
        for name, value in more.items():
            task[COLUMN[name]] = value

    def go_on(self, time: float) -> None:
        """Let the person act for a time [s]."""
        for _ in range(round(time / TICK / AHEAD)):
            self.seen.slave[:], self.seen.force[:3] = self._shown[0], self._push(self.tip[:3])
            for row in self.person(np.arange(self.tick + 1, self.tick + 1 + AHEAD, dtype=np.float64) * TICK):
                self._follow(row)
            self.tick += AHEAD

    def _follow(self, row: Array) -> None:
        turned, vector = np.empty(4), row[3:6]
        if row[6] > 0.0:  # what turns now turns the stylus alone
            back = np.empty(4)
            rotate_by_vector(np.array([1.0, 0.0, 0.0, 0.0]), vector[0], vector[1], vector[2], back)
            invert_quaternion(back, back)
            multiply_quaternions(self.tip[3:], back, self.aligned)
        else:
            wanted = self.tip[:3] + row[:3] - self.hand[:3]
            self.tip[:3] = np.clip(wanted, self._begins - self._arm, self._begins + self._arm)
            is_out = (np.abs(self.tip[:3] - self._begins) >= self._arm).any()
            self.seen.state[STATE["limit"]] = float(is_out * Limit.WORKSPACE)
            rotate_by_vector(self.aligned, vector[0], vector[1], vector[2], turned)
            self.tip[3:] = turned
        self.hand = row[:6].copy()
        self._shown.append(self.tip.copy())
        self.rows.append(row)
        self.tips.append(self.tip.copy())

    def be_late(self, late: float) -> None:
        """Show the tip with another delay [s] from now on."""
        self._shown = deque([self._shown[-1]] * (1 + round(late / TICK)), maxlen=1 + round(late / TICK))

    def times(self, goals: int) -> list[float]:
        """Times [s] to press in targets, to and fro."""
        found = list[float]()
        for i in range(goals):
            self.ask(np.array([0.0, 0.02 * (-1) ** i, 0.0]), Act.PRESS)
            begin, closed = len(self.rows), False
            while not closed:
                assert len(self.rows) - begin < 60_000, "it never presses"
                self.go_on(0.016)
                closed = self.rows[-1][12] > 0.0
            found.append((len(self.rows) - begin) * TICK)
            self.go_on(0.08)  # the press ends
        return found

    @property
    def presses(self) -> int:
        """How often the clutch was pressed."""
        return int((np.diff(np.array(self.rows)[:, 6]) > 0.0).sum())


PLAIN: dict[str, Any] = {
    "axes": ("+x", "+y", "+z"), "tool_axes": ("+x", "+y", "+z"), "fastest": 1.0, "fastest_turn": 5.0,
}  # fmt: skip


def turned_by(angle: float, axis: int = 2) -> dict[str, float]:
    """A goal's orientation: turned about an axis of the tool [rad], and 0.1 rad wide."""
    q = dict.fromkeys(("goal_qx", "goal_qy", "goal_qz"), 0.0)
    q[("goal_qx", "goal_qy", "goal_qz")[axis]] = np.sin(0.5 * angle)
    return {**q, "goal_qw": float(np.cos(0.5 * angle)), "turn": 0.1}


def off_turn(bench: Bench) -> float:
    """How far the tool is off the goal's orientation [rad]."""
    goal = bench.seen.task[COLUMN["goal_qw"] : COLUMN["goal_qw"] + 4]
    return 2.0 * math.acos(min(1.0, abs(float(bench.tip[3:] @ goal))))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_person_turns_the_tool_as_the_goal_is_turned_by_looks_and_submovements(axis: int) -> None:
    bench = Bench(ObserverParameters(noise=0.03, **PLAIN), late=0.1)
    bench.ask(np.array([0.0, 0.03, 0.0]), **turned_by(0.8, axis))
    while not bench.rows or bench.rows[-1][12] == 0.0:
        assert len(bench.rows) < 9000, "it never grips"
        bench.go_on(0.016)
    assert off_turn(bench) <= 0.05
    speeds = np.linalg.norm(np.diff(np.array(bench.rows)[:, 3:6], axis=0), axis=1)
    begins = np.flatnonzero((speeds[1:] > 1e-9) & (speeds[:-1] <= 1e-9))
    assert len(begins) >= 2  # noise asks for corrections
    assert np.diff(begins).min() * TICK > 0.1 + 0.11  # each waits until the last is seen


def test_a_turn_that_is_seen_late_takes_longer() -> None:
    times = []
    for late in (0.02, 0.3):
        bench = Bench(ObserverParameters(noise=0.05, **PLAIN), late=late)
        bench.ask(np.zeros(3), **turned_by(0.5))
        bench.go_on(6.0)
        times.append(next(i for i, row in enumerate(bench.rows) if row[12] > 0.0) * TICK)
    assert times[1] - times[0] >= 0.28


@pytest.mark.parametrize("room", [0.03, 0.06])
def test_a_hand_that_comes_to_its_end_clutches_and_goes_on_and_else_does_not(room: float) -> None:
    narrow, wide = (Bench(ObserverParameters(noise=0.0, **PLAIN), room=(size,) * 3) for size in (room, 0.5))
    for bench in (narrow, wide):
        bench.ask(np.array([0.1, 0.0, 0.0]))
        bench.go_on(8.0)
        assert bench.tip[:3] == pytest.approx([0.4, -0.2, 0.0], abs=0.002)
        assert np.abs(np.array(bench.rows)[:, :3]).max() <= 0.5 * 0.5
    assert wide.presses == 0
    assert np.abs(np.array(narrow.rows)[:, :3]).max() <= 0.5 * room
    # Each clutch gives the length of the room, less its margins.
    assert narrow.presses == math.ceil((0.1 - (0.5 * room - 0.002)) / (room - 0.004))


def test_a_wrist_that_comes_to_its_end_clutches_and_turns_on() -> None:
    bench = Bench(ObserverParameters(noise=0.0, largest_turn=0.4, **PLAIN))
    bench.ask(np.zeros(3), **turned_by(1.4))
    bench.go_on(10.0)
    assert off_turn(bench) <= 0.05
    assert np.linalg.norm(np.array(bench.rows)[:, 3:6], axis=1).max() <= 0.4 + 1e-9
    assert bench.presses >= 2


def test_where_the_arm_ends_the_hand_is_brought_back_and_tries_again() -> None:
    bench = Bench(ObserverParameters(noise=0.0, **PLAIN), arm=0.02)
    bench.ask(np.array([0.05, 0.0, 0.0]))
    bench.go_on(12.0)
    assert bench.presses >= 2
    assert np.abs(np.array(bench.rows)[:, :3]).max() < 0.06  # it does not push on and on


@pytest.mark.parametrize(("first", "then"), [(0.05, 1.0), (0.05, 2.5), (2.0, 0.05)])
def test_a_person_finds_out_that_the_screen_has_become_later_or_sooner(first: float, then: float) -> None:
    constants = ObserverParameters(noise=0.0, **PLAIN | {"longest_wait": 6.0})
    bench, used_to_it = Bench(constants, late=first), Bench(constants, late=then)
    bench.times(4)
    bench.be_late(then)
    bench.times(6)
    assert bench.times(4) == pytest.approx(used_to_it.times(8)[4:], abs=0.05)


@pytest.mark.parametrize("gap", [0.006, 0.012])
def test_beside_a_wall_a_person_goes_as_slowly_as_keeps_its_noise_off_the_wall(gap: float) -> None:
    peaks, beyond = list[float](), list[bool]()
    for seed in range(20):
        bench = Bench(ObserverParameters(undershoot=0.0, noise=0.04, **PLAIN), seed=seed)
        state = bench.seen.state
        state[STATE["is_fixture_on"]] = 1.0
        state[STATE["fixture_center_x"] : STATE["fixture_center_x"] + 3] = [0.3, -0.2, 0.0]
        state[STATE["fixture_size_x"] : STATE["fixture_size_x"] + 3] = [2.0 * (0.08 + gap), 0.4, 0.4]
        bench.ask(np.array([0.08, 0.0, 0.0]))
        bench.go_on(0.3 + 0.0064 / gap)
        way = np.array(bench.tips)[:, 0] - 0.3
        peaks.append(float(np.diff(way).max() / TICK))
        beyond.append(bool(way.max() > 0.08 + gap))
    assert np.mean(beyond) <= 0.1  # two standard deviations
    # Of minimum jerk the peak is 1.875 times the mean, and the spread is noise times the mean.
    assert np.median(peaks) == pytest.approx(1.875 * gap / (2.0 * 0.04), rel=0.1)


def test_in_a_narrow_hole_a_person_goes_as_slowly_as_keeps_its_noise_off_the_edge() -> None:
    peaks = []
    for clearance in (0.0, 0.001, 0.0005):
        bench = Bench(ObserverParameters(noise_across=0.36, **PLAIN))
        bench.ask(np.array([0.02, 0.0, 0.0]), clearance=clearance)
        bench.go_on(3.0)
        peaks.append(np.diff(np.array(bench.tips)[:, 0]).max())
    assert peaks[0] > peaks[1]
    assert peaks[1] == pytest.approx(2.0 * peaks[2], rel=0.2)


@pytest.mark.parametrize("stiffness", [150.0, 1000.0])
def test_a_press_goes_by_the_force_that_is_felt_whatever_the_screen_shows(stiffness: float) -> None:
    def push(tip: Array) -> Array:
        return np.array([0.0, 0.0, stiffness * max(-tip[2], 0.0)])

    bench = Bench(ObserverParameters(noise=0.01, **PLAIN), late=1.0, push=push)
    bench.tip[2] = -0.06 / stiffness  # it touches already, and the goal is shown too deep
    bench.ask(np.array([0.0, 0.0, -0.01]), Act.PASS, force=0.5)
    bench.go_on(4.0)
    forces = [push(tip[:3])[2] for tip in bench.tips]
    assert forces[-1] == pytest.approx(0.5, abs=0.06)
    right = next(i for i in range(len(forces)) if max(abs(f - 0.5) for f in forces[i:]) < 0.1)
    assert right * TICK < 1.5  # in which a screen that is 1 s late allows one look
