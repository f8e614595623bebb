"""Drill: what it measures, what it does to a hand, and when it is not satisfied."""

import math

import numpy as np
import pytest

from teleop_core.drill import EXERCISES, SHORT, Cure, Motion, Outcome, chosen, hand, measure
from teleop_core.drill.hand import Sample
from teleop_core.drill.recordings import check_recording
from teleop_core.drill.table import drill_table, markdown, rows, summary
from teleop_core.errors import UnknownNameError
from teleop_core.operation import Fault, State
from teleop_core.robots import load_robot

MS = 1_000_000
DT = 1e-3


def trace(values, numbers=None):
    """One message a millisecond, from 1 s on."""
    values = np.asarray(values, dtype=float)
    numbers = np.arange(len(values)) if numbers is None else np.asarray(numbers)
    return measure.Trace(1_000 * MS + numbers * MS, numbers.astype(np.int64), values)


@pytest.mark.parametrize(("steps", "ratio"), [([1e-3, 2e-3], 2.0), ([5e-4, -5e-4], 0.5)])
def test_the_ratio_is_that_of_the_largest_step_of_any_joint(steps, ratio):
    still = np.zeros((len(steps) + 1, 1))
    moving = np.concatenate(([0.0], np.cumsum(steps)))[:, np.newaxis]
    found = measure.step_ratio(trace(np.hstack((still, moving))), np.array([9.0, 1.0]), DT)
    assert found == pytest.approx(ratio)


def test_messages_that_were_lost_count_as_ticks_in_which_a_joint_could_move():
    assert measure.step_ratio(trace([[0.0], [3e-3]], [0, 3]), np.array([1.0]), DT) == (
        pytest.approx(1.0)
    )


def test_another_publisher_is_no_step():
    assert measure.step_ratio(trace([[0.0], [9.0]], [500, 1]), np.array([1.0]), DT) == 0.0


@pytest.mark.parametrize("moving_for", [0, 1, 7])
def test_a_stop_is_over_with_the_first_setpoint_that_stands_still(moving_for):
    way = np.cumsum(np.ones(100 + moving_for))
    places = np.concatenate((way, np.full(50, way[-1])))[:, np.newaxis]
    since_ns = 1_000 * MS + 99 * MS  # that of the hundredth message
    assert measure.stop_delay(trace(places), since_ns) == pytest.approx((moving_for + 1) * DT)


def test_who_never_stands_still_has_no_time_of_stopping():
    assert math.isnan(measure.stop_delay(trace(np.arange(100.0)[:, None]), 1_050 * MS))


def test_travel_is_counted_from_the_last_place_before_the_fault_and_until_the_end():
    places = np.zeros((100, 3))
    places[:, 0] = 1e-3 * np.arange(100)
    found = measure.travel(trace(places), 1_050 * MS, 1_060 * MS)
    assert found == pytest.approx(10e-3)


def test_braking_takes_the_square_of_the_speed_over_twice_the_deceleration():
    speed, braking = 0.5, 4.0
    turning = trace(speed * DT * np.arange(100)[:, None])
    jacobian = np.zeros((6, 1))
    jacobian[1, 0] = 0.3
    found = measure.braking_way(turning, 1_099 * MS, jacobian, np.array([braking]))
    assert found == pytest.approx(0.3 * speed**2 / (2.0 * braking))


def test_the_bound_of_braking_holds_for_a_real_arm_that_brakes_all_joints():
    robot = load_robot("rcrt1")
    rng = np.random.default_rng(3)
    braking = np.full(robot.n, 20.0)
    for _ in range(20):
        q, speeds = robot.home.copy(), rng.uniform(-0.5, 0.5, robot.n)
        moving = trace(q + DT * np.arange(-50, 1)[:, None] * speeds)
        bound = measure.braking_way(moving, 1_050 * MS + 1, robot.jacobian(q), braking)
        time = np.abs(speeds) / braking
        rest = q + 0.5 * speeds * time
        way = np.linalg.norm((robot.fk(rest) - robot.fk(q))[:3, 3])
        assert way <= 1.05 * bound


def test_the_hand_goes_round_at_constant_speed_once_it_has_set_in():
    times = np.arange(2.0, 6.0, hand.PERIOD)
    places = np.array([hand.circle(time)[:3] for time in times])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / hand.PERIOD
    assert speeds == pytest.approx(2.0 * math.pi * hand.RADIUS / hand.ROUND, rel=1e-4)
    assert np.linalg.norm(hand.circle(hand.PERIOD)[:3] - hand.circle(0.0)[:3]) < 1e-6


