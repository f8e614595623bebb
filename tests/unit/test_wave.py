"""Waves: energy on its way, networks that only lose it, and what a hand feels of the world."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from palpation import pressed
from teleop_core.coupling.passivity.port import (
    DRIFT,
    IMPEDANCE,
    IN,
    LAW,
    MARGIN,
    OUT,
    ROUND,
    TOLD,
    WAVE,
    begin_round,
    count,
    hear_energy,
)
from teleop_core.coupling.passivity.wave import draw, wave_hand, wave_slave
from teleop_core.graph import topics
from teleop_core.kernels import Array, kernel

DT, ARM, STEP = 1e-3, 0.05, 55e-6
"""Tick [s], lag of the arm [s], step of the device's reading [m]."""
B = 10.0
SLAVE = np.array([0.2, 5e-3, 0.01, 2e-3, 1.0])
"""Numbers of the slave's stage: its defaults."""


@kernel
def drive(
    ways: Array,
    there: Array | NDArray[np.int64],
    back: NDArray[np.int64],
    stiffness: float,
    preload: float,
    impedance: float,
    slave: Array,
    hand: Array,
    arm: Array,
    seen: Array,
) -> None:
    """Lead an arm that lags before a spring below z = 0; write both ports and what is seen.

    ``ways`` (N, 3) are of the hand [m]; ``there`` and ``back`` (N,) the number of the row that
    either side sees at each tick, -1 for none. ``hand`` and ``arm`` (N, columns) are the ports;
    ``seen`` (N, 6) the reserves of both, push, command, tip, and force.
    """
    h, s = np.zeros(hand.shape[1]), np.zeros(arm.shape[1])
    begin_round(h, 3.0, 1.0)
    begin_round(s, 3.0, 1.0)
    left, right = np.zeros(12), np.zeros(12)
    numbers, nothing = np.array([impedance]), np.zeros(hand.shape[1])
    push, last, flow, felt = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(6)
    to_slave, command, given = np.zeros(3), np.zeros(7), np.zeros(7)
    command[3] = given[3] = 1.0
    place, tip, force, before = np.zeros(3), np.zeros(3), preload, -1
    for n in range(ways.shape[0]):
        # hand
        came = 0.0
        for i in range(3):
            came -= push[i] * ways[n, i]
            place[i] += ways[n, i]
            last[i] = push[i]
        count(h, IN, came)
        heard = arm[back[n]] if back[n] >= 0 else nothing
        flow[0], flow[1], flow[2] = hear_energy(h, heard), max(came, 0.0), max(-came, 0.0)
        wave_hand(numbers, left, last, ways[n], ways[n], flow, heard, h, push, 1.0, DT)
        hand[n] = h
        # arm and world
        moved = (given[2] - tip[2]) * DT / ARM
        came = 0.5 * (force + preload - stiffness * min(tip[2] + moved, 0.0)) * moved
        for i in range(2):
            tip[i] += (given[i] - tip[i]) * DT / ARM
        tip[2] += moved
        force = preload - stiffness * min(tip[2], 0.0)
        count(s, IN, came)
        to_slave[1] += max(came, 0.0)
        to_slave[2] += max(-came, 0.0)
        if there[n] >= 0 and there[n] != before:
            heard, felt[2] = hand[there[n]], force
            to_slave[0] += hear_energy(s, heard)
            for i in range(3):
                command[i] = place[i]
            period = DT * max(there[n] - before, 1) if before >= 0 else DT
            wave_slave(slave, right, to_slave, felt, given, given, heard, s, command, period)
            for i in range(3):
                given[i], to_slave[i] = command[i], 0.0
            before = there[n]
        arm[n] = s
        seen[n, 0], seen[n, 1], seen[n, 2] = left[1], right[1], push[2]
        seen[n, 3], seen[n, 4], seen[n, 5] = given[2], tip[2], force


