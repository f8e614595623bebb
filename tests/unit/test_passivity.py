"""Passivity: power of a port, energies that only grow, and laws over networks drawn at random."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from palpation import pressed
from teleop_core.base.parameters import NoParameters, build
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.coupling.passivity import PASSIVITIES, Passivity, register_passivity, slave_side
from teleop_core.coupling.passivity.port import (
    DRIFT,
    HEARD,
    IN,
    LAW,
    MARGIN,
    OUT,
    ROUND,
    TOLD,
    TURN_IN,
    TURN_OUT,
    begin_round,
    hear_energy,
)
from teleop_core.coupling.passivity.tank import tank_slave
from teleop_core.coupling.passivity.tdpa import tdpa_hand, tdpa_slave
from teleop_core.evaluation.metrics.contact import TOUCH_J
from teleop_core.graph.topics import ENERGY, MASTER_CONTACT, OPERATION
from teleop_core.kernels.geometry import Array
from teleop_core.session import configuration, virtual
from teleop_core.slave.operation import Fault
from teleop_core.slave.world.contents import MATERIALS

pytestmark = pytest.mark.usefixtures("own_parts")
BOTH = ("teleop.stages=[network,passivity]", "feedback_timeout=1.0", "reach_force.is_on=false", "gimbal_noise=0.0")
TICK_NS = 1_000_000


pressing = partial(pressed, *BOTH)


def slave_port() -> Callable[[Array, Array], Array]:
    """The slave's side at rest, and a call that makes a tick with force (6,) and pose (7,)."""
    stage = slave_side.PASSIVITY.run(slave_side.PassivityParameters())
    row = stage.signals

    def tick(force: Array, pose: Array) -> Array:
        now_ns = int(row["slave_measured_cp_ns"]) + TICK_NS
        row["slave_measured_cf"], row["slave_measured_cp"] = force, pose
        row["slave_measured_cf_ns"] = row["slave_measured_cp_ns"] = now_ns
        stage.step()
        return row["slave_energy"].copy()

    return tick


def moved(axis: int, way: float) -> Array:
    """Pose (7,) that is a way [m] along an axis from the origin, or for 3 to 5 a turn [rad]."""
    pose = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    if axis < 3:
        pose[axis] = way
    else:
        pose[3], pose[1 + axis] = np.cos(0.5 * way), np.sin(0.5 * way)
    return pose


@pytest.mark.parametrize("along", range(6))
@pytest.mark.parametrize("pushed", range(6))
def test_the_power_of_the_slaves_port_is_each_force_times_its_own_speed(pushed: int, along: int) -> None:
    """Force with speed and torque with turn, in J: 2 N over 1 mm are 2 mJ."""
    tick, force = slave_port(), np.zeros(6)
    force[pushed] = 2.0
    tick(force, moved(along, 0.0))
    there = tick(force, moved(along, 1e-3))
    back = tick(force, moved(along, 0.0))
    work = 2e-3 if pushed == along else 0.0
    into, out = (IN, OUT) if along < 3 else (TURN_IN, TURN_OUT)
    assert there[into] == pytest.approx(work, abs=1e-15)
    assert there[out] == 0.0
    assert back[out] == pytest.approx(work, abs=1e-15)
    others = [k for k in (IN, OUT, TURN_IN, TURN_OUT) if k not in (into, out)]
    assert not back[others].any()


@pytest.mark.parametrize("axis", range(6))
def test_what_is_left_to_a_slave_counts_ways_and_turns_on_all_six_axes(axis: int) -> None:
    stage = slave_side.PASSIVITY.run(slave_side.PassivityParameters())
    row = stage.signals
    row["master_energy"][[LAW, ROUND]] = PASSIVITIES.names().index("tdpa"), 1.0
    for k, way in enumerate((0.0, 0.0, -1e-3, -2e-3)):
        row["slave_measured_cf"], row["slave_measured_cp"] = pushed(axis, 2.0), moved(axis, way)
        row["slave_servo_cp"] = moved(axis, 0.0)
        for name in ("slave_measured_cf", "slave_measured_cp", "slave_servo_cp"):
            row[f"{name}_ns"] = (k + 1) * TICK_NS
        stage.step()
    assert row["slave_energy"][MARGIN] == pytest.approx(-4e-3, rel=1e-6)