def sent(distortion, count=100):
    """Samples that leave, of one every two milliseconds."""
    out = []
    for number in range(count):
        out += distortion(Sample(number * 2 * MS, hand.circle(2.0 + number * hand.PERIOD)))
    return out


def test_what_is_lost_is_a_share_and_the_rest_is_untouched():
    left = sent(hand.lossy(0.3), 2000)
    assert 0.65 < len(left) / 2000 < 0.75
    assert [s.stamp_ns for s in left] == sorted({s.stamp_ns for s in left})


def test_what_is_late_comes_in_order_and_so_many_samples_later():
    held = hand.delayed(10)
    assert [len(held(Sample(n, hand.circle(0.0)))) for n in range(12)] == [0] * 10 + [1, 1]


def test_what_is_out_of_order_is_all_there():
    stamps = [s.stamp_ns for s in sent(hand.reordered(5))]
    assert stamps[:5] == sorted(stamps[:5], reverse=True)
    assert sorted(stamps) == [n * 2 * MS for n in range(100)]


def test_stamps_are_changed_alone():
    frozen, zero = sent(hand.frozen_stamps()), sent(hand.stamped(lambda _: 0))
    assert {s.stamp_ns for s in frozen} == {0}
    assert {s.stamp_ns for s in zero} == {0}
    assert np.array_equal([s.pose for s in frozen], [s.pose for s in sent(hand.faithful)])


@pytest.mark.parametrize("number", [math.nan, 1e308])
def test_what_a_hand_cannot_send_is_sent(number):
    for sample in sent(hand.filled(number), 3):
        assert np.array_equal(sample.pose[:3], [number] * 3, equal_nan=True)


def outcome(**changed):
    """One that is as expected, of an arm that was stopped."""
    good = {
        "exercise": next(one for one in EXERCISES if one.name == "stop_topic"),
        "state": State.FAULT, "fault": Fault.STOP, "travel": 1e-3, "bound": 2e-3, "ratio": 1.0,
        "recording": "intact", "recovered": 0.2, "cure": Cure.RESET, "detected": 1e-3,
    }  # fmt: skip
    return Outcome(**(good | changed))


def test_an_outcome_as_expected_has_no_failures():
    assert outcome().failures() == []


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"state": State.ENABLED}, "ENABLED, not FAULT"),
        ({"state": None}, "gone"),
        ({"fault": Fault.SILENCE}, "silence"),
        ({"travel": 2.5e-3}, "0.5 mm too far"),
        ({"ratio": 1.001}, "1.001"),
        ({"recording": "lost", "is_recorded": False}, "lost"),
        ({"recovered": math.nan}, "did not recover"),
        ({"cure": Cure.NOTHING}, "by itself"),
    ],
)
def test_whatever_is_not_as_expected_fails_and_says_what(changed, word):
    (failure,) = outcome(**changed).failures()
    assert word in failure
    assert rows([outcome(**changed)])[0][-1] == "✗"
    assert any(word in line for line in summary([outcome(**changed)]))


def test_every_exercise_says_what_is_expected_and_has_a_name_of_its_own_in_each_way():
    for is_composed in (False, True):
        names = [one.name for one in chosen((), is_composed=is_composed)]
        assert len(names) == len(set(names))
        assert len(names) > 30
    for one in EXERCISES:
        assert one.states
        assert one.cures
        assert one.motion is Motion.RESTS or one.watch >= 0.0


def test_the_short_form_is_there_in_five_processes():
    assert {one.name for one in chosen(SHORT, is_composed=False)} == set(SHORT)


def test_a_fault_that_there_is_not_is_refused_with_those_that_there_are():
    with pytest.raises(UnknownNameError) as caught:
        chosen(("kill_slave_simm",), is_composed=False)
    assert "kill_slave_sim" in str(caught.value)


def test_the_tables_have_a_row_for_each_fault():
    found = [outcome(), outcome(travel=math.nan), outcome(recovered=math.nan)]
    assert drill_table(found).row_count == 3
    assert len(markdown(found).splitlines()) == 5


def test_a_recording_that_is_none_is_not_intact(tmp_path):
    assert not check_recording(tmp_path / "missing").is_good
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    assert not check_recording(tmp_path / "bag").is_good