def motion(rng: np.random.Generator, count: int = 3000) -> Array:
    """Ways (N, 3) of a hand that goes to and fro and trembles, in steps of the reading [m]."""
    time = DT * np.arange(count + 1)[:, None]
    place = np.zeros((count + 1, 3))
    for size, low, high in ((0.03, 0.1, 1.0), (1e-3, 5.0, 12.0)):
        rate = 2.0 * np.pi * rng.uniform(low, high, 3)
        place += size * rng.uniform(0.0, 1.0, 3) * np.sin(rate * time)
    return np.diff(np.round(place / STEP) * STEP, axis=0)


def constant(delay: int, count: int = 3000) -> NDArray[np.int64]:
    """Numbers of the rows that are seen at each tick, so many ticks late."""
    return np.maximum(np.arange(count) - delay, -1)


def shaken(rng: np.random.Generator, count: int = 3000) -> NDArray[np.int64]:
    """The same of a network that loses to a half, and delays each packet by another time."""
    sent = np.flatnonzero(rng.random(count) > rng.choice([0.0, 0.1, 0.5]))
    due = sent + rng.integers(1, 500) + rng.geometric(rng.choice([1.0, 0.3, 0.03]), len(sent))
    seen = np.full(count, -1)
    inside = due < count
    np.maximum.at(seen, due[inside], sent[inside])
    return np.maximum.accumulate(seen)


def driven(
    ways: Array, there: NDArray[np.int64], back: NDArray[np.int64], stiffness: float = 200.0, preload: float = 0.0
) -> tuple[Array, Array, Array]:
    """Ports of hand and arm (N, columns), and what is seen, of :func:`drive`."""
    hand, arm = np.zeros((2, len(ways), len(topics.ENERGY)))
    seen = np.zeros((len(ways), 6))
    drive(ways, there, back, stiffness, preload, B, SLAVE, hand, arm, seen)
    return hand, arm, seen


def held(hand: Array, arm: Array) -> Array:
    """Energy [J] that went in at both ports and did not come out, at each tick."""
    return hand[:, IN] - hand[:, OUT] + arm[:, IN] - arm[:, OUT]


def in_flight(rows: Array, delay: int) -> Array:
    """Half the integral of the squares of the waves on their way from a port [J], at each tick."""
    waves = np.diff(rows[:, WAVE : WAVE + 3], axis=0, prepend=0.0) / DT
    gone = np.cumsum(0.5 * DT * (waves**2).sum(axis=1))
    return gone - np.concatenate((np.zeros(delay), gone))[: len(gone)]


@pytest.mark.parametrize("delay", [1, 50, 350])
def test_the_two_port_holds_half_the_squares_of_the_waves_on_their_way(delay: int) -> None:
    """And what either side was paid and did not send: at any tick, of any motion, to 1e-12 J."""
    ways = motion(np.random.default_rng(delay))
    hand, arm, seen = driven(ways, constant(delay), constant(delay), preload=1.0)
    waves = in_flight(hand, delay) + in_flight(arm, delay)
    kept = hand[:, MARGIN] + arm[:, MARGIN] + seen[:, 0] + seen[:, 1]
    assert waves.max() > 5e-4
    np.testing.assert_allclose(held(hand, arm), waves + kept, atol=1e-12)
    np.testing.assert_allclose(seen[:, :2], 0.0, atol=1e-12)  # what comes is given at once


def test_no_network_and_no_spring_makes_the_two_port_give_more_than_it_took() -> None:
    """Loss to a half, delay to 1 s there and back, any jitter, old rows again, 10 N/m to 50 kN/m.

    The hand's port alone may owe one step of its reading under the largest push, 0.18 mJ.
    """
    rng = np.random.default_rng(2)
    for _ in range(1000):
        ways, stiffness = motion(rng, 2000), 10.0 ** rng.uniform(1.0, 4.7)
        there, back = shaken(rng, 2000), shaken(rng, 2000)
        for rows in (there, back):
            again = rng.random(2000) < rng.choice([0.0, 0.2])
            rows[again] = np.maximum(rows[again] - rng.integers(0, 20, again.sum()), -1)
        hand, arm, _ = driven(ways, there, back, stiffness)
        assert held(hand, arm).min() >= 0.0
        assert hand[:, MARGIN].min() >= -3.3 * STEP
        assert np.all(np.diff(hand[:, TOLD]) >= 0.0)
        assert np.all(np.diff(arm[:, TOLD]) >= 0.0)


