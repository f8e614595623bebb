"""Operators: rest at the start, region kept, stops reached, samples followed, own ones at work."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from held_master import HeldMaster
from teleop_core.base import NoParameters, Within, build, parameter
from teleop_core.hand.operators import OPERATORS, Operator, Setting, following, register_operator
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.shapes import PHASES, minimum_jerk
from teleop_core.kernels.geometry import Array

# Products of numbers below one.
ROUNDING = 1e-15
TICK: Any = 1e-3
CENTER, SIZE, TILT = (0.01, -0.02, 0.03), (0.03, 0.02, 0.04), (-0.5, 0.1, 0.2)
POINTS = (0.01, 0.0, 0.0, 0.01, 0.02, 0.0, -0.01, 0.02, 0.03)
TIMES = np.arange(0.0, 60.0, 0.01)
# Recording of a hand that moves off after half a second.
RECORDED = (np.linspace(0.0, 5.0, 501), np.zeros((501, 6)))
RECORDED[1][:, (0, 4)] = 0.02 * (1.0 - np.cos(np.maximum(RECORDED[0] - 0.5, 0.0)))[:, None]


KINDS = ("random", "line", "circle", "points", "hold", "recorded")


def path_of(kind: str, seed: int = 1, **values: float) -> Callable[[Array], tuple[Array, Array]]:
    """Sampler of an operator: times (N,) [s] to places (N, 3) [m] and turns (N, 3) [rad]."""
    motion = motion_of(kind, seed, **values)

    def sample(times: Array) -> tuple[Array, Array]:
        moves = motion(np.asarray(times))
        return moves[:, :3], moves[:, 3:]

    return sample


def motion_of(kind: str, seed: int, **values: float | tuple[float, float, float]) -> Callable[..., Any]:
    if kind == "recorded":
        return following("recorded", *RECORDED).make(NoParameters(), None)  # type: ignore[arg-type]
    given = {"center": CENTER, "size": SIZE, "tilt": TILT, "approach_time": 2.0, "period": 4.0}
    extra = {"points": POINTS} if kind == "points" else {}
    parameters = build(OperatorParameters, {"kind": kind, **given, **extra, **values})
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, PHASES)
    setting = Setting(parameters, phases, seed)
    return OPERATORS.find(kind).make(parameters.kind.parameters, setting)


@pytest.mark.parametrize("kind", KINDS)
def test_path_starts_at_rest_at_zero(kind: str) -> None:
    places, turns = path_of(kind)(np.arange(4) * TICK)
    assert not places[0].any()
    assert not turns[0].any()
    # From rest: second differences over 1 ms stay below 10 m/s² (and 100 rad/s²).
    assert np.abs(np.diff(places, axis=0)[0]).max() < 10.0 * TICK**2
    assert np.abs(np.diff(turns, axis=0)[0]).max() < 100.0 * TICK**2


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("period", [0.5, 4.0])
def test_path_never_jumps(kind: str, period: float) -> None:
    times = np.arange(0.0, 6.0, 1e-4)
    places, turns = path_of(kind, period=period)(times)
    # The fastest part makes 3.6 rounds per period: 45 rad/s around 20 mm and 0.2 rad.
    assert np.abs(np.diff(places, axis=0)).max() < 1e-4 * 45 * 0.02 * 1.6
    assert np.abs(np.diff(turns, axis=0)).max() < 1e-4 * 45 * 0.2 * 1.6


@given(st.integers(0, 1000), st.floats(1.0, 20.0))
def test_random_motion_stays_inside_its_region_and_uses_it(seed: int, period: float) -> None:
    path = path_of("random", seed, period=period, rotation=0.2)
    places, turns = path(TIMES[TIMES >= 3.0])
    offset, turn = np.abs(places - CENTER), np.abs(turns - TILT)
    assert (offset <= 0.5 * np.array(SIZE) + ROUNDING).all()
    assert (turn <= 0.2 + ROUNDING).all()
    assert (offset.max(axis=0) > 0.3 * np.array(SIZE)).all()
    assert (turn.max(axis=0) > 0.1).all()


def test_random_motion_does_not_repeat_but_with_the_same_seed() -> None:
    times = np.arange(3.0, 60.0, 4.0)
    places, again, other = (path_of("random", seed)(times)[0] for seed in (1, 1, 2))
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert apart[np.triu_indices(len(places), 1)].min() > 1e-3
    assert np.array_equal(places, again)
    assert np.abs(places - other).max() > 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_path_does_not_depend_on_how_it_is_sampled(kind: str) -> None:
    times: Any = np.arange(1, 3001) * TICK
    whole = path_of(kind)(times)
    path = path_of(kind)
    for start, stop in ((0, 1), (1, 8), (8, 1000), (1000, 3000)):
        part = path(times[start:stop])
        for piece, all_of in zip(part, whole, strict=True):
            assert np.array_equal(piece, all_of[start:stop])


def test_line_runs_straight_from_the_centre_to_its_other_end_and_back() -> None:
    places, _ = path_of("line")(np.array([4.0, 6.0]))
    # 2 s of approach, then half a period each way.
    assert np.allclose(places[0], np.add(CENTER, SIZE), rtol=0, atol=ROUNDING)
    assert np.allclose(places[1], CENTER, rtol=0, atol=ROUNDING)
    places, _ = path_of("line")(TIMES[TIMES >= 2.0])
    offset = places - CENTER
    assert np.abs(np.cross(offset, SIZE)).max() < ROUNDING


def test_circle_has_its_diameters_around_the_centre() -> None:
    places, _ = path_of("circle")(TIMES[TIMES >= 3.0])
    offset = (places - CENTER) / (0.5 * np.array(SIZE))
    assert np.allclose(np.hypot(offset[:, 0], offset[:, 1]), 1.0, rtol=0, atol=1e-12)
    assert np.allclose(offset[:, 1], offset[:, 2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("period", [0.5, 2.0])
def test_points_are_reached_in_turn_and_held_for_a_fifth_of_each_leg(period: float) -> None:
    path, stops = path_of("points", period=period), np.reshape(POINTS, (-1, 3))
    for leg, stop in enumerate(stops):
        share = np.array([0.8, 0.9, 0.999])
        places, _ = path(2.0 + period * (leg + share))
        assert np.allclose(places, np.add(CENTER, stop), rtol=0, atol=ROUNDING), leg
    places, _ = path(np.array([2.0 + 3 * period, 100.0]))  # the hand stays at the last point
    assert np.allclose(places, np.add(CENTER, stop), rtol=0, atol=ROUNDING)


def test_hold_stays_at_the_centre_and_without_rotation_the_stylus_keeps_its_tilt() -> None:
    places, _ = path_of("hold")(TIMES[TIMES >= 2.0])
    assert np.allclose(places, CENTER, rtol=0, atol=ROUNDING)
    _, turns = path_of("random", rotation=0.0)(TIMES[TIMES >= 2.0])
    assert np.allclose(turns, TILT, rtol=0, atol=ROUNDING)


def test_smooth_step_rests_at_both_ends() -> None:
    shares = np.array([-1.0, 0.0, 1e-3, 0.5, 1.0 - 1e-3, 1.0, 2.0])
    steps = minimum_jerk(shares)
    assert np.array_equal(steps[[0, 1, 3, 5, 6]], [0.0, 0.0, 0.5, 1.0, 1.0])
    # Third order at the ends: 10 x³.
    assert math.isclose(steps[2], 1e-8, rel_tol=2e-3)
    assert math.isclose(1.0 - steps[4], 1e-8, rel_tol=2e-3)


# Own operators.


def samples(count: int = 5, columns: int = 9) -> Any:
    rng = np.random.default_rng(3)
    rows = rng.uniform(-0.02, 0.02, (count, columns))
    rows[:, 6:] = rng.integers(0, 2, rows[:, 6:].shape)
    return 0.5 * np.arange(count), rows


@pytest.mark.parametrize("columns", [3, 6, 9])
def test_given_samples_are_followed_linearly_and_their_buttons_held(columns: int) -> None:
    times, rows = samples(columns=columns)
    motion = following("mine", times, rows).make(NoParameters(), None)  # type: ignore[arg-type]
    assert np.allclose(motion(times), rows, rtol=0, atol=ROUNDING)
    between = motion(times[:-1] + 0.25)
    middle = 0.5 * (rows[:-1] + rows[1:])
    assert np.allclose(between[:, :6], middle[:, :6], rtol=0, atol=ROUNDING)
    assert np.array_equal(between[:, 6:], rows[:-1, 6:])
    rest = motion(np.array([-1.0, 99.0]))
    assert np.array_equal(rest, rows[[0, -1]])
    rows[:] = 0.0  # what their owner does with the arrays is no matter
    assert np.array_equal(motion(np.array([-1.0, 99.0])), rest)


def master_of(name: str, **values: float | tuple[float, float, float]) -> HeldMaster:
    return HeldMaster(build(OperatorParameters, {"kind": name, "patience": 0.0, **values}))


def poses(master: HeldMaster, ticks: int) -> Array:
    out = np.empty((ticks, 10))
    for i in range(ticks):
        master.step()
        out[i] = *master.signals["master_measured_cp"], *master.signals["master_buttons"]
    return out


def test_own_motion_moves_the_hand_as_the_built_in_one_of_the_same_formula(own_parts: None) -> None:
    setting = {"approach_time": 0.1, "rotation": 0.0, "period": 2.0}
    register_operator("mine", motion_of("line", 1, **setting, center=(0.0,) * 3, tilt=(0.0,) * 3))
    built_in = master_of("line", **setting, size=SIZE)
    assert np.array_equal(poses(master_of("mine"), 600), poses(built_in, 600))


def test_operator_who_is_asked_tick_by_tick_moves_the_hand_to_the_same_bits(own_parts: None) -> None:
    asked = []

    def make(parameters: NoParameters, setting: Setting) -> Callable[[Array], Array]:
        motion = motion_of("circle", 1)

        def noted(times: Array) -> Array:
            asked.append(len(times))
            return motion(times)

        return noted

    register_operator("ahead", Operator("ahead", make))
    register_operator("now", Operator("now", make, ahead=1))
    first = poses(master_of("ahead"), 50)
    assert asked == [1000]
    assert np.array_equal(poses(master_of("now"), 50), first)
    assert asked[1:] == [1] * 50


def test_own_operator_presses_buttons_beside_those_of_the_parameters(own_parts: None) -> None:
    def pressing(times: Array) -> Array:
        rows = np.zeros((len(times), 9))
        rows[:, 6] = times > 0.0305
        return rows

    register_operator("pressing", pressing)
    master = master_of("pressing")
    assert np.array_equal(np.flatnonzero(poses(master, 60)[:, 7]), np.arange(30, 60))


def test_own_operator_is_made_with_its_parameters_the_seed_and_its_phases(own_parts: None) -> None:
    @dataclass(frozen=True, kw_only=True)
    class Wanted:
        height: float = parameter(0.01, Within(unit="m"), "how high")

    made = []

    def make(parameters: Any, setting: Setting) -> Callable[..., Any]:
        made.append((parameters.height, setting.seed, setting.phases.shape))
        return lambda times: np.zeros((len(times), 3))

    register_operator("mine", Operator("mine", make, Wanted))
    master_of("mine", **{"mine.height": 0.02})
    assert made == [(0.02, 1, PHASES)]