def test_energies_at_the_hand_are_its_push_times_its_way_on_every_axis() -> None:
    rows = pressing(
        "reflection.passivity=none",
        "operator.kind=circle",
        "world.material=silicone",
        "operator.size=[0.006,0.02,0.006]",
    )
    push, place = rows["master_servo_cf"][:-1, :3], rows["master_measured_cp"][:, :3]
    told = rows["master_energy"]
    begun = int(np.argmax(np.diff(told[:, ROUND]) == 0.0)) + 1
    assert (told[begun:, ROUND] == told[-1, ROUND]).all()
    work = -np.einsum("ij,ij->i", push, np.diff(place, axis=0))[begun:]
    assert np.all(np.abs(push).max(axis=0) > 0.05)  # on every axis
    np.testing.assert_allclose(told[-1, IN], work[work > 0.0].sum(), rtol=1e-9)
    np.testing.assert_allclose(told[-1, OUT], -work[work < 0.0].sum(), rtol=1e-9)


def test_energies_that_are_lost_late_or_doubled_take_nothing_away() -> None:
    rng, port, sent = np.random.default_rng(1), np.zeros(len(ENERGY)), []
    begin_round(port, 2.0, 1.0)
    for told in np.cumsum(rng.uniform(0.0, 1e-3, 200)):
        sent.append(np.zeros(len(ENERGY)))
        sent[-1][[LAW, ROUND, TOLD]] = 2.0, 1.0, told
    newest, gained = 0.0, 0.0
    for i in rng.integers(0, 200, 400):
        gained += hear_energy(port, sent[i])
        newest = max(newest, sent[i][TOLD])
        assert port[HEARD] == newest == pytest.approx(gained, rel=1e-12)
    sent[-1][ROUND] = 0.5
    port[HEARD] = 0.0
    assert hear_energy(port, sent[-1]) == 0.0  # of another round


def hand_port(rng: np.random.Generator, count: int = 4000) -> Iterator[tuple[Array, float, Array]]:
    """A hand that shakes under a push of 2 N and hears energy now and then: port, way, heard."""
    port, memory, numbers = np.zeros(len(ENERGY)), np.zeros(12), np.array([3e-4, 0.0, 0.0])
    begin_round(port, 2.0, 1.0)
    push, way = np.zeros(3), 0.0
    for _ in range(count):
        moved = np.array([rng.uniform(-6e-5, 6e-5), 0.0, 0.0])
        came, gained = -float(push @ moved), rng.choice([0.0, 2e-5])
        way += abs(moved[0])
        port[IN if came > 0.0 else OUT] += abs(came)
        port[HEARD] += gained
        flow, last = np.array([gained, max(came, 0.0), max(-came, 0.0)]), push.copy()
        push[:] = 2.0, 0.0, 0.0
        tdpa_hand(numbers, memory, last, moved, moved, flow, port, port, push, 1.0, 1e-3)
        yield port, way, push


def test_the_hand_is_given_no_more_than_was_heard_and_what_it_put_in_and_did_not_tell() -> None:
    """At every sample, but for the 5 mN of an empty port on its way."""
    pushes = []
    for port, way, push in hand_port(np.random.default_rng(3)):
        assert port[OUT] <= port[HEARD] + port[IN] - port[TOLD] + 0.005 * way + 1e-15
        pushes.append(push[0])
    assert min(pushes) < 0.1
    assert max(pushes) == 2.0


SPRING = 1300.0
"""Stiffness against which a lead is paid for [N/m]."""
NUMBERS = (0.2, 0.03, 0.01, 1e-3, 1.0, 5.0, SPRING)
"""Of the slave's side: recovery, its speed, least force, credit, two others, and that stiffness."""