def test_a_wave_is_given_with_no_more_energy_than_it_has_and_whole_with_what_it_brought() -> None:
    rng, wave = np.random.default_rng(5), np.zeros(3)
    for haste in (np.inf, 0.01, 1e-4):
        for _ in range(200):
            waves = rng.normal(0.0, 1.0, (20, 3))
            owed, energy = DT * waves.sum(axis=0), 0.5 * DT * (waves**2).sum()
            whole, given = owed.copy(), np.zeros(3)
            for _ in range(20):
                spent = draw(owed, energy, DT, haste, wave)
                assert spent == pytest.approx(0.5 * DT * wave @ wave, rel=1e-12, abs=1e-18)
                energy -= spent
                given += DT * wave
                assert energy >= -1e-15
            np.testing.assert_allclose(owed + given, whole, atol=1e-15)
            if haste == np.inf:
                np.testing.assert_allclose(given, whole, rtol=1e-9)


def test_half_of_all_packets_lost_leave_no_drift_in_the_air() -> None:
    """Without the slave's making up: integrals travel."""
    ways = motion(np.random.default_rng(6))
    ways[2000:] = 0.0
    hand, arm = np.zeros((2, len(ways), len(topics.ENERGY)))
    seen, still = np.zeros((len(ways), 6)), SLAVE.copy()
    still[1] = 0.0
    there = constant(50)
    there[np.random.default_rng(7).random(len(there)) < 0.5] = -1
    drive(ways, np.maximum.accumulate(there), constant(50), 0.0, 0.0, B, still, hand, arm, seen)
    places = np.cumsum(ways, axis=0)[:, 2]
    assert np.abs(places).max() > 5e-3
    assert np.abs(seen[60:, 3] - places[10:-50]).max() < 4e-3
    assert seen[-1, 3] == pytest.approx(places[-1], abs=1e-12)
    assert not arm[:, WAVE : WAVE + 3].any()  # no wave comes back by itself


@pytest.mark.parametrize("delay", [1, 100])
def test_a_hand_at_rest_feels_the_force_of_the_tip_and_a_spring_of_impedance_over_delay(delay: int) -> None:
    """At rest the tip stays behind the hand by force times delay over impedance."""
    ways = np.zeros((6000, 3))
    ways[:1000, 2] = -1.1e-5
    _, arm, seen = driven(ways, constant(delay, 6000), constant(delay, 6000))
    push, force = seen[-1, 2], seen[-1, 5]
    assert push == pytest.approx(force, rel=1e-6)
    assert force > 0.7
    behind = force * delay * DT / B
    assert -arm[-1, DRIFT + 2] == pytest.approx(behind, abs=0.03 * behind + 7e-4)


pressing = partial(
    pressed,
    "teleop.stages=[network,passivity]",
    "feedback_timeout=1.0",
    "reach_force.is_on=false",
    "gimbal_noise=0.0",
    "reflection.passivity=wave",
)


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_an_arm_that_is_overdrawn_goes_back_before_force_whatever_wave_comes(
    direction: tuple[float, float, float],
) -> None:
    """At the speed at which drift is made up for, with 5 N at the tip: nothing is lent then."""
    away, force = np.array(direction), np.zeros(6)
    force[:3] = 5.0 * away
    port, heard, memory = np.zeros(len(topics.ENERGY)), np.zeros(len(topics.ENERGY)), np.zeros(12)
    begin_round(port, 3.0, 1.0)
    begin_round(heard, 3.0, 1.0)
    tip = np.array([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0])
    last, speed = tip.copy(), SLAVE[1]
    for tick in range(1, 20):
        heard[IMPEDANCE], heard[TOLD] = B, 3e-3 * tick
        heard[WAVE : WAVE + 3] = -2e-3 * tick * away  # into what is pressed
        flow, command = np.array([hear_energy(port, heard), 0.0, 5e-3]), tip.copy()
        wave_slave(SLAVE, memory, flow, force, tip, last, heard, port, command, DT)
        np.testing.assert_allclose(command[:3] - last[:3], speed * DT * away, atol=1e-12)
        last = command


