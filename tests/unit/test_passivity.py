"""Passivity: power of a port, energies that only grow, and laws over networks drawn at random."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from teleop_core.base.parameters import NoParameters, build
from teleop_core.chain.mapping.parameters import MotionScalingParameters
from teleop_core.chain.passivity import PASSIVITIES, Passivity, register_passivity
from teleop_core.chain.passivity.port import (
    DRIFT,
    HEARD,
    IN,
    LAW,
    OUT,
    ROUND,
    TOLD,
    TURN_IN,
    TURN_OUT,
    begin_round,
    hear_energy,
)
from teleop_core.chain.passivity.slave_side import PASSIVITY, PassivityParameters
from teleop_core.chain.passivity.tank import tank_hand, tank_slave
from teleop_core.chain.passivity.tdpa import tdpa_hand, tdpa_slave
from teleop_core.graph.topics import ENERGY, OPERATION
from teleop_core.kernels.geometry import Array
from teleop_core.session.configuration import configure
from teleop_core.session.virtual import VirtualTime

pytestmark = pytest.mark.usefixtures("own_parts")
BOTH = ("teleop.stages=[network,passivity]", "feedback_timeout=1.0", "reach_force.is_on=false",
        "gimbal_noise=0.0")  # fmt: skip
TICK_NS = 1_000_000


def pressing(*texts: str, ticks: int = 12_000) -> NDArray[np.void]:
    """Signals of the scenario ``palpation`` with both ports."""
    return VirtualTime(configure("palpation", settings=[*BOTH, *texts])).run(ticks)


def slave_port() -> Callable[[Array, Array], Array]:
    """The slave's side at rest, and a call that makes a tick with force (6,) and pose (7,)."""
    stage = PASSIVITY.run(PassivityParameters())
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
def test_the_power_of_the_slaves_port_is_each_force_times_its_own_speed(
    pushed: int, along: int
) -> None:
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


def test_energies_at_the_hand_are_its_push_times_its_way_on_every_axis() -> None:
    rows = pressing("reflection.passivity=none", "operator.kind=circle", "world.material=silicone",
                    "operator.size=[0.006,0.02,0.006]")  # fmt: skip
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
    port, memory, numbers = np.zeros(len(ENERGY)), np.zeros(12), np.array([3e-4])
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


def slave_law(
    numbers: tuple[float, ...] = (0.2, 0.03, 0.01, 1e-3, 2.0),
) -> Callable[..., tuple[Array, float]]:
    """Calls of the slave's law of TDPA, 2 N against z: port and the command it gives."""
    port, memory, force = np.zeros(len(ENERGY)), np.zeros(12), np.zeros(6)
    begin_round(port, 2.0, 1.0)
    last = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    force[2] = 2.0

    def command(
        height: float, heard: float = 0.0, into: float = 0.0, out: float = 0.0, push: float = 2.0
    ) -> tuple[Array, float]:
        force[2] = push
        given = np.array([0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0])
        port[IN] += into
        flow = np.array([heard, into, out])
        tdpa_slave(np.array(numbers), memory, flow, force, last, port, port, given, 1e-3)
        last[:] = given
        return port, given[2]

    return command


@pytest.mark.parametrize("step", [1e-4, 9e-5])
def test_a_command_goes_against_the_force_as_far_as_credit_and_hand_pay_for(step: float) -> None:
    command, heard, rng = slave_law(), 0.0, np.random.default_rng(4)
    for k in range(400):
        gained = rng.choice([0.0, 1e-5])
        heard += gained
        port, height = command(-step * k, heard=gained)
        assert -2.0 * height <= 1e-3 + heard + 1e-15
    assert height > -step * k + 0.02
    np.testing.assert_allclose(port[DRIFT : DRIFT + 3], [0.0, 0.0, -step * k - height], atol=1e-15)
    for _ in range(3000):  # in the air, which costs nothing
        height = command(-step * k, push=0.0)[1]
    assert height == pytest.approx(-step * k, abs=1e-6)


def test_drift_goes_by_the_way_on_which_the_hand_comes_back_and_drives_the_arm_nowhere() -> None:
    command, step = slave_law(), 1e-4
    for k in range(300):
        height = command(-step * k)[1]
    waits = height
    for k in range(299, -1, -1):  # back, in the air
        port, given = command(-step * k, push=0.0)
        assert given >= height - 0.03 * 1e-3 - 1e-15
        if -step * k <= waits:
            assert given <= waits + 1e-12
        height = given
    assert not port[DRIFT : DRIFT + 3].any()
    assert height == 0.0