def slave_law(law: Callable[..., None] = tdpa_slave) -> Callable[..., tuple[Array, Array]]:
    """Calls of a slave's law: port and the command (7,) that it gives."""
    port, memory = np.zeros(len(ENERGY)), np.zeros(12)
    begin_round(port, 2.0, 1.0)
    last = moved(2, 0.0)

    def command(
        wanted: Array, tip: Array, force: Array, heard: float = 0.0, into: float = 0.0, out: float = 0.0
    ) -> tuple[Array, Array]:
        given = wanted.copy()
        port[IN] += into
        flow = np.array([heard, into, out])
        law(np.array(NUMBERS), memory, flow, force, tip, last, port, port, given, 1e-3)
        last[:] = given
        return port, given

    return command


def pushed(axis: int, size: float) -> Array:
    """Force (6,) [N] along an axis, or torque [N m] for 3 to 5."""
    force = np.zeros(6)
    force[axis] = size
    return force


def paid_lead(force: float, left: float) -> float:
    """Way [m] into a spring that has a force [N] already, on which so much energy [J] is spent."""
    return (np.sqrt(force**2 + 2.0 * SPRING * left) - force) / SPRING


@pytest.mark.parametrize("force", [0.0, 0.5, 8.0])
@pytest.mark.parametrize("heard", [0.0, 4e-3])
def test_a_command_is_ahead_of_the_tip_as_far_as_credit_and_hand_pay_for(force: float, heard: float) -> None:
    command, most = slave_law(), paid_lead(force, 1e-3 + heard)
    port, given = command(moved(2, -0.02), moved(2, 0.0), pushed(2, force), heard=heard)
    assert -given[2] == pytest.approx(most, rel=1e-9)
    np.testing.assert_allclose(port[DRIFT : DRIFT + 3], [0.0, 0.0, given[2] * -1 - 0.02])
    # Along a surface too, whose friction may turn; but back it goes freely.
    _, given = command(moved(0, 0.02), moved(2, 0.0), pushed(2, force))
    assert given[0] <= most + 1e-12
    if force > 0.0:
        assert slave_law()(moved(2, 0.02), moved(2, 0.0), pushed(2, force))[1][2] == 0.02


@pytest.mark.parametrize("axis", range(6))
def test_with_nothing_left_no_command_goes_against_force_or_torque(axis: int) -> None:
    tip = moved(axis, 0.0)
    for way, expected in ((-0.01, tip), (0.01, moved(axis, 0.01))):
        command = slave_law()
        command(tip, tip, pushed(axis, 1.0), out=1.5e-3)
        given = command(moved(axis, way), tip, pushed(axis, 1.0))[1]
        np.testing.assert_allclose(given, expected, atol=1e-12)


def test_what_the_arm_lent_is_not_lent_again_in_the_next_touch() -> None:
    command, tip, lent = slave_law(), moved(2, 0.0), 0.0
    for _ in range(20):
        for _ in range(50):
            given = command(moved(2, -0.02), tip, pushed(2, 0.0))[1]
        lead = -given[2]
        spent = 0.5 * SPRING * lead**2  # the arm goes there, into such a spring
        lent += spent
        command(moved(2, -0.02), moved(2, -lead), pushed(2, SPRING * lead), out=spent)
        command(moved(2, 0.02), tip, pushed(2, 0.0))
    assert lent <= 1e-3 * (1.0 + 1e-9)
    assert lead < 1e-6


@pytest.mark.parametrize("seed", range(8))
def test_an_arm_that_lags_gives_a_spring_no_more_than_was_paid_however_the_hand_goes(seed: int) -> None:
    """Of springs that are no stiffer than the one that is paid for."""
    rng, command = np.random.default_rng(seed), slave_law()
    stiffness, lag = SPRING * rng.uniform(0.05, 1.0), rng.uniform(1.0, 60.0)
    height, tip, into, out, heard, given = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for speed in np.repeat(rng.normal(0.0, 3e-5, 60), 50):
        height += speed
        gained = float(rng.choice([0.0, 1e-5], p=[0.9, 0.1]))
        heard += gained
        force = max(-stiffness * tip, 0.0)
        port, now = command(moved(2, height), moved(2, tip), pushed(2, force), gained, into, out)
        given = now[2]
        before, tip = tip, tip + (given - tip) / (1.0 + lag)
        work = 0.5 * stiffness * (min(before, 0.0) ** 2 - min(tip, 0.0) ** 2)
        into, out = max(work, 0.0), max(-work, 0.0)
        assert 0.5 * stiffness * min(tip, 0.0) ** 2 <= 1e-3 + heard - port[TOLD] + 1e-12