def late(delay: float) -> Any:
    """Settings of a network that takes so long there and back each [s]."""
    return tuple(f"network.{way}.least_delay={delay}" for way in ("there", "back"))


def held_in_rounds(rows: NDArray[np.void]) -> Array:
    """Energy of the two-port [J] where both sides count the same round."""
    hand, arm = rows["master_energy"], rows["slave_energy"]
    return held(hand, arm)[(hand[:, ROUND] == arm[:, ROUND]) & (hand[:, LAW] == arm[:, LAW])]


@pytest.mark.parametrize(("material", "delay"), [("steel", 0.1), ("tissue", 0.35)])
def test_palpation_stays_calm_over_200_and_700_ms(material: str, delay: float) -> None:
    rows = pressing(f"world.material={material}", *late(delay))
    place = rows["master_measured_cp"][5000:, :3]
    assert np.linalg.norm(place[20:] - place[:-20], axis=1).max() / 0.02 < 0.07
    assert np.linalg.norm(rows["slave_measured_cf"], axis=1).max() < 8.0
    assert held_in_rounds(rows).min() > -1e-5
    assert rows["slave_energy"][-1, OUT] > 0.0


def test_the_hand_feels_the_tips_force_in_its_own_axes_and_scale() -> None:
    """One and a half of the force at half the motion, in and out, where the drag cancels."""
    texts = ("position_force.force_gain=1.5", "coarse_gain=0.5", "world.place=[0.25,-0.235,-0.066]")
    rows = pressing(*texts, ticks=20_000)
    push, force = rows["master_servo_cf"][:, :3], rows["slave_measured_cf"][:, :3]
    at_hand = 1.5 * np.stack((-force[:, 1], force[:, 2], -force[:, 0]), axis=1)
    pressed = (np.linalg.norm(force, axis=1) > 0.1) & (np.linalg.norm(push, axis=1) < 3.2)
    felt, told = push[pressed].mean(axis=0), at_hand[pressed].mean(axis=0)
    assert told[1] > 0.5
    assert told[2] < -0.5
    np.testing.assert_allclose(felt, told, atol=0.1)
    assert held_in_rounds(rows).min() > -1e-5


def test_a_hand_that_is_clutched_leads_nothing() -> None:
    rows = pressing("buttons.clutch=[4.5,5.5]", ticks=9500)
    clutched = np.flatnonzero(rows["master_buttons"][:, 0] > 0.0)[100:]
    assert np.ptp(rows["master_measured_cp"][clutched, :3], axis=0).max() > 0.02
    assert np.ptp(rows["passivity_servo_cp"][clutched, :3], axis=0).max() < 2e-3  # what was owed


def test_a_hand_that_moves_without_leading_feels_no_drag_and_sends_no_wave() -> None:
    port, memory, push, still = np.zeros(len(topics.ENERGY)), np.zeros(12), np.zeros(3), np.zeros(3)
    begin_round(port, 3.0, 1.0)
    for leads in (0.0, 1.0):
        moved = np.array([1e-4, 0.0, 0.0])
        flow = np.array([0.0, 1e-3, 0.0])
        numbers = np.array([B])
        wave_hand(numbers, memory, still, moved, leads * moved, flow, np.zeros(len(topics.ENERGY)), port, push, 1.0, DT)
        assert push.any() == port[WAVE : WAVE + 3].any() == bool(leads)
    assert push[0] < 0.0
