"""Remote hand: smooth, late by what is stated, bounded; a grip is relative, silence lets go."""

import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.base import specs
from teleop_core.coupling.mapping.plausibility import PlausibilityParameters
from teleop_core.hand.master.operator import RunningOperator
from teleop_core.hand.operators.remote import AHEAD, RemoteHand, RemoteParameters
from teleop_core.hand.operators.rest import rest_pose
from teleop_core.kernels.geometry import Array
from teleop_core.session.configuration import configure

DT = 1e-3
REST = rest_pose()
coordinate = st.floats(-0.3, 0.3)
place = st.tuples(coordinate, coordinate, coordinate)


def pose(way: Any = (0.0, 0.0, 0.0), turn: Sequence[float] | Array = (0.0, 0.0, 0.0)) -> Array:
    """Pose that is a way [m] and a turn in the base [rad] from the rest."""
    x, y, z, w = (Rotation.from_rotvec(turn) * Rotation.from_quat(REST[[4, 5, 6, 3]])).as_quat()
    return np.array([*(REST[:3] + way), w, x, y, z])


class Run:
    """A hand that is asked as the operator asks it, some ticks at a time."""

    def __init__(self, hand: RemoteHand | None = None, **parameters: float) -> None:
        self.hand = hand or RemoteHand(RemoteParameters(**parameters))
        self.rows, self.ticks, self.last = np.zeros((0, 13)), 0, 0.0

    def for_time(self, duration: float, wanted: Callable[..., Any] | None = None, period: float = 0.02) -> Array:
        """Go on; ``wanted(time)`` says what pose comes every so often, or None for silence."""
        due, came = 0.0, []
        for _ in range(round(duration / DT / AHEAD)):
            if wanted is not None and self.time >= due:
                given = wanted(self.time)
                if given is not None:
                    self.hand.want(given)
                    self.last = self.time
                due = self.time + period
            times: Any = (self.ticks + 1 + np.arange(AHEAD)) * DT
            came.append(self.hand.motion(times))
            self.ticks += AHEAD
        self.rows = np.vstack((self.rows, *came))
        return self.rows

    @property
    def time(self) -> float:
        return self.ticks * DT

    @property
    def way(self) -> Array:
        return self.rows[:, :3]


def test_before_the_first_pose_the_stylus_rests_and_the_clutch_is_pressed() -> None:
    rows = Run().for_time(0.1)
    assert (rows[:, :6] == 0.0).all()
    assert (rows[:, 6] == 1.0).all()
    assert (rows[:, 7:] == 0.0).all()


@pytest.mark.parametrize("delay", [0.02, 0.045, 0.2])
def test_the_stylus_is_behind_a_steady_motion_and_a_steady_turn_by_the_stated_delay(delay: float) -> None:
    speed, run = 0.1, Run(delay=delay)
    run.for_time(0.4 + 10 * delay, lambda t: pose([speed * t, 0.0, 0.0], [0.0, 0.0, speed * t]), period=0.0)
    behind = np.arange(1, len(run.way) + 1) * DT - run.way[:, 0] / speed
    # A pose is taken for all ticks of a question, and counts from its first one on.
    assert np.abs(behind[-200:] - delay).max() <= AHEAD * DT + 1e-9
    w, x, y, z = run.hand.pose[3:]
    start = Rotation.from_quat(REST[[4, 5, 6, 3]])
    turned = (Rotation.from_quat([x, y, z, w]) * start.inv()).as_rotvec()
    assert run.time - turned[2] / speed == pytest.approx(delay, abs=AHEAD * DT)
    np.testing.assert_allclose(turned[:2], 0.0, atol=1e-9)


@given(place, place, st.floats(0.0, 3.0))
@example((0.3, 0.3, 0.3), (-0.3, -0.3, -0.3), 3.0)
def test_no_jump_of_what_is_wanted_ever_passes(
    first: tuple[float, float, float], second: tuple[float, float, float], angle: float
) -> None:
    p = RemoteParameters()
    run = Run()
    run.for_time(0.04, lambda t: pose())
    run.for_time(0.3, lambda t: pose(first, [angle, 0.0, 0.0]))
    run.for_time(1.7, lambda t: pose(second, [0.0, 0.0, -angle]))
    velocity = np.diff(run.way, axis=0) / DT
    change = np.diff(velocity, axis=0) / DT
    assert np.linalg.norm(velocity, axis=1).max() <= p.speed * (1.0 + 1e-9)
    assert np.linalg.norm(change, axis=1).max() <= p.acceleration * (1.0 + 1e-6)
    turns = Rotation.from_rotvec(run.rows[:, 3:6])
    turning = (turns[:-1].inv() * turns[1:]).magnitude() / DT
    assert turning.max() <= p.turn_speed * (1.0 + 1e-6)
    assert np.abs(np.diff(turning)).max() / DT <= p.turn_acceleration * (1.0 + 1e-6)
    np.testing.assert_allclose(run.way[-1], second, atol=1e-3)