def test_drift_goes_by_the_way_on_which_the_hand_comes_back_and_drives_the_arm_nowhere() -> None:
    command, step, tip = slave_law(), 1e-4, moved(2, 0.0)
    for k in range(300):
        waits = command(moved(2, -step * k), tip, pushed(2, 2.0))[1][2]
    height = waits
    for k in range(299, -1, -1):  # back, in the air
        port, given = command(moved(2, -step * k), moved(2, waits), pushed(2, 0.0))
        assert given[2] >= height - 0.03 * 1e-3 - 1e-15
        if -step * k <= waits:
            assert given[2] <= waits + 1e-12
        height = given[2]
    assert not port[DRIFT : DRIFT + 3].any()
    assert height == 0.0


@pytest.mark.parametrize(("way", "met"), [((3e-3, 0, 0), 0), ((0, 0, -1e-3), 0), ((3e-3, 0, 1e-3), 1e-3)])
def test_only_the_way_against_its_drift_brings_the_hand_back(way: tuple[float, int, float], met: float) -> None:
    port, last, air = np.zeros(len(ENERGY)), moved(0, 0.0), np.zeros(6)
    begin_round(port, 2.0, 1.0)
    port[DRIFT + 2] = -5e-3
    command = np.array([way[0], 0.0, way[2] - 5e-3, 1, 0, 0, 0])
    numbers = np.array([0.2, 0.0, 0.01, 1.0, 1.0, 5.0, SPRING])  # else no drift is made up for
    tdpa_slave(numbers, np.zeros(12), np.zeros(3), air, last, last, port, port, command, 1e-3)
    assert port[DRIFT + 2] == pytest.approx(met - 5e-3, rel=1e-9)
    assert command[2] == pytest.approx(way[2] - met, abs=1e-15)


HAND_NUMBERS = np.array([3e-4, 6e-3, 10.0])
"""Of the hand's side: kept way, store of the slave, drag while it is empty."""


@pytest.mark.parametrize(("left", "after"), [(5e-3, 0.0), (-1e-3, -1e-3)])
def test_a_touch_that_is_over_leaves_nothing_to_give_but_what_is_owed(left: float, after: float) -> None:
    memory, port, push, still = np.zeros(12), np.zeros(len(ENERGY)), np.zeros(3), np.zeros(3)
    heard = port.copy()
    port[MARGIN] = left
    tdpa_hand(HAND_NUMBERS, memory, still, still, still, still, heard, port, push, 1.0, 1e-3)
    assert port[MARGIN] == after
    push[0] = 1.0
    tdpa_hand(HAND_NUMBERS, memory, still, still, still, still, heard, port, push, 1.0, 1e-3)
    assert push[0] <= 0.005


def test_a_hand_pays_by_a_drag_until_the_slave_has_its_store_and_no_longer() -> None:
    memory, port, heard = np.zeros(12), np.zeros(len(ENERGY)), np.zeros(len(ENERGY))
    for energies in (port, heard):
        begin_round(energies, 2.0, 1.0)
    moved_on, push, still, drags = np.array([5e-5, 0.0, 0.0]), np.zeros(3), np.zeros(3), []
    for _ in range(4000):
        came = -float(push @ moved_on)
        port[IN] += max(came, 0.0)
        flow, last = np.array([0.0, max(came, 0.0), max(-came, 0.0)]), push.copy()
        push[:] = 0.0
        tdpa_hand(HAND_NUMBERS, memory, last, moved_on, still, flow, heard, port, push, 1.0, 1e-3)
        drags.append(-push[0])
    assert 0.4 < max(drags) < 10.0 * 0.05
    assert drags[-1] < 0.02
    assert port[TOLD] == pytest.approx(6e-3, rel=0.05)  # on its way, though nobody has heard it
    heard[MARGIN], heard[HEARD] = -2e-3, port[TOLD]  # spent, and more
    tdpa_hand(HAND_NUMBERS, memory, push, moved_on, still, flow, heard, port, push, 1.0, 1e-3)
    assert -push[0] == pytest.approx(10.0 * 0.05, rel=0.1)