@pytest.mark.parametrize(
    ("moved", "met"), [((3e-3, 0, 0), 0), ((0, 0, -1e-3), 0), ((3e-3, 0, 1e-3), 1e-3)]
)
def test_only_the_way_against_its_drift_brings_the_hand_back(
    moved: tuple[float, int, float], met: float
) -> None:
    port, last, air = np.zeros(len(ENERGY)), np.array([0.0, 0, 0, 1, 0, 0, 0]), np.zeros(6)
    begin_round(port, 2.0, 1.0)
    port[DRIFT + 2] = -5e-3
    command = np.array([moved[0], 0.0, moved[2] - 5e-3, 1, 0, 0, 0])
    numbers = np.array([0.2, 0.0, 0.01, 1e-3, 2.0])  # else no drift is made up for
    tdpa_slave(numbers, np.zeros(12), np.zeros(3), air, last, port, port, command, 1e-3)
    assert port[DRIFT + 2] == pytest.approx(met - 5e-3, rel=1e-9)
    assert command[2] == pytest.approx(moved[2] - met, abs=1e-15)


@pytest.mark.parametrize("seed", range(20))
def test_an_exact_arm_gives_a_spring_no_more_than_credit_however_the_hand_goes(seed: int) -> None:
    """The tip is where its command is; the way of the last tick is counted with the next one."""
    rng, command, force = np.random.default_rng(seed), slave_law(), 0.0
    stiffness, height, tip, into, out = 10.0 ** rng.uniform(2.0, 4.0), 0.0, 0.0, 0.0, 0.0
    for speed in np.repeat(rng.normal(0.0, 2e-5, 60), 50):
        height += speed
        before, tip = tip, min(command(height, into=into, out=out, push=force)[1], 0.0)
        pushed = 0.5 * stiffness * (before**2 - tip**2)  # what the spring gave
        into, out, force = max(pushed, 0.0), max(-pushed, 0.0), -stiffness * tip
        # Nobody knew by how much the force grows in a tick: the last one whole, others by 0.1 %.
        assert 0.5 * stiffness * (tip**2 - (before - tip) ** 2) <= 1.001e-3


def test_a_touch_that_is_over_leaves_nothing_in_the_tank() -> None:
    memory, port, push, still = np.zeros(12), np.zeros(len(ENERGY)), np.zeros(3), np.zeros(3)

    def sample(wanted: float, last: float, moved: float) -> float:
        push[:] = wanted, 0.0, 0.0
        pushed, way = np.array([last, 0.0, 0.0]), np.array([moved, 0.0, 0.0])
        tank_hand(still, memory, pushed, way, way, still, port, port, push, 1.0, 1e-3)
        return push[0]

    assert sample(1.0, -2.0, 1e-2) == 1.0  # the hand pushed 20 mJ in
    assert sample(0.0, 0.0, 0.0) == 0.0
    assert sample(1.0, 0.0, 1e-3) < 0.01


def test_a_tank_lets_a_command_go_against_the_force_the_slower_the_larger_that_is_and_stops() -> (
    None
):
    stops = PassivityParameters().stop_force
    for size in (0.5, 2.0, stops, 3.0 * stops):
        numbers = np.array([0.2, 5e-3, 0.01, 0.0, 1.0, stops])
        port, last = np.zeros(len(ENERGY)), moved(2, 0.0)
        force = np.array([0.0, 0.6 * size, 0.8 * size, 0.0, 0.0, 0.0])
        still = np.zeros(3)
        for count in range(100):
            command = moved(2, -1e-3 * count)
            tank_slave(numbers, np.zeros(12), still, force, last, port, port, command, 1e-3)
            against = -force[:3] @ (command[:3] - last[:3]) / size
            fastest = 1e-3 * 0.05 * max(stops - size, 0.0) / size
            assert -1e-12 < against <= fastest + 1e-12
            assert np.allclose(command[:3] + port[DRIFT : DRIFT + 3], [0, 0, -1e-3 * count])
            last = command


def test_drift_of_a_tank_is_gone_once_the_hand_is_back_where_the_arm_waits() -> None:
    numbers, still = np.array([0.2, 5e-3, 0.01, 0.0, 1.0, 5.0]), np.zeros(3)
    port, last = np.zeros(len(ENERGY)), moved(2, 0.0)
    for place, force in [*((-1e-4 * k, 9.0) for k in range(100)), *((-1e-2, 9.0),) * 9,
                         *((-1e-2 + 1e-4 * k, 0.0) for k in range(101))]:  # fmt: skip
        command, pushes = moved(2, place), np.array([0.0, 0.0, force, 0.0, 0.0, 0.0])
        tank_slave(numbers, np.zeros(12), still, pushes, last, port, port, command, 1e-3)
        assert command[2] > -6e-4  # in the air drift fades, 5 mm/s at most
        last = command
    assert np.linalg.norm(port[DRIFT : DRIFT + 3]) < 1e-12


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
        "reflection.passivity=tank", "world.material=steel", f"network.there.least_delay={late}",
        f"network.back.least_delay={late}", ticks=20_000,
    )  # fmt: skip
    assert presses(rows) <= 5
    assert not rows["slave_operation"][:, OPERATION.index("fault")].any()
    assert gained(rows) < 0.3e-3


