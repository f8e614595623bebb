"""Tour: stops in order, rests, a smooth line through all points, times set apart."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

import teleop_core as tc
from present import present
from teleop_core.base import build
from teleop_core.hand.operators import OPERATORS, Setting
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.shapes import PHASES
from teleop_core.hand.operators.tour import TourParameters, through, tour
from teleop_core.session.configuration import configure

ROUNDING = 1e-15
POINTS = (0.01, 0.0, 0.0, 0.01, 0.02, 0.0, -0.01, 0.02, 0.03, 0.0, 0.0, 0.01)
STOPS = np.reshape(POINTS, (-1, 3))
seconds = st.floats(0.1, 5.0)


@given(seconds, st.floats(0.0, 5.0), seconds)
def test_tour_rests_at_each_point_in_turn(leg: float, rest: float, trace: float) -> None:
    p = TourParameters(points=POINTS, leg_time=leg, rest_time=rest, trace_time=trace)
    for k, stop in enumerate(STOPS):
        end = (k + 1) * (leg + rest)
        times = np.linspace(end - rest, end, 5)[:-1] if rest > 1e-6 else np.array([end])
        assert np.abs(tour(p, times) - stop).max() < 1e-8


@given(seconds, st.floats(0.01, 5.0), seconds)
def test_tour_goes_on_without_a_jump_and_ends_at_its_first_point(leg: float, rest: float, trace: float) -> None:
    p = TourParameters(points=POINTS, leg_time=leg, rest_time=rest, trace_time=trace)
    end = p.visit_time + trace
    times = np.linspace(0.0, end + 1.0, 20_001)
    places = tour(p, times)
    # Minimum jerk is at most 1.875 times as fast as the mean; the line through the points is
    # longer than from point to point, by less than half.
    ways = np.linalg.norm(np.diff(np.vstack((np.zeros(3), STOPS)), axis=0), axis=1)
    fastest = 1.875 * max(ways.max() / leg, 1.5 * ways[1:].max() * (len(STOPS) - 1) / trace)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert steps.max() <= 1.5 * fastest * (times[1] - times[0])
    assert np.abs(places[0]).max() == 0.0
    assert np.abs(places[-1] - STOPS[0]).max() < ROUNDING


def test_line_is_scipys_cubic_with_the_slopes_of_catmull_and_rom() -> None:
    share = np.linspace(0.0, 1.0, 301)
    knots = np.linspace(0.0, 1.0, len(STOPS))
    slopes = np.gradient(STOPS, knots, axis=0)
    expected = CubicHermiteSpline(knots, STOPS, slopes)(share)
    assert np.abs(through(STOPS, share) - expected).max() < 1e-16 * 100


def motion(leg: float = 1.0, period: float = 8.0, rotation: float = 0.3) -> tuple[Callable[..., Any], float]:
    common = build(
        OperatorParameters,
        {
            "kind": "tour",
            "tour.points": POINTS,
            "tour.leg_time": leg,
            "period": period,
            "rotation": rotation,
            "approach_time": 1.0,
        },
    )
    part = OPERATORS.find("tour")
    phases = np.random.default_rng(1).uniform(0.0, 6.0, PHASES)
    setting: Any = Setting(common=common, phases=phases, seed=1)
    return part.make(common.kind.parameters, setting), present(part.length)(common.kind.parameters, setting)


def test_turning_of_the_stylus_does_not_depend_on_the_time_of_a_leg_nor_places_on_its_period() -> None:
    times = np.linspace(0.0, 9.0, 500)
    base = motion()[0](times)
    slower, calmer = motion(leg=2.0)[0](times), motion(period=30.0)[0](times)
    assert np.array_equal(slower[:, 3:6], base[:, 3:6])
    assert not np.allclose(slower[:, :3], base[:, :3])
    assert np.array_equal(calmer[:, :3], base[:, :3])
    assert not np.allclose(calmer[:, 3:6], base[:, 3:6])


def test_session_lasts_as_long_as_the_tour() -> None:
    assert motion()[1] == pytest.approx(1.0 + 4 * (1.0 + 0.6) + 13.8)


def test_scenario_has_24_different_points_and_takes_the_published_time() -> None:
    made = configure("points24")
    p = made.group("operator").kind.parameters
    assert len({tuple(stop) for stop in p.stops.tolist()}) == 24
    assert p.visit_time + p.trace_time == pytest.approx(45.0)


def test_scenario_lasts_as_long_as_it_says_and_longer_where_its_tour_does() -> None:
    def seconds(**settings: float) -> float:
        named: dict[str, Any] = {f"operator.tour.{name}": v for name, v in settings.items()}
        made = tc.configuration("points24", settings=named)
        return float(made.groups["teleop"].duration)

    assert seconds() == 50.0  # a second more than approach and tour
    assert seconds(leg_time=0.5) == 50.0
    assert seconds(leg_time=1.5) == pytest.approx(4.0 + 24 * (1.5 + 0.6) + 13.8)