@pytest.mark.parametrize("size", [0.5, 2.0, 5.0, 15.0])
def test_a_tank_lets_a_command_go_against_the_force_the_less_the_larger_that_is_and_stops(size: float) -> None:
    command, tip = slave_law(tank_slave), moved(2, 0.0)
    force = np.array([0.0, 0.6 * size, 0.8 * size, 0.0, 0.0, 0.0])
    port, given = command(moved(2, -0.02), tip, force, heard=1.0)
    against = -force[:3] @ given[:3] / size
    assert against == pytest.approx(min(max(5.0 - size, 0.0) / SPRING, 0.016), abs=1e-12)
    np.testing.assert_allclose(given[:3] + port[DRIFT : DRIFT + 3], [0.0, 0.0, -0.02])


def presses(rows: Any) -> int:
    """Stretches in which the tip is pressed, breaks of 50 ms and less left out."""
    force = np.linalg.norm(rows["slave_measured_cf"][:, :3], axis=1)
    on = np.flatnonzero(force > 0.05)
    return 1 + int(np.sum(np.diff(on) > 50))


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.0, 0.35])
def test_a_hand_with_a_tank_rests_on_steel_without_bouncing_near_and_far(late: float) -> None:
    """The hand of the scenario presses four or five times in 20 s."""
    rows = pressing(
        "reflection.passivity=tank",
        "world.material=steel",
        f"network.there.least_delay={late}",
        f"network.back.least_delay={late}",
        ticks=20_000,
    )
    assert presses(rows) <= 5
    assert not rows["slave_operation"][:, OPERATION.index("fault")].any()
    assert gained(rows) < 0.3e-3


def test_what_the_arm_lent_is_paid_back_before_the_hand_gets_any() -> None:
    law, tip = slave_law(), moved(2, 0.0)

    def told(**flow: float) -> float:
        return float(law(tip, tip, pushed(2, 2.0), **flow)[0][TOLD])

    assert told(out=1e-3) == 0.0
    assert told(into=6e-4) == 0.0
    assert told(into=6e-4) == pytest.approx(2e-4, rel=1e-12)
    # What the hand pays then sets free what was kept of the world's.
    assert told(heard=1e-3, into=1e-4) == pytest.approx(1.3e-3, rel=1e-12)


def test_no_part_pushes_harder_than_allowed() -> None:
    def rude(
        numbers: Array,
        memory: Array,
        last: Array,
        moved: Array,
        led: Array,
        flow: Array,
        heard: Array,
        port: Array,
        push: Array,
        scale: float,
        period: float,
    ) -> None:
        push *= 100.0

    register_passivity(Passivity("rude", NoParameters, rude))
    texts = ("reflection.passivity=rude", "reflection.max_force=1.5", "reach_force.is_on=false")
    rows = virtual.VirtualTime(configuration.configure("palpation", settings=[*texts])).run(7000)
    force = np.linalg.norm(rows["master_servo_cf"][:, :3], axis=1)
    assert force.max() == pytest.approx(1.5, rel=1e-9)


def test_with_another_passivity_energies_begin_anew_while_a_session_runs() -> None:
    session = virtual.VirtualTime(configuration.configure("palpation", settings=[*BOTH]))
    before = session.run(7500)
    assert before["master_energy"][-1, IN] > 1e-5
    values = {
        "reflection.architecture": "position_force",
        "reflection.passivity": "tdpa",
        "reach_force.is_on": False,
        "feedback_timeout": 1.0,
    }
    session.stages["motion_scaling"].retune(build(MotionScalingParameters, values))
    after = session.run(3000)
    told = after["master_energy"]
    assert told[0, LAW] == PASSIVITIES.names().index("tdpa")
    assert told[0, ROUND] > before["master_energy"][-1, ROUND]
    assert np.all(after["slave_energy"][10:, ROUND] == told[0, ROUND])
    assert told[0, [IN, OUT, TOLD, HEARD]].max() < 1e-5
    check_ports(after)


