"""Hand samples: what no hand can have made moves nothing, and nothing jumps afterwards."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from teleop_core.coupling.mapping import gains, motion_scaling
from teleop_core.graph.signals import TICK_NS
from teleop_core.kernels.geometry import Array

REST = np.array([0.0, -0.1, 0.1, 1.0, 0.0, 0.0, 0.0])


class Hand:
    """Motion scaling under a hand, with a slave that has every command in force at once."""

    def __init__(self, period_ns: int = TICK_NS) -> None:
        self.stage = motion_scaling.MOTION_SCALING.run(gains.MotionScalingParameters())
        self.row, self.now_ns, self.period_ns = self.stage.signals, 10**9, period_ns
        self.row["slave_setpoint_cp"] = [0.3, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0]
        self.has_buttons = True

    def give(self, pose: Array) -> Array:
        """Command (7,) after one sample of the hand."""
        row = self.row
        self.now_ns += self.period_ns
        row["now_ns"] = row["master_measured_cp_ns"] = self.now_ns
        if self.has_buttons:
            row["master_buttons_ns"] = self.now_ns
        row["master_measured_cp"] = pose
        self.stage.step()
        command = np.array(row["slave_servo_cp"])
        row["slave_setpoint_cp"], row["slave_setpoint_cp_ns"] = command, self.now_ns
        return command

    def rest(self, ticks: int = 50, pose: Array = REST) -> Array:
        """Command after some samples in one place."""
        for _ in range(ticks):
            command = self.give(pose)
        return command


def moved(pose: Array, by: list[float]) -> Array:
    return np.array([*(pose[:3] + np.asarray(by)), *pose[3:]])


@pytest.mark.parametrize(("period", "gap"), [(10, 10), *((1, gap) for gap in (1, 25, 40, 60, 90))])
def test_a_teleport_moves_nothing_and_the_hand_is_followed_from_there(period: int, gap: int) -> None:
    hand = Hand(period * TICK_NS)
    before = hand.rest()
    hand.now_ns += (gap - period) * TICK_NS
    there = moved(REST, [0.1, 0.0, 0.0])
    assert np.array_equal(hand.give(there), before)
    assert np.allclose(hand.rest(pose=there), before, rtol=0, atol=1e-15)
    for k in range(20):
        after = hand.give(moved(there, [0.0, 2e-4 * k, 0.0]))
    assert np.linalg.norm(after[:3] - before[:3]) == pytest.approx(19 * 2e-4, rel=1e-6)


@pytest.mark.parametrize(("period", "gap"), [(1, 40), (50, 50), (50, 90)])
def test_a_fast_hand_is_followed_through_a_gap_and_at_a_slow_rate(period: int, gap: int) -> None:
    hand = Hand(period * TICK_NS)
    before = hand.rest()
    hand.now_ns += (gap - period) * TICK_NS
    after = hand.give(moved(REST, [0.055, 0.0, 0.0]))
    assert np.linalg.norm(after[:3] - before[:3]) == pytest.approx(0.055, rel=1e-9)


def test_a_hand_that_moves_on_after_a_teleport_loses_that_step_and_the_next() -> None:
    hand = Hand()
    before = hand.rest()
    there = moved(REST, [0.1, 0.0, 0.0])
    for k in range(21):
        after = hand.give(moved(there, [0.0, 2e-4 * k, 0.0]))
    assert np.linalg.norm(after[:3] - before[:3]) == pytest.approx(19 * 2e-4, rel=1e-6)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3), min_size=1, max_size=20))
def test_wild_samples_move_no_farther_than_a_hand_could_and_leave_numbers(
    samples: list[tuple[float, float, float]],
) -> None:
    hand = Hand()
    before = hand.rest()
    for place in samples:
        hand.give(np.array([*place, 1.0, 0.0, 0.0, 0.0]))
    after = hand.rest(pose=REST)
    assert np.isfinite(hand.row["teleop_state"]).all()
    assert np.linalg.norm(after[:3] - before[:3]) <= len(samples) * 3.0 * 1e-3 + 1e-12


def test_huge_numbers_for_twenty_samples_leave_the_session_as_it_was() -> None:
    hand = Hand()
    before = hand.rest()
    for _ in range(20):
        assert np.array_equal(hand.give(moved(REST, [1e308, -1e308, 1e17])), before)
    assert np.allclose(hand.rest(), before, rtol=0, atol=1e-15)
    assert "implausible for a hand" in hand.stage.concerns()[0]


def test_a_spun_stylus_does_not_spin_the_tool() -> None:
    hand = Hand()
    before = hand.rest()
    spun = np.array([*REST[:3], 0.0, 1.0, 0.0, 0.0])
    assert np.array_equal(hand.give(spun), before)
    assert np.allclose(hand.rest(pose=spun), before, rtol=0, atol=1e-12)


def test_buttons_that_fall_silent_hold_as_a_clutch_does() -> None:
    hand = Hand()
    hand.rest()
    hand.has_buttons = False
    places = [hand.give(moved(REST, [1e-4 * k, 0.0, 0.0])) for k in range(1500)]
    assert np.array_equal(places[-1], places[600])
    assert not np.array_equal(places[400], places[0])
    assert hand.row["teleop_state"][1] == 1.0
    assert "no messages of the buttons" in hand.stage.concerns()[0]


def test_masters_that_send_buttons_where_they_change_only_are_followed() -> None:
    hand = Hand()
    hand.rest(ticks=3)
    hand.has_buttons = False
    first = hand.rest()
    for k in range(2000):
        last = hand.give(moved(REST, [1e-5 * k, 0.0, 0.0]))
    assert not np.allclose(first, last)


def way(hand: Hand, ticks: int) -> float:
    """Way of the command while the hand goes on, 0.1 m/s [m]."""
    places = [hand.give(moved(REST, [1e-4 * k, 0.0, 0.0]))[:3] for k in range(ticks)]
    return float(np.linalg.norm(np.ptp(places, axis=0)))


def test_buttons_that_fall_silent_just_after_a_pause_of_the_hand_hold_as_a_clutch_does() -> None:
    hand = Hand()
    hand.rest()
    hand.now_ns += 2_000_000_000  # in which no pose could be used, while buttons came
    hand.row["master_buttons_ns"] = hand.now_ns
    hand.has_buttons = False
    assert way(hand, 400) > 0.03
    hand.rest(ticks=200)
    assert way(hand, 1000) < 1e-4
    assert hand.row["teleop_state"][1] == 1.0


def test_a_master_that_comes_to_send_buttons_where_they_change_only_is_followed_then() -> None:
    hand = Hand()
    hand.rest()
    hand.has_buttons = False
    for _ in range(2):
        hand.rest(ticks=800)
        hand.row["master_buttons_ns"] = hand.now_ns
    assert way(hand, 2000) > 0.1