@given(place, st.floats(0.01, 0.2), st.floats(0.05, 2.5), st.floats(2.0, 500.0))
def test_the_stylus_never_goes_beyond_a_place_that_it_is_sent_to(
    way: tuple[float, float, float], delay: float, speed: float, acceleration: float
) -> None:
    run = Run(delay=delay, speed=speed, acceleration=acceleration)
    run.for_time(0.04, lambda t: pose())
    run.for_time(1.0, lambda t: pose(way))
    far = np.linalg.norm(way)
    along = run.way @ np.array(way) / far if far > 0.0 else run.way[:, 0]
    assert along.max() <= far * (1.0 + 1e-3) + 1e-9
    assert np.diff(along).min() >= -1e-9


def test_the_bounds_are_such_that_every_sample_is_plausible() -> None:
    upper = {spec.name: spec.upper for spec in specs(RemoteParameters)}
    hand = PlausibilityParameters()
    assert present(upper["speed"]) < hand.speed
    assert present(upper["acceleration"]) < hand.acceleration
    assert present(upper["turn_speed"]) < hand.turn


@given(place)
def test_a_grip_takes_its_first_pose_as_where_the_stylus_is(where: tuple[float, float, float]) -> None:
    run = Run()
    run.for_time(0.1, lambda t: pose(where, [0.3, 0.0, 0.0]))
    assert np.abs(run.rows[:, :6]).max() < 1e-12
    moved = np.add(where, [0.01, 0.0, -0.02])
    turn = Rotation.from_rotvec([0.0, 0.0, 0.2]) * Rotation.from_rotvec([0.3, 0.0, 0.0])
    run.for_time(1.0, lambda t: pose(moved, turn.as_rotvec()))
    np.testing.assert_allclose(run.way[-1], [0.01, 0.0, -0.02], atol=1e-6)
    np.testing.assert_allclose(run.hand.pose, pose([0.01, 0.0, -0.02], [0.0, 0.0, 0.2]), atol=1e-6)


def test_silence_presses_the_clutch_in_time_and_brings_the_stylus_to_rest() -> None:
    run = Run(timeout=0.1)
    run.for_time(0.5, lambda t: pose([0.2 * t, 0.0, 0.0]))
    run.for_time(1.0)
    clutch = run.rows[:, 6]
    pressed = (np.flatnonzero(np.diff(clutch) > 0.0) + 2) * DT
    assert len(pressed) == 1
    assert pressed[0] - run.last == pytest.approx(0.1, abs=(AHEAD + 1.5) * DT)
    assert np.diff(run.way[:, 0]).min() > -1e-9  # it does not come back
    assert np.ptp(run.way[-100:], axis=0).max() < 1e-6
    velocity = np.diff(run.way[:, 0]) / DT
    assert np.abs(np.diff(velocity)).max() / DT <= RemoteParameters().acceleration * (1.0 + 1e-6)


def test_letting_go_is_at_once_and_the_next_pose_is_a_new_grip_however_soon_it_comes() -> None:
    run = Run()
    run.for_time(0.5, lambda t: pose())
    run.hand.let_go()
    run.for_time(0.04)
    assert run.rows[-40:, 6].min() == 1.0
    run.for_time(0.1, lambda t: pose())
    run.hand.let_go()
    run.hand.want(pose([0.1, 0.0, 0.0]))
    run.for_time(0.1)
    assert np.abs(run.rows[:, :6]).max() < 1e-12


def test_a_pose_that_is_older_than_the_timeout_is_no_grip() -> None:
    run = Run()
    run.for_time(0.5)
    run.hand.want(pose(), time=0.1)
    run.for_time(0.1)
    assert not run.hand.is_held
    run.hand.want(pose(), time=run.time - 0.1)
    run.for_time(0.05)
    assert run.hand.is_held
    run.for_time(0.1)
    assert not run.hand.is_held


@pytest.mark.parametrize(
    "bad",
    [
        [np.nan, 0, 0, 1, 0, 0, 0],
        [0, np.inf, 0, 1, 0, 0, 0],
        [0, 0, 0, np.nan, 0, 0, 0],
        [0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0.9, 0, 0, 0],
        [0, 0, 1e6, 1, 0, 0, 0],
        [1e308, -1e308, 1e308, 1, 0, 0, 0],
    ],
)
def test_what_is_no_pose_is_refused_counted_and_counts_as_silence(bad: list[float]) -> None:
    run = Run()
    run.for_time(0.1, lambda t: pose())
    assert run.hand.want(np.array(bad)) is False
    run.for_time(0.4, lambda t: np.array(bad))
    assert run.hand.refused > 10
    assert not run.hand.is_held
    assert np.isfinite(run.rows).all()
    assert np.abs(run.rows[:, :6]).max() < 1e-12