STEP = 55e-6
"""Step of the device's reading [m]."""
YIELDING = {
    name: (f"reflection.architecture={name}", "teleop.stages=[network,impedance,passivity]")
    for name in ("three_channel", "four_channel")
}
"""Settings of architectures before a slave that yields."""


def drawn(rng: np.random.Generator, kind: str, architecture: str = "position_force") -> tuple[Any, ...]:
    """Settings of a session drawn at random: world, gains, hand and network."""
    stiffness = 10.0 ** rng.uniform(1.5, 4.7)
    there = rng.uniform(0.0, 0.5)
    ways = [
        f"network.{way}.{name}={value}"
        for way, delay in (("there", there), ("back", rng.uniform(0.0, 0.5)))
        for name, value in (
            ("kind", "jitter"),
            ("least_delay", delay),
            ("jitter.mean", rng.choice([1e-4, 0.03])),
            ("loss", rng.choice([0.0, 0.2, 0.5])),
            ("packet_order", rng.choice(["newest", "kept"])),
        )
    ]
    return (
        f"reflection.passivity={kind}",
        "world.material=own",
        f"world.stiffness={stiffness}",
        f"world.damping={rng.choice([0.0, 0.5])}",
        f"hand.stiffness={rng.uniform(100.0, 1000.0)}",
        f"world.friction_coefficient={rng.choice([0.0, 0.5])}",
        f"seed={rng.integers(1000)}",
        f"operator.kind={rng.choice(['line', 'human', 'circle'])}",
        f"{architecture}.force_gain={rng.uniform(0.3, 3.0)}",
        *ways,
        *YIELDING.get(architecture, ()),
    )


def gained(rows: Any) -> float:
    """Most that a touch gave the hand beyond what it took, but for 5 mN on its way [J]."""
    force, place = rows["master_servo_cf"][:-1, :3], rows["master_measured_cp"][:, :3]
    steps = np.diff(place, axis=0)
    work = np.einsum("ij,ij->i", force, steps) - 0.005 * np.linalg.norm(steps, axis=1)
    largest = total = 0.0
    for step, pushes in zip(work.tolist(), force.any(axis=1).tolist(), strict=True):
        total = total + step if pushes else 0.0
        largest = max(largest, total)
    return largest


def fastest(rows: NDArray[np.void]) -> float:
    """Fastest that the hand gets [m/s] once it leads the slave."""
    places = rows["master_measured_cp"][5000:, :3]
    return np.linalg.norm(places[20:] - places[:-20], axis=1).max() / 0.02


def check_ports(rows: NDArray[np.void]) -> None:
    """Neither side heard more than the other told, and told no more than came in, in any round."""
    hand, slave = rows["master_energy"], rows["slave_energy"]
    for own, other in ((hand, slave), (slave, hand)):
        assert np.all(own[:, TOLD] <= own[:, IN] + 1e-15)
        for number in np.unique(own[:, ROUND])[-3:]:
            mine, theirs = own[own[:, ROUND] == number], other[other[:, ROUND] == number]
            assert np.all(np.diff(mine[:, [IN, OUT, TOLD, HEARD]], axis=0) >= 0.0)
            most = theirs[:, TOLD].max(initial=0.0)
            assert mine[:, HEARD].max() <= most


def left_at_the_hand(rows: Any, scale: float) -> float:
    """Least that the hand's port had left to give in a touch, by forces and places alone [J]."""
    hand, force = rows["master_energy"], rows["master_servo_cf"][:-1, :3]
    steps = np.diff(rows["master_measured_cp"][:, :3], axis=0)
    came = -np.einsum("ij,ij->i", force, steps) + 0.005 * np.linalg.norm(steps, axis=1)
    same = np.diff(hand[:, ROUND]) == 0.0
    heard, told = (np.diff(hand[:, k]) * same for k in (HEARD, TOLD))
    change = scale * (heard - told) + came
    least = left = 0.0
    for step, pushes in zip(change.tolist(), force.any(axis=1).tolist(), strict=True):
        left = left + step if pushes else 0.0
        least = min(least, left)
    return least


