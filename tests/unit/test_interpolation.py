"""Interpolation: slow commands become a way that reaches each of them one period later."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from led_slave import LedSlave
from present import present
from teleop_core.graph.signals import DT
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.slave.commands import CommandStatus
from teleop_core.slave.interpolation import INTERPOLATIONS
from teleop_core.slave.pair import ArmParameters, SimulatedArm

ROBOT = load_robot("planar_3r")  # it starts at home, with room on all sides
HOME, SPEED = ROBOT.home, present(ROBOT.drives).speed_limit
PERIODS = [2, 33]  # of the commands, in ticks
# Joints of up to 3 rad after a polynomial of the fifth degree.
ROUNDING = 1e-13


def way(
    interpolation: str, commands: Array, ticks_between: list[int], robot: str = "planar_3r", after: int = 0
) -> Array:
    """Command in force at the end of every tick (N, n), under commands that come now and then.

    Args:
        interpolation: Its name.
        commands: Joints (M, n).
        ticks_between: Ticks from each command to the next (M - 1,).
        robot: Name of the robot.
        after: Ticks after the last command.
    """
    led, found = LedSlave(SimulatedArm(ArmParameters(robot=robot, interpolation=interpolation))), []
    for command, ticks in zip(commands, [*ticks_between, after], strict=True):
        for tick in range(ticks):
            status = led.tick(None if tick else command)
            assert status in {CommandStatus.FRESH, CommandStatus.STALE}
            found.append(led.slave.server.state["command"].copy())
    return np.array(found)


def wander(count: int, period: int, seed: int = 3) -> Array:
    """Commands (count, 3) from home on, each as far from the last as a stream may be."""
    rng = np.random.default_rng(seed)
    steps = 0.4 * period * DT * SPEED * rng.uniform(-1.0, 1.0, (count, 3))
    steps[0] = 0.0
    return HOME + np.cumsum(steps, axis=0)


@pytest.mark.parametrize("interpolation", ["linear", "minimum_jerk"])
@pytest.mark.parametrize("period", PERIODS)
def test_each_command_is_reached_exactly_one_period_after_it_came(interpolation: str, period: int) -> None:
    commands = wander(12, period)
    found = way(interpolation, commands, [period] * 11, after=period)
    # The first comes alone; of the others each is there when the next one is due, not before.
    assert np.array_equal(found[0], commands[0])
    assert np.array_equal(found[period - 1 :: period], commands)
    before = found[2 * period - 2 :: period]
    assert (before != commands[1:]).any(axis=1).all()


@pytest.mark.parametrize("period", PERIODS)
def test_linear_way_is_the_straight_line_between_commands(period: int) -> None:
    commands = wander(12, period)
    found = way("linear", commands, [period] * 11, after=period)
    ticks = np.arange(len(found)) + 1.0
    knots = period * np.arange(1.0, 13.0)
    line = np.column_stack([np.interp(ticks, knots, column) for column in commands.T])
    assert np.abs(found - line).max() < ROUNDING


def test_without_interpolation_a_command_is_in_force_at_once_and_held() -> None:
    commands = wander(6, 20)
    found = way("none", commands, [20] * 5, after=20)
    assert np.array_equal(found, np.repeat(commands, 20, axis=0))


def test_at_one_command_per_tick_all_kinds_are_equal() -> None:
    commands = wander(300, 1)
    ways = [way(name, commands, [1] * 299, after=1) for name in INTERPOLATIONS]
    assert np.array_equal(ways[0], commands)
    assert np.array_equal(ways[0], ways[1])
    assert np.array_equal(ways[0], ways[2])


def least_jerk(commands: Array, ticks_between: list[int], after: int) -> Array:
    """The ways of least jerk, polynomials of SciPy one after the other, sampled every tick.

    A way takes as long as its command came after the last one. It begins where the one before it is by then, as fast
    and as curved, or at rest if that one was over; it ends as fast as the commands go, without acceleration.
    """
    place, rate, bend = commands[0], 0.0 * HOME, 0.0 * HOME
    found = [place] * ticks_between[0]
    for k, ticks in enumerate([*ticks_between[1:], after], start=1):
        time = ticks_between[k - 1] * DT
        ends = ([place, rate, bend], [commands[k], (commands[k] - commands[k - 1]) / time, 0.0 * HOME])
        polynomial = BPoly.from_derivatives([0.0, time], np.array(ends))
        found += list(polynomial(np.minimum(DT * np.arange(1, ticks + 1), time)))
        place, rate, bend = found[-1], 0.0 * HOME, 0.0 * HOME
        if ticks <= ticks_between[k - 1]:
            rate, bend = (polynomial(ticks * DT, order) for order in (1, 2))
    return np.array(found)


@pytest.mark.parametrize("ticks", [[20] * 9, [100] * 5, [3, 5, 40, 7, 90, 90, 11], [200, 30, 90, 10]], ids=str)
def test_minimum_jerk_way_is_the_polynomial_of_fifth_degree_with_smooth_ends(ticks: list[int]) -> None:
    rng = np.random.default_rng(5)
    steps = 0.4 * DT * np.array([0, *ticks])[:, None] * SPEED
    commands = HOME + np.cumsum(steps * rng.uniform(-1.0, 1.0, steps.shape), axis=0)
    found = way("minimum_jerk", commands, ticks, after=50)
    assert np.abs(found - least_jerk(commands, ticks, 50)).max() < ROUNDING


def changing(kinds: dict[int, str], commands: Array) -> Array:
    """Commands in force (N, 3) under commands, equally far apart, and with kinds that are other ones from a tick on."""
    led, found = LedSlave(SimulatedArm(ArmParameters(robot="planar_3r", interpolation=kinds[0]))), []
    for tick in range(600):
        if tick in kinds:
            led.slave.retune(ArmParameters(robot="planar_3r", interpolation=kinds[tick]))
        k, rest = divmod(tick * len(commands), 600)
        led.tick(None if rest else commands[k])
        found.append(led.slave.server.state["command"].copy())
    return np.array(found)


@pytest.mark.parametrize(("first", "then"), [("linear", "minimum_jerk"), ("minimum_jerk", "linear")])
def test_kinds_change_on_the_way_without_a_jump(first: str, then: str) -> None:
    found = changing({0: first, 300: then}, HOME + 1e-3 * np.arange(0.0, 600.0, 50.0)[:, None] * 0.2 * SPEED)
    # Commands run at constant speed, and so does the way, after a period to begin.
    steps = np.diff(found, axis=0)[100:]
    assert np.allclose(steps, 0.2e-3 * SPEED, rtol=1e-9, atol=0)


def test_a_still_command_after_other_kinds_is_a_still_way() -> None:
    kinds = {0: "minimum_jerk", 100: "none", 200: "linear", 300: "minimum_jerk"}
    found = changing(kinds, HOME + 1e-3 * np.minimum(np.arange(0.0, 600.0, 20.0), 80.0)[:, None] * 0.4 * SPEED)
    assert np.ptp(found[:120], axis=0).min() > 0.05
    assert np.ptp(found[120:], axis=0).max() == 0.0


# -- limits ----------------------------------------------------------------------------------------

# d3 begins at its upper end, which is home; the other joints stay there.
SLIDING = load_robot("rcrt1")
D3, TOP = 2, SLIDING.upper[2]


def slide(interpolation: str, places: Sequence[float] | Array, ticks: int) -> Array:
    """Commands in force (N,) of d3 [m], under commands to some places below its upper end [m]."""
    led, found = LedSlave(SimulatedArm(ArmParameters(start=tuple(SLIDING.home), interpolation=interpolation))), []
    for place in places:
        for tick in range(ticks):
            command = np.where(np.arange(6) == D3, TOP - place, SLIDING.home)
            assert led.tick(None if tick else command) == CommandStatus.FRESH
            found.append(float(led.slave.server.state["command"][D3]))
    return np.array(found)


def test_minimum_jerk_way_that_would_swing_beyond_a_limit_stays_at_it() -> None:
    places = np.array([0.0, 4e-3, 4e-3, 0.0, 0.0, 0.0])
    found = slide("minimum_jerk", places, 50)
    commands = HOME + np.column_stack((-places, 0.0 * places, 0.0 * places))
    free = least_jerk(commands, [50] * 5, 50)[:, 0] - HOME[0]
    assert free.max() > 1e-4  # it arrives with the speed of the commands
    assert found.max() == TOP
    assert np.allclose(found, TOP + np.minimum(free, 0.0), rtol=0, atol=1e-12)


@pytest.mark.slow
@given(st.lists(st.floats(-1e-3, 5e-3), min_size=2, max_size=8), st.integers(2, 90), st.sampled_from(INTERPOLATIONS))
def test_no_way_leaves_the_limits_of_the_joints(places: list[float], ticks: int, interpolation: str) -> None:
    found = slide(interpolation, places, ticks)
    assert found.max() <= TOP
    assert found.min() >= SLIDING.lower[D3]
    assert found[-1] == min(TOP - places[-1], TOP)
