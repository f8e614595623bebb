"""A policy moves the hand through the whole chain, and takes over without a jump."""

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.kernels import Array
from teleop_lab.policies import Pilot, Way, trained

PERIOD = 0.02


@pytest.fixture(scope="module")
def session() -> tc.Session:
    return tc.Session("free_motion", period=PERIOD)


@pytest.mark.parametrize("apart", [0.005, 0.02, 0.03])
def test_another_policy_takes_over_without_a_jump(apart: float, session: tc.Session) -> None:
    """Person and policy want places up to 30 mm apart: in no step does hand or tip move by a millimetre."""
    found = session.reset()
    pilot = Pilot(session, lambda _: np.zeros(3))
    for _ in range(10):
        found = pilot.step(found)
    pilot.hand_over(lambda _: np.array([apart, -apart, apart]))
    hands, tips = [pilot.place], [found.measured_cp[:3]]
    for _ in range(300):
        found = pilot.step(found)
        hands.append(pilot.place)
        tips.append(found.measured_cp[:3])
    for places in (hands, tips):
        assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 1e-3
    assert np.linalg.norm(hands[-1] - np.array([apart, -apart, apart])) < 1e-9  # and it gets there
    assert np.linalg.norm(hands[1] - hands[0]) < 1e-9


def test_actions_come_as_late_and_as_seldom_as_their_way_says(session: tc.Session) -> None:
    def run(way: Way) -> list[float]:
        found, count = session.reset(), [0]

        def policy(_: tc.Observation) -> Array:
            count[0] += 1
            return np.array([1e-4 * count[0], 0.0, 0.0])

        pilot, out = Pilot(session, policy, way), []
        for _ in range(60):
            found = pilot.step(found)
            out.append(round(float(pilot.place[0]) / 1e-4, 6))
        return out

    plain = run(Way())
    assert np.allclose(np.diff(plain[2:]), 1.0)  # before, the shift of the first place shrinks
    late = run(Way(told_late=5))
    assert late[10:] == plain[5:-5]
    lossy = run(Way(loss=0.5, seed=3))
    assert 0.3 < np.mean(np.diff(lossy) == 0.0) < 0.7
    assert lossy == run(Way(loss=0.5, seed=3))


def test_what_a_policy_sees_is_as_old_as_its_way_says(session: tc.Session) -> None:
    found, ages = session.reset(), []
    now = [0.0]

    def policy(seen: tc.Observation) -> Array:
        ages.append(now[0] - seen.time)
        return np.zeros(3)

    pilot = Pilot(session, policy, Way(seen_late=4))
    for _ in range(20):
        now[0] = found.time
        found = pilot.step(found)
    assert np.allclose(ages[5:], 4 * PERIOD)


def test_places_beyond_the_hand_are_its_border_and_nonsense_is_refused(session: tc.Session) -> None:
    found = session.reset()
    pilot = Pilot(session, lambda _: np.array([0.0, 0.0, 9.0]), give_way=1.0)
    for _ in range(600):
        found = pilot.step(found)
    assert pilot.place[2] == session.command_space.high[2]
    with pytest.raises(tc.ShapeError):
        Pilot(session, lambda _: np.zeros(2)).step(session.reset())
    with pytest.raises(tc.ParameterError):
        Pilot(session, lambda _: np.full(3, np.nan)).step(session.reset())
    with pytest.raises(tc.ParameterError, match="loss"):
        Way(loss=2.0)


def test_a_network_imitates_a_linear_rule_and_is_the_same_for_the_same_seed() -> None:
    rng = np.random.default_rng(0)
    inputs = rng.uniform(-1.0, 1.0, (500, 3))
    rule = np.array([[0.2, 0.0], [0.1, -0.3], [0.0, 0.05]])
    found = trained(inputs, inputs @ rule, seed=4, rounds=1000)
    fresh = rng.uniform(-0.8, 0.8, (100, 3))
    assert np.abs(found(fresh) - fresh @ rule).max() < 0.02
    again = trained(inputs, inputs @ rule, seed=4, rounds=1000)
    assert all(np.array_equal(a, b) for a, b in zip(found.weights, again.weights, strict=True))