def created(rows: Any, scale: float) -> float:
    """Most that came out of both true ports together beyond what went in [J], at any time.

    At the hand the force that the device applied times what it reads; at the slave the true force
    and torque times the true way and turn of the tip.
    """
    push, place = rows["master_measured_cf"][1:, :3], rows["master_measured_cp"][:, :3]
    given = np.einsum("ij,ij->i", push, np.diff(place, axis=0)) / scale
    force, pose = rows["slave_true_cf"], rows["slave_true_cp"]
    turns = Rotation.from_quat(pose[:, 3:], scalar_first=True)
    ways = np.hstack((np.diff(pose[:, :3], axis=0), (turns[1:] * turns[:-1].inv()).as_rotvec()))
    given -= np.einsum("ij,ij->i", 0.5 * (force[1:] + force[:-1]), ways)
    return float(np.cumsum(given).max(initial=0.0))


def worked(rng: np.random.Generator, kind: str, architecture: str) -> tuple[Any, ...]:
    """Settings of :func:`drawn`, in half of the cases of a material or along another path."""
    texts = drawn(rng, kind, architecture)
    if rng.random() < 0.5:
        texts = tuple(text for text in texts if not text.startswith("world."))
        texts += (f"world.material={rng.choice(list(MATERIALS))}",)
    if rng.random() < 0.5:
        size = (rng.uniform(0.0, 0.02), rng.uniform(0.02, 0.04), rng.uniform(0.0, 0.02))
        texts += (f"operator.size={[round(side, 3) for side in size]}",)
    return texts


LENT = 1e-3
"""Bound of what is lent in all [J]: the credit of 0.2 mJ, and a touch that was met too fast."""


MANY = [("slow",), ("slow", "soak"), ("slow", "soak"), ("slow", "soak")]


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        *((kind, 11) for kind in ("tank", "tdpa", "wave")),
        *(
            pytest.param(kind, 100 + k, marks=[getattr(pytest.mark, mark) for mark in marks])
            for kind in ("tank", "tdpa")
            for k, marks in enumerate(MANY)
        ),
    ],
)
def test_no_session_takes_more_out_of_both_true_ports_than_it_put_in_and_was_lent_once(kind: str, seed: int) -> None:
    rng, is_long = np.random.default_rng(seed), seed >= 100
    for number in range(12 if is_long else 6):
        architecture = ("four_channel", "position_force", "three_channel" if is_long else "position_force")[number % 3]
        texts = worked(rng, kind, "position_force" if kind == "wave" else architecture)  # it leads the tip itself
        scale = float(next(t for t in texts if "force_gain" in t).partition("=")[2])
        assert created(pressing(*texts, ticks=12_000 if is_long else 9000), scale) < LENT, texts


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1003, 1078, 1118])
def test_an_arm_whose_tip_is_not_where_its_encoders_say_lends_little_more(seed: int) -> None:
    """The worst of 120 sessions: commands 120 ms apart, ahead of the tip before a hard object."""
    architecture = ("position_force", "three_channel", "four_channel")[seed % 3]
    texts = worked(np.random.default_rng(seed), "tdpa", architecture)
    scale = float(next(t for t in texts if "force_gain" in t).partition("=")[2])
    rows = pressing(*texts, "plant.kind=hardware")
    assert presses(rows) >= 2
    assert created(rows, scale) < 1.2 * LENT


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "is_stopped"), [("tdpa", True), ("tank", False)])
def test_a_hand_that_hears_nothing_leads_the_drives_to_their_limit_on_steel_but_with_a_tank(
    kind: str, is_stopped: bool
) -> None:
    """Energy is bounded by both, force by the tank alone."""
    texts = worked(np.random.default_rng(32), kind, "four_channel")
    rows = pressing(*texts)
    fault = rows["slave_operation"][:, OPERATION.index("fault")].max()
    assert fault == (Fault.EFFORT if is_stopped else Fault.NONE)
    assert (np.linalg.norm(rows["slave_true_cf"][:, :3], axis=1).max() > 10.0) == is_stopped


