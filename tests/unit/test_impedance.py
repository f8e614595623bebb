"""Impedance: the slave yields as its mass, spring and damper do, and channels say to what."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lsim

from palpation import on_the_slave, pressed
from teleop_core.base import PartError, build
from teleop_core.coupling.architectures.impedance import IMPEDANCE, ImpedanceParameters
from teleop_core.graph import TICK_NS, Graph, build_graph, topics
from teleop_core.slave.slave_sim import SLAVE_SIM

CALM = ("feedback_timeout=1.0", "reach_force.is_on=false", "gimbal_noise=0.0")
STAGES = "teleop.stages=[network,impedance,passivity]"
LATE = ("network.there.least_delay=0.03", "network.back.least_delay=0.05")


pressing = partial(pressed, STAGES, *CALM, ticks=9000)


def slave(**values: float) -> tuple[Any, Callable[..., float]]:
    """A stage at work, and a call that gives it a command after some ticks: where the tip goes."""
    stage = IMPEDANCE.run(build(ImpedanceParameters, values))
    row = stage.signals
    row["slave_setpoint_cp_ns"] = topics.NO_COMMAND_NS + 1

    def command(
        force: float = 0.0, lead: float = 0.0, ticks: int = 1, place: tuple[float, float, float] = (0.1, 0.2, 0.3)
    ) -> float:
        row["slave_servo_cp"][:3] = place
        row["slave_servo_cp_ns"] += ticks * TICK_NS
        row["slave_measured_cf"][2], row["slave_servo_cf"][2] = force, lead
        stage.step()
        return row["impedance_servo_cp"][2] - place[2]

    return row, command


# The slave.


@pytest.mark.parametrize(("mass", "damping"), [(1.0, 100.0), (2.0, 5.0), (0.0, 100.0)])
def test_a_tip_yields_as_a_mass_with_spring_and_damper_does(mass: float, damping: float) -> None:
    _, command = slave(mass=mass, damping=damping, stiffness=400.0)
    times, force = np.arange(2000) * 1e-3, np.sin(np.arange(2000) * 4e-3) - 0.5
    way = [command(float(push)) for push in force]
    exact = lsim(([1.0], [mass, damping, 400.0]), force, times)[1]
    np.testing.assert_allclose(way, exact, atol=0.02 * np.abs(exact).max())


@pytest.mark.parametrize("ticks", [1, 20, 300])
def test_it_comes_to_rest_by_force_over_stiffness_however_seldom_commands_come(ticks: int) -> None:
    _, command = slave(stiffness=500.0, force_gain=0.5)
    ways = [command(-2.0, ticks=ticks) for _ in range(2000 // ticks + 20)]
    assert ways[-1] == pytest.approx(-2e-3, rel=1e-3)
    assert min(ways) > -2e-3 * (1.0 + 1e-3)  # no way beyond that


def test_no_force_leaves_every_command_as_it_came() -> None:
    row, command = slave()
    rng = np.random.default_rng(2)
    for place in rng.normal(size=(50, 3)):
        row["slave_servo_cp"][3:] = rng.normal(size=4)
        command(place=place)
        np.testing.assert_array_equal(row["impedance_servo_cp"], row["slave_servo_cp"])


def test_forces_that_agree_move_nothing_and_the_hand_pushes_where_the_tip_yields() -> None:
    _, command = slave(stiffness=1000.0)
    assert not any(command(-3.0, 3.0) for _ in range(500))
    ways = [command(-3.0, 5.0) for _ in range(2000)]
    assert ways[-1] == pytest.approx(2e-3, rel=1e-3)


def test_a_force_out_of_all_measure_moves_the_tip_by_its_largest_way_and_lets_go_at_once() -> None:
    _, command = slave(largest_way=0.01)
    ways = [command(1e4) for _ in range(500)]
    assert max(ways) == pytest.approx(0.01, rel=1e-12)
    assert command(-1.0) < 0.01


def test_a_slave_that_goes_its_own_way_gathers_none_and_loses_what_it_had_without_a_step() -> None:
    row, command = slave()
    for _ in range(1000):
        command(-2.0)
    row["slave_setpoint_cp_ns"] = topics.NO_COMMAND_NS
    ways = np.array([command(-2.0) for _ in range(1500)])
    assert np.abs(np.diff(ways)).max() < 2e-3 * 1e-3 * 50.0  # 2 mm over 20 ms
    assert np.all(np.diff(ways) > 0.0)
    assert abs(ways[-1]) < 1e-7


def test_commands_that_overtake_each_other_count_no_time_twice() -> None:
    _, command = slave(damping=1000.0)
    _, plain = slave(damping=1000.0)
    for _ in range(100):
        plain(1.0)
        command(1.0)
        command(1.0, ticks=-1)
        command(1.0, ticks=1)
    assert command(1.0) == pytest.approx(plain(1.0), rel=1e-12)


# Channels.


def settled(rows: NDArray[np.void]) -> slice:
    """Ticks in which the slave follows, by far, and everything has set in."""
    return slice(5000, len(rows))


@pytest.mark.parametrize("architecture", ["three_channel", "four_channel"])
def test_the_hand_feels_the_force_by_its_gain_and_a_spring_to_the_tip(architecture: str) -> None:
    rows = pressing(
        f"reflection.architecture={architecture}",
        f"{architecture}.force_gain=0.5",
        f"{architecture}.stiffness=80.0",
        "reflection.max_force=10.0",
        *LATE,
    )
    now, before = settled(rows), slice(4999, len(rows) - 1)
    away = rows["network_measured_cp"][before, :3] - rows["slave_servo_cp"][now, :3]
    felt = 0.5 * rows["network_measured_cf"][before, :3] + 80.0 * away
    assert np.abs(rows["slave_measured_cf"]).max() > 0.5
    np.testing.assert_allclose(on_the_slave(rows["master_servo_cf"][now]), felt, atol=1e-12)


@pytest.mark.parametrize(("gain", "given"), [(None, 1.0), (0.5, 0.5)])
def test_the_slave_gets_what_the_hand_bears_in_its_own_axes_as_late_as_commands(
    gain: float | None, given: float
) -> None:
    own = () if gain is None else (f"four_channel.hand_gain={gain}",)
    rows = pressing("reflection.architecture=four_channel", *own, *LATE)
    borne = -given * on_the_slave(rows["master_servo_cf"])
    assert np.abs(borne).max(axis=0)[2] > 0.3
    np.testing.assert_array_equal(rows["slave_servo_cf"][:, :3], borne)
    np.testing.assert_array_equal(rows["network_servo_cf"][30:, :3], borne[:-30])
    assert not rows["slave_servo_cf"][:, 3:].any()


@pytest.mark.parametrize("architecture", ["unilateral", "position_force", "three_channel"])
def test_without_a_fourth_channel_the_hand_sends_no_force(architecture: str) -> None:
    rows = pressing(f"reflection.architecture={architecture}", "impedance.stiffness=500.0")
    assert not rows["slave_servo_cf"].any()
    yielded = rows["impedance_servo_cp"][:, 2] - rows["network_servo_cp"][:, 2]
    assert yielded.max() == pytest.approx(rows["slave_measured_cf"][:, 2].max() / 500.0, rel=0.05)  # presses last


def test_a_press_that_lasts_leaves_four_channels_no_way_from_the_command_and_three_its_force() -> None:
    away = {}
    for architecture in ("three_channel", "four_channel"):
        rows = pressing(f"reflection.architecture={architecture}", ticks=12_000)
        force = rows["slave_measured_cf"][:, 2]
        at = int(np.argmax(force))
        away[architecture] = rows["slave_measured_cp"][at, 2] - rows["slave_servo_cp"][at, 2]
        if architecture == "three_channel":
            assert away[architecture] == pytest.approx(force[at] / 1000.0, rel=0.1)
    assert abs(away["four_channel"]) < 0.1 * away["three_channel"]


def test_a_session_whose_slave_does_not_yield_sends_no_force_there() -> None:
    plain = build_graph(stages=["network", "passivity"])
    assert not {"slave/servo_cf", "network/servo_cf"} & {topic.name for topic in plain.topics}
    with_it = build_graph(stages=["network", "impedance", "passivity"])
    feeds = {link.port.name: link for link in with_it.links if link.reader.name == "impedance"}
    assert feeds["slave/servo_cf"].topic.name == "network/servo_cf"
    assert feeds["slave/servo_cp"].topic.name == "network/servo_cp"
    assert feeds["slave/measured_cf"].topic.name == "slave/measured_cf"  # its own, not late
    (into,) = (link for link in with_it.links if link.reader.name == "passivity" and link.port.name == "slave/servo_cp")
    assert into.topic.name == "impedance/servo_cp"  # passivity counts how it yields


def test_a_force_of_the_hand_behind_a_deadband_is_off_by_no_more_than_its_share() -> None:
    rows = pressing(
        "reflection.architecture=four_channel",
        "network.deadband.is_on=true",
        "network.deadband.force=0.1",
        "network.deadband.least_force=0.02",
        "network.deadband.place=0.1",
        "network.deadband.turn=1.0",
        "network.deadband.longest_pause=1.0",
    )
    told, came = rows["slave_servo_cf"][6000:, :3], rows["network_servo_cf"][6000:, :3]
    off, size = (np.linalg.norm(each, axis=1) for each in (told - came, came))
    assert size.max() > 0.5
    assert np.all(off <= np.maximum(0.1 * size, 0.02) + 1e-12)


# What cannot be.


def test_a_slave_that_measures_no_force_cannot_yield() -> None:
    told = tuple(topic for topic in SLAVE_SIM.writes if topic.name != "slave/measured_cf")
    dumb = replace(SLAVE_SIM, writes=told)
    stages = build_graph(stages=["impedance"]).stages
    with pytest.raises(PartError, match="given slave/measured_cf, but no stage writes it"):
        Graph(tuple(dumb if stage.name == "slave_sim" else stage for stage in stages))
    assert IMPEDANCE.needs[0].name == "slave/measured_cf"  # its node answers nothing before