def test_what_the_arm_lent_is_paid_back_before_the_hand_gets_any() -> None:
    command = slave_law()
    assert command(0.0, out=1e-3)[0][TOLD] == 0.0
    assert command(0.0, into=6e-4)[0][TOLD] == 0.0
    assert command(0.0, into=6e-4)[0][TOLD] == pytest.approx(2e-4, rel=1e-12)
    # What the hand pays then sets free what was kept of the world's.
    assert command(0.0, heard=1e-3, into=1e-4)[0][TOLD] == pytest.approx(1.3e-3, rel=1e-12)


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
    rows = VirtualTime(configure("palpation", settings=[*texts])).run(7000)
    force = np.linalg.norm(rows["master_servo_cf"][:, :3], axis=1)
    assert force.max() == pytest.approx(1.5, rel=1e-9)


def test_with_another_passivity_energies_begin_anew_while_a_session_runs() -> None:
    session = VirtualTime(configure("palpation", settings=[*BOTH]))
    before = session.run(7500)
    assert before["master_energy"][-1, IN] > 1e-5
    values = {
        "reflection.architecture": "position_force", "reflection.passivity": "tdpa",
        "reach_force.is_on": False, "feedback_timeout": 1.0,
    }  # fmt: skip
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


def drawn(
    rng: np.random.Generator, kind: str, architecture: str = "position_force"
) -> tuple[Any, ...]:
    """Settings of a session drawn at random: world, gains, hand and network."""
    stiffness = 10.0 ** rng.uniform(1.5, 4.7)
    there = rng.uniform(0.0, 0.5)
    ways = [
        f"network.{way}.{name}={value}"
        for way, delay in (("there", there), ("back", rng.uniform(0.0, 0.5)))
        for name, value in (
            ("kind", "jitter"), ("least_delay", delay), ("jitter.mean", rng.choice([1e-4, 0.03])),
            ("loss", rng.choice([0.0, 0.2, 0.5])), ("packet_order", rng.choice(["newest", "kept"])),
        )
    ]  # fmt: skip
    return (
        f"reflection.passivity={kind}", "world.material=own", f"world.stiffness={stiffness}",
        f"world.damping={rng.choice([0.0, 0.5])}", f"hand.stiffness={rng.uniform(100.0, 1000.0)}",
        f"world.friction_coefficient={rng.choice([0.0, 0.5])}", f"seed={rng.integers(1000)}",
        f"operator.kind={rng.choice(['line', 'human', 'circle'])}",
        f"{architecture}.force_gain={rng.uniform(0.3, 3.0)}", *ways,
        *YIELDING.get(architecture, ()),
    )  # fmt: skip


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


@pytest.mark.slow
@pytest.mark.parametrize("architecture", ["position_force", "three_channel", "four_channel"])
@pytest.mark.parametrize("kind", ["tank", "tdpa"])
def test_no_network_and_no_world_makes_passivity_give_the_hand_energy(
    kind: str, architecture: str
) -> None:
    """Delay to 1 s there and back, jitter, loss to a half, 30 N/m to 50 kN/m, any grip."""
    rng = np.random.default_rng(7)
    for _ in range(10):
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


def steel(kind: str) -> float:
    """Fastest hand [m/s] that presses steel, of which it hears 50 ms later."""
    late = ("network.there.least_delay=0.025", "network.back.least_delay=0.025")
    return fastest(pressing(f"reflection.passivity={kind}", "world.material=steel", *late))


def test_steel_throws_a_hand_50_ms_away_and_passivity_keeps_it() -> None:
    assert steel("none") > 0.15
    assert steel("tdpa") < 0.06


@pytest.mark.parametrize("kind", ["tank", "tdpa"])
def test_four_channels_100_ms_away_give_the_hand_no_energy_and_the_slave_none_that_is_unpaid(
    kind: str,
) -> None:
    late = ("network.there.least_delay=0.05", "network.back.least_delay=0.05")
    rows = pressing(
        f"reflection.passivity={kind}", *YIELDING["four_channel"], "world.material=silicone", *late
    )
    check_ports(rows)
    assert np.linalg.norm(rows["master_servo_cf"], axis=1).max() > 0.5
    assert gained(rows) < 3.3 * STEP
    assert fastest(rows) < 0.1