@pytest.mark.parametrize(("kind", "material"), [("tank", "steel"), ("tdpa", "rubber"), ("tdpa", "wood")])
def test_touch_after_touch_of_something_rough_and_hard_creates_no_energy(kind: str, material: str) -> None:
    rows = pressing(
        f"reflection.passivity={kind}",
        f"world.material={material}",
        "operator.kind=circle",
        "operator.size=[0.02,0.03,0.0]",
        "network.there.least_delay=0.05",
        "network.back.least_delay=0.05",
        ticks=16_000,
    )
    assert created(rows, 1.0) < LENT
    assert presses(rows) >= 3
    assert np.linalg.norm(rows["master_measured_cf"][:, :3], axis=1).max() > 1.0
    assert not rows["slave_operation"][:, OPERATION.index("fault")].any()


@pytest.mark.slow
@pytest.mark.parametrize("architecture", ["position_force", "three_channel", "four_channel"])
@pytest.mark.parametrize("kind", ["tank", "tdpa"])
def test_no_network_and_no_world_makes_passivity_give_the_hand_energy(kind: str, architecture: str) -> None:
    """Delay to 1 s there and back, jitter, loss to a half, 30 N/m to 50 kN/m, any grip."""
    rng = np.random.default_rng(7)
    for _ in range(6):
        texts = drawn(rng, kind, architecture)
        rows = pressing(*texts, ticks=9000)
        force = np.linalg.norm(rows["master_servo_cf"][:, :3], axis=1)
        assert force.max() <= 3.3 + 1e-9, texts
        # A far spring drags before it lets go: what a hand then gets it has put into the tank.
        assert fastest(rows) < (0.2 if architecture == "position_force" else 0.3), texts
        check_ports(rows)
        if kind == "tank":
            assert gained(rows) < 3.3 * STEP, texts
        else:
            scale = float(next(t for t in texts if "force_gain" in t).partition("=")[2])
            assert left_at_the_hand(rows, scale) > -3.3 * STEP, texts


def wall_shares(kind: str, stiffness: float) -> tuple[float, float]:
    """Largest share and energy [J] that a contact with the wall of a box gave beyond what it took.

    The hand is that of ``coarse_box``; the slave touches nothing.
    """
    texts = (
        "reflection.architecture=position_force",
        f"reflection.passivity={kind}",
        f"fixture.stiffness={stiffness}",
        "fixture.damping=10.0",
    )
    contact = virtual.VirtualTime(configuration.configure("coarse_box", settings=texts)).run(30_000)["master_contact"]
    ends = np.flatnonzero(np.diff(contact[:, 0], append=-1.0))
    taken, returned = (contact[ends, MASTER_CONTACT.columns.index(name)] for name in ("taken", "returned"))
    is_contact = taken > TOUCH_J
    assert is_contact.sum() >= 5
    shares = returned[is_contact] / taken[is_contact]
    return float(shares.max()), float((returned - taken).max())


@pytest.mark.parametrize("stiffness", [2310.0, 5000.0])
def test_a_stiff_wall_gives_back_no_more_than_it_took_with_passivity(stiffness: float) -> None:
    share, gain = wall_shares("none", stiffness)
    assert share > 1.1
    assert gain > 5e-6
    share, gain = wall_shares("tank", stiffness)
    assert share < 1.02  # the device bends, which its reading does not see
    assert gain < 5e-7


@pytest.mark.parametrize("kind", ["tank", "tdpa"])
def test_a_session_begins_without_a_blow(kind: str) -> None:
    """The slave is at home, so that the hand leads it from the first sample on."""
    texts = ("teleop.stages=[passivity]", "reflection.architecture=position_force", f"reflection.passivity={kind}")
    rows = virtual.VirtualTime(configuration.configure("coarse_box", settings=texts)).run(1000)
    assert rows["teleop_state"][100, 0] == 1.0
    assert np.linalg.norm(rows["master_servo_cf"][:, :3], axis=1).max() < 0.3


def steel(kind: str) -> float:
    """Fastest hand [m/s] that presses steel, of which it hears 50 ms later."""
    late = ("network.there.least_delay=0.025", "network.back.least_delay=0.025")
    return fastest(pressing(f"reflection.passivity={kind}", "world.material=steel", *late))


def test_steel_throws_a_hand_50_ms_away_and_passivity_keeps_it() -> None:
    assert steel("none") > 0.15
    assert steel("tdpa") < 0.06
