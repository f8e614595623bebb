"""Operators: rest at the start, region kept, stops reached, samples followed, own ones at work."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop_core.errors import ParameterError
from teleop_core.operators import OPERATORS, Setting, following
from teleop_core.operators.parameters import OperatorParameters
from teleop_core.operators.shapes import PHASES, minimum_jerk
from teleop_core.parameters import NoParameters, build

# Products of numbers below one.
ROUNDING = 1e-15
TICK = 1e-3
CENTER, SIZE, TILT = (0.01, -0.02, 0.03), (0.03, 0.02, 0.04), (-0.5, 0.1, 0.2)
POINTS = (0.01, 0.0, 0.0, 0.01, 0.02, 0.0, -0.01, 0.02, 0.03)
TIMES = np.arange(0.0, 60.0, 0.01)
# Recording of a hand that moves off after half a second.
RECORDED = (np.linspace(0.0, 5.0, 501), np.zeros((501, 6)))
RECORDED[1][:, (0, 4)] = 0.02 * (1.0 - np.cos(np.maximum(RECORDED[0] - 0.5, 0.0)))[:, None]


KINDS = ("random", "line", "circle", "points", "hold", "recorded")


def path_of(kind, seed=1, **values):
    """Sampler of an operator: times (N,) [s] to places (N, 3) [m] and turns (N, 3) [rad]."""
    motion = motion_of(kind, seed, **values)

    def sample(times):
        moves = motion(np.asarray(times))
        return moves[:, :3], moves[:, 3:]

    return sample


def motion_of(kind, seed, **values):
    if kind == "recorded":
        return following("recorded", *RECORDED).make(NoParameters(), None)
    given = {"center": CENTER, "size": SIZE, "tilt": TILT, "approach_time": 2.0, "period": 4.0}
    extra = {"points": POINTS} if kind == "points" else {}
    parameters = build(OperatorParameters, {"kind": kind, **given, **extra, **values})
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, PHASES)
    setting = Setting(parameters, phases, seed)
    return OPERATORS.find(kind).make(parameters.kind.parameters, setting)


@pytest.mark.parametrize("kind", KINDS)
def test_path_starts_at_rest_at_zero(kind):
    places, turns = path_of(kind)(np.arange(4) * TICK)
    assert not places[0].any()
    assert not turns[0].any()
    # From rest: second differences over 1 ms stay below 10 m/s² (and 100 rad/s²).
    assert np.abs(np.diff(places, axis=0)[0]).max() < 10.0 * TICK**2
    assert np.abs(np.diff(turns, axis=0)[0]).max() < 100.0 * TICK**2


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("period", [0.5, 4.0])
def test_path_never_jumps(kind, period):
    times = np.arange(0.0, 6.0, 1e-4)
    places, turns = path_of(kind, period=period)(times)
    # The fastest part makes 3.6 rounds per period: 45 rad/s around 20 mm and 0.2 rad.
    assert np.abs(np.diff(places, axis=0)).max() < 1e-4 * 45 * 0.02 * 1.6
    assert np.abs(np.diff(turns, axis=0)).max() < 1e-4 * 45 * 0.2 * 1.6


@given(st.integers(0, 1000), st.floats(1.0, 20.0))
def test_random_motion_stays_inside_its_region_and_uses_it(seed, period):
    path = path_of("random", seed, period=period, rotation=0.2)
    places, turns = path(TIMES[TIMES >= 3.0])
    offset, turn = np.abs(places - CENTER), np.abs(turns - TILT)
    assert (offset <= 0.5 * np.array(SIZE) + ROUNDING).all()
    assert (turn <= 0.2 + ROUNDING).all()
    assert (offset.max(axis=0) > 0.3 * np.array(SIZE)).all()
    assert (turn.max(axis=0) > 0.1).all()


def test_random_motion_does_not_repeat():
    places, _ = path_of("random")(np.arange(3.0, 60.0, 4.0))
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert apart[np.triu_indices(len(places), 1)].min() > 1e-3


def test_seed_decides_the_path():
    first, again, other = (path_of("random", seed)(TIMES)[0] for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert np.abs(first - other).max() > 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_path_does_not_depend_on_how_it_is_sampled(kind):
    times = np.arange(1, 3001) * TICK
    whole = path_of(kind)(times)
    path = path_of(kind)
    for start, stop in ((0, 1), (1, 8), (8, 1000), (1000, 3000)):
        part = path(times[start:stop])
        for piece, all_of in zip(part, whole, strict=True):
            assert np.array_equal(piece, all_of[start:stop])


def test_line_runs_from_the_centre_to_its_other_end_and_back():
    places, _ = path_of("line")(np.array([4.0, 6.0]))
    # 2 s of approach, then half a period each way.
    assert np.allclose(places[0], np.add(CENTER, SIZE), rtol=0, atol=ROUNDING)
    assert np.allclose(places[1], CENTER, rtol=0, atol=ROUNDING)


def test_line_is_straight():
    places, _ = path_of("line")(TIMES[TIMES >= 2.0])
    offset = places - CENTER
    assert np.abs(np.cross(offset, SIZE)).max() < ROUNDING


def test_circle_has_its_diameters_around_the_centre():
    places, _ = path_of("circle")(TIMES[TIMES >= 3.0])
    offset = (places - CENTER) / (0.5 * np.array(SIZE))
    assert np.allclose(np.hypot(offset[:, 0], offset[:, 1]), 1.0, rtol=0, atol=1e-12)
    assert np.allclose(offset[:, 1], offset[:, 2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("period", [0.5, 2.0])
def test_points_are_reached_in_turn_and_held_for_a_fifth_of_each_leg(period):
    path, stops = path_of("points", period=period), np.reshape(POINTS, (-1, 3))
    for leg, stop in enumerate(stops):
        share = np.array([0.8, 0.9, 0.999])
        places, _ = path(2.0 + period * (leg + share))
        assert np.allclose(places, np.add(CENTER, stop), rtol=0, atol=ROUNDING), leg


def test_hand_stays_at_the_last_point():
    places, _ = path_of("points")(np.array([2.0 + 3 * 4.0, 100.0]))
    assert np.allclose(places, np.add(CENTER, POINTS[-3:]), rtol=0, atol=ROUNDING)


def test_hold_stays_at_the_centre():
    places, _ = path_of("hold")(TIMES[TIMES >= 2.0])
    assert np.allclose(places, CENTER, rtol=0, atol=ROUNDING)


def test_without_rotation_the_stylus_keeps_its_tilt():
    _, turns = path_of("random", rotation=0.0)(TIMES[TIMES >= 2.0])
    assert np.allclose(turns, TILT, rtol=0, atol=ROUNDING)


def test_recorded_path_is_followed_between_and_at_its_samples():
    moves = np.hstack(path_of("recorded")(np.array([0.0, 1.23, 1.235, 5.0, 9.0])))
    at, recorded = RECORDED
    assert np.allclose(moves[1], recorded[123], rtol=0, atol=ROUNDING)
    assert np.allclose(moves[2], 0.5 * (recorded[123] + recorded[124]), rtol=0, atol=ROUNDING)
    assert np.array_equal(moves[4], recorded[-1])
    assert at[123] == pytest.approx(1.23)


def test_smooth_step_rests_at_both_ends():
    shares = np.array([-1.0, 0.0, 1e-3, 0.5, 1.0 - 1e-3, 1.0, 2.0])
    steps = minimum_jerk(shares)
    assert np.array_equal(steps[[0, 1, 3, 5, 6]], [0.0, 0.0, 0.5, 1.0, 1.0])
    # Third order at the ends: 10 x³.
    assert math.isclose(steps[2], 1e-8, rel_tol=2e-3)
    assert math.isclose(1.0 - steps[4], 1e-8, rel_tol=2e-3)


@pytest.mark.parametrize("points", [(), (0.1, 0.2), (0.1, 0.2, 0.3, 0.1)])
def test_points_that_are_no_triples_are_refused(points):
    with pytest.raises(ParameterError) as error:
        build(OperatorParameters, {"kind": "points", "points": points})
    assert (error.value.name, error.value.value) == ("operator.points", points)


def test_recorded_path_without_a_recording_is_refused():
    with pytest.raises(ParameterError) as error:
        build(OperatorParameters, {"kind": "bag"})
    assert error.value.name == "operator.bag"