def test_what_a_caller_does_with_a_pose_later_changes_nothing() -> None:
    run, mine = Run(), pose()
    run.hand.want(mine)
    mine[:] = np.nan
    run.for_time(0.1)
    assert np.isfinite(run.rows).all()
    run.hand.pose[:] = np.nan
    assert np.isfinite(run.for_time(0.1)).all()


@given(st.integers(1, 4), st.booleans())
def test_every_tap_is_seen_as_one_press(taps: int, is_held: bool) -> None:
    run = Run()
    for _ in range(taps):
        run.hand.tap("fixture")
    run.hand.press("mode", is_pressed=is_held)
    rows = run.for_time(1.0)
    assert (np.diff(rows[:, 7], prepend=0.0) > 0.0).sum() == taps
    assert rows[-1, 7] == 0.0
    assert rows[-1, 8] == float(is_held)


@given(st.lists(st.tuples(st.floats(1e-3, 1.0), st.booleans()), min_size=1, max_size=30))
def test_every_press_is_seen_also_where_the_time_between_two_was_slept_through(turns: list[tuple[float, bool]]) -> None:
    hand, now, shown, presses, was_down = RemoteHand(), 0.0, [], 0, False
    for gap, is_down in [*turns, *[(0.2, False)] * 60]:  # in the end there is time for all
        presses += is_down and not was_down
        was_down = is_down
        hand.press("fixture", is_pressed=is_down)
        now += gap
        shown.append(float(hand.draw(now, DT, 1)["buttons"][0][1]))
    assert (np.diff(shown, prepend=0.0) > 0.0).sum() == presses
    assert shown[-1] == 0.0


def test_a_pressed_clutch_leaves_the_stylus_to_the_hand() -> None:
    run = Run()
    run.hand.press("clutch")
    run.for_time(0.5, lambda t: pose([0.02 * t, 0.0, 0.0]))
    assert (run.rows[:, 6] == 1.0).all()
    assert run.way[-1, 0] > 5e-3
    run.hand.press("clutch", is_pressed=False)
    assert run.for_time(0.02)[-1, 6] == 0.0


def test_poses_may_come_from_another_thread() -> None:
    # The ticks pass faster than real time: what is a slow thread must not count as silence.
    run, is_over = Run(timeout=5.0), threading.Event()

    def feed() -> None:
        while not is_over.is_set():
            run.hand.want(pose([0.01, 0.0, 0.0], [0.1, 0.0, 0.0]))
            run.hand.want(pose())

    thread = threading.Thread(target=feed)
    thread.start()
    try:
        run.for_time(4.0)
    finally:
        is_over.set()
        thread.join()
    # One of the two was first; every pose is whole, so the stylus is on the way between them.
    assert np.abs(run.way[:, 1:]).max() < 1e-9
    assert np.abs(run.way[:, 0]).max() <= 0.01 + 1e-9
    assert run.hand.refused == 0


def test_the_operator_gives_the_hand_within_the_workspace_of_its_device() -> None:
    master = RunningOperator(configure(settings=["operator=remote"]).groups["operator"])
    assert master.ahead == AHEAD
    hand, device = master.hand, master._fixed.device
    assert isinstance(hand, RemoteHand)
    assert RunningOperator(configure(settings=["operator=hold"]).groups["operator"]).hand is None  # of no person
    times: Any = np.arange(1, 5) * DT
    for k in range(500):
        hand.want(pose([5.0 * (k > 0), 0.0, 0.0]))
        hand.motion(times + 4 * k * DT)
    middle = REST[:3] - device.start
    assert hand.pose[0] == pytest.approx(middle[0] + 0.5 * device.workspace[0], abs=1e-6)


def test_a_hand_draws_for_the_operator_what_its_motion_says() -> None:
    master = RunningOperator(configure(settings=["operator=remote"]).groups["operator"])
    twin = RemoteHand(room=present(master.hand).room)
    for k in range(200):
        for hand in (master.hand, twin):
            present(hand).want(pose([1e-4 * k, 0.0, -2e-5 * k], [0.0, 2e-3 * k, 0.0]))
        master.prepare(1)
        wanted = np.array(master._wanted[1 : AHEAD + 1])
        rows = twin.motion(np.asarray((AHEAD * k + 1 + np.arange(AHEAD)) * DT, np.float64))
        np.testing.assert_allclose(wanted["wanted"] - REST[:3], rows[:, :3], atol=1e-15)
        np.testing.assert_array_equal(wanted["buttons"], rows[:, 6:9])
        start = Rotation.from_quat(REST[[4, 5, 6, 3]])
        turned = (start * Rotation.from_rotvec(rows[:, 3:6])).as_matrix()
        drawn = Rotation.from_quat(wanted["attitude"][:, [1, 2, 3, 0]]).as_matrix()
        np.testing.assert_allclose(drawn, turned, atol=1e-12)
        master.state["next"] += AHEAD
    assert rows[-1, 0] > 0.015
