"""Jaw: it holds in every stop, grips as hard as its drive can, and lets slide what Coulomb says."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

import teleop_core as tc
from present import present
from teleop_core.coupling.mapping.jaw_command import JAW_COMMAND, JawCommandParameters
from teleop_core.graph import TICK_NS, topics
from teleop_core.graph.operation import State
from teleop_core.kernels.geometry import Array
from teleop_core.slave.jaw.grip import WEIGHT
from teleop_core.slave.jaw.jaw import Jaw, JawParameters
from teleop_core.slave.jaw.jaw_sim import JawSim
from teleop_core.slave.jaw.parameters import GripObjectParameters, JawSimParameters, PegParameters

ENABLED, STATE = float(State.ENABLED), topics.OPERATION.index("state")
PLACE = np.array([0.2, -0.1, 0.05])
OPEN, CLOSED = 0.8, 0.0
FORCE, IS_GRIPPED, SLID, GRIPS, SLIPS, DROPS = range(len(topics.SLAVE_JAW_GRIP.columns))


class Bench:
    """An open jaw, its drive, and a hand that leads it; the tip is led by hand too."""

    def __init__(self, *, jaw: Mapping[str, Any] | None = None, places: Array = PLACE, **thing: float) -> None:
        self.given = JawSimParameters(
            **(jaw or {}), object=GripObjectParameters(place=tuple(np.ravel(places)), **thing)
        )
        self.server, self.sim = Jaw(JawParameters()), JawSim(self.given)
        self.row, self.told = self.server.signals, self.sim.signals
        self._steps = self.server.load(), self.sim.load()
        self.row["slave_operation"][STATE] = ENABLED
        self.tip = np.array([*PLACE, 1.0, 0.0, 0.0, 0.0])
        self.rows: list[Any]
        self.rows = []
        self.run(OPEN, 2)

    def tick(self, command: float | None = None, tip: Any = None, *, is_seen: bool = True) -> None:
        row, told, now_ns = self.row, self.told, int(self.row["now_ns"]) + TICK_NS
        row["now_ns"] = told["now_ns"] = now_ns
        if command is not None:
            row["slave_jaw_servo_jp"], row["slave_jaw_servo_jp_ns"] = command, now_ns
        self.tip[:3] = self.tip[:3] if tip is None else tip
        told["slave_true_cp"], told["slave_true_cp_ns"] = self.tip, now_ns
        self._steps[0]()
        for name in ("slave_jaw_setpoint_js", "slave_jaw_setpoint_js_ns"):
            told[name] = row[name]
        self._steps[1]()
        if is_seen:  # in the next tick
            row["slave_jaw_measured_js"] = told["slave_jaw_measured_js"]
            row["slave_jaw_measured_js_ns"] = now_ns
        self.rows.append(
            np.concatenate([told["slave_jaw_" + name] for name in ("setpoint_js", "measured_js", "grip", "object_cp")])
        )

    def run(self, command: float | None, ticks: int) -> None:
        for _ in range(ticks):
            self.tick(command)

    def carry(self, command: float, places: Array) -> None:
        for place in places:
            self.tick(command, place)

    @property
    def grip(self) -> Array:
        return self.told["slave_jaw_grip"].copy()

    @property
    def board(self) -> dict[str, float]:
        return dict(zip(topics.SLAVE_JAW_BOARD.columns, self.told["slave_jaw_board"], strict=True))

    @property
    def middles(self) -> Array:
        return self.told["slave_jaw_board"][3:].reshape(-1, 3).copy()

    @property
    def object(self) -> Array:
        return self.told["slave_jaw_object_cp"].copy()


def lift(height: float, ticks: int = 600) -> Array:
    """Places (N, 3) from the table up, at rest at both ends."""
    x = np.linspace(0.0, 1.0, ticks)
    rise = height * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return PLACE + rise[:, None] * np.array([0.0, 0.0, 1.0])


def stall_force(bench: Bench) -> float:
    """Push of each finger of a jaw that is asked to close, by the lever of the angle there."""
    p, angle = bench.given, bench.row["slave_jaw_measured_js"][0]
    effort = min(p.effort_limit, p.inertia * p.bandwidth**2 * angle)
    return effort / (p.finger_length * math.cos(0.5 * angle))


@pytest.mark.parametrize(("size", "stiffness"), [(0.01, 4e3), (0.02, 300.0), (0.028, 1e5)])
def test_a_stalled_jaw_presses_with_its_effort_over_its_lever(size: float, stiffness: float) -> None:
    bench = Bench(size=size, stiffness=stiffness)
    bench.run(OPEN, 200)
    bench.run(CLOSED, 2000)
    assert bench.grip[FORCE] == pytest.approx(stall_force(bench), rel=1e-6)
    width = 2.0 * 0.04 * math.sin(0.5 * bench.row["slave_jaw_measured_js"][0])
    assert size - width == pytest.approx(bench.grip[FORCE] / stiffness, rel=1e-6)
    assert bench.grip[GRIPS] == 1
    outside = 2.0 * 0.04 * np.sin(0.5 * np.array(bench.rows)[1:, 1]) > size
    assert not np.array(bench.rows)[:-1, 4 + FORCE][outside].any()


@pytest.mark.parametrize("stiffness", [300.0, 4e3, 1e5])
def test_the_push_at_impact_stays_below_that_of_a_mass_on_a_spring_without_losses(stiffness: float) -> None:
    bench = Bench(stiffness=stiffness, damping=0.0)
    bench.run(OPEN, 200)
    bench.run(CLOSED, 600)
    p, found = bench.given, np.array(bench.rows)
    speed = p.finger_length * np.abs(found[:, 2]).max()
    mass, held = p.inertia / p.finger_length**2, stall_force(bench)
    # x of m x'' + k x = F from speed v: the peak of the spring's force is F + sqrt(F² + k m v²).
    lever = math.cos(0.5 * found[:, 1].max())
    most = held + math.sqrt(held**2 + stiffness * mass / lever**2 * speed**2)
    assert held < found[:, 4 + FORCE].max() <= most * (1.0 + 1e-9)


@pytest.mark.parametrize(("share", "mass"), [(0.98, 0.02), (1.02, 0.2)])
def test_what_is_lifted_slides_only_where_friction_of_both_fingers_is_less_than_its_weight(
    share: float, mass: float
) -> None:
    probe = Bench(mass=mass)
    probe.run(CLOSED, 600)
    friction = share * mass * WEIGHT / (2.0 * probe.grip[FORCE])
    bench = Bench(mass=mass, friction=friction)
    bench.run(CLOSED, 600)
    bench.carry(CLOSED, lift(0.04, ticks=8000))  # slowly: at most 0.4 mm/s² beside gravity
    if share > 1.0:
        np.testing.assert_allclose(bench.object[:3], PLACE + np.array([0.0, 0.0, 0.04]), atol=1e-9)
        assert bench.grip[SLIPS] == bench.grip[DROPS] == 0
    else:
        assert bench.object[2] == pytest.approx(PLACE[2], abs=1e-9)
        assert bench.grip[SLIPS] == 1


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_what_is_carried_slides_only_where_friction_is_less_than_weight_and_pull(share: float) -> None:
    pull = 6.0  # m/s², across
    probe = Bench()
    probe.run(CLOSED, 600)
    needed = 0.05 * math.hypot(WEIGHT, pull)
    bench = Bench(friction=share * needed / (2.0 * probe.grip[FORCE]))
    bench.run(CLOSED, 600)
    bench.carry(CLOSED, lift(0.02, ticks=2000))
    before = bench.grip[SLID]
    times = 1e-3 * np.arange(1, 101)
    bench.carry(CLOSED, bench.tip[:3] + 0.5 * pull * times[:, None] ** 2 * np.array([1.0, 0, 0]))
    slid = bench.grip[SLID] - before
    assert slid == 0.0 if share > 1.0 else slid > 1e-5


def interrupt(bench: Bench, how: str | State, command: float) -> None:
    """Half a second in which the jaw holds, though another angle is commanded in the end."""
    if isinstance(how, State):
        bench.row["slave_operation"][STATE] = float(how)
        bench.run(command, 500)
        bench.row["slave_operation"][STATE] = ENABLED
    elif how == "silence":
        bench.run(None, 500)
    elif how == "no feedback":
        before = float(bench.row["slave_jaw_servo_jp"][0])
        for i in range(500):
            bench.tick(before if i < 150 else command, is_seen=False)
    else:
        bench.run(math.nan, 500)


HOLDS = (State.DISABLED, State.PAUSED, State.FAULT, "silence", "no feedback", "no number")


@pytest.mark.parametrize("how", HOLDS)
def test_a_needle_stays_held_after_a_stop_until_the_hand_has_closed_and_opened_again(how: str | State) -> None:
    bench = Bench(size=0.001, mass=0.001)  # 1 mm thick
    bench.run(CLOSED, 600)
    bench.carry(CLOSED, lift(0.05))
    force, place = bench.grip[FORCE], bench.object
    interrupt(bench, how, OPEN)
    bench.run(OPEN, 1000)
    assert "close the hand first" in bench.server.concerns()[0]
    for command in np.linspace(OPEN, 0.01, 500):  # the hand comes near, and is not there yet
        bench.tick(command)
    assert bench.row["slave_jaw_setpoint_js"][0] == CLOSED
    assert bench.grip[FORCE] == pytest.approx(force, rel=1e-9)
    bench.run(CLOSED, 50)
    assert bench.grip[FORCE] == pytest.approx(force, rel=1e-9)
    np.testing.assert_allclose(bench.object, place, atol=1e-12)
    assert bench.server.concerns() == []
    bench.run(OPEN, 300)
    assert bench.grip[FORCE] == 0.0
    assert bench.object[2] == PLACE[2]


@pytest.mark.parametrize("how", HOLDS)
def test_an_open_jaw_does_not_close_after_a_stop_until_the_hand_closes(how: str | State) -> None:
    bench = Bench()
    bench.run(OPEN, 200)
    held = bench.row["slave_jaw_setpoint_js"][0]
    interrupt(bench, how, 0.4)
    rng = np.random.default_rng(1)
    for jitter in rng.uniform(-0.005, 0.005, 500):
        bench.tick(0.4 + jitter)
    assert bench.row["slave_jaw_setpoint_js"][0] == held
    assert "open the hand first, or close it" in bench.server.concerns()[0]
    bench.run(0.3, 300)
    assert bench.row["slave_jaw_setpoint_js"][0] == 0.3
    interrupt(bench, State.PAUSED, 0.3)  # a hand that did not move leads on at once
    bench.run(0.3, 1)
    bench.run(0.5, 100)
    assert bench.row["slave_jaw_setpoint_js"][0] == 0.5


@pytest.mark.parametrize(("angle", "held"), [(0.5, 0.0), (0.7, 0.7)])
def test_a_jaw_that_was_silent_keeps_its_grip_unless_somebody_moved_it_meanwhile(angle: float, held: float) -> None:
    server = Jaw(JawParameters())
    row = server.signals
    row["slave_operation"][STATE] = ENABLED
    for i in range(1, 2000):
        row["now_ns"] = row["slave_jaw_servo_jp_ns"] = i * TICK_NS
        if not 500 < i < 1000:  # it grips something at 0.5 rad
            row["slave_jaw_measured_js_ns"] = i * TICK_NS
            row["slave_jaw_measured_js"][0] = OPEN if i < 100 else 0.5 if i <= 500 else angle
        row["slave_jaw_servo_jp"] = OPEN if i < 100 or i > 700 else CLOSED
        server.step()
    assert row["slave_jaw_setpoint_js"][0] == held


@pytest.mark.parametrize("angle", [0.1, 0.8, 0.9])
def test_a_jaw_that_is_closed_at_first_stays_so_until_the_hand_has_closed(angle: float) -> None:
    server = Jaw(JawParameters())
    row = server.signals
    row["slave_operation"][STATE] = ENABLED
    found = []
    for i in range(1, 500):
        row["now_ns"] = row["slave_jaw_servo_jp_ns"] = row["slave_jaw_measured_js_ns"] = i * TICK_NS
        row["slave_jaw_measured_js"][0] = angle
        row["slave_jaw_servo_jp"] = OPEN if i < 200 or i > 220 else CLOSED
        server.step()
        found.append((row["slave_jaw_setpoint_js"][0], int(row["slave_jaw_setpoint_js_ns"])))
    before, (opened, _) = found[198], found[-1]
    assert before[0] == min(angle, OPEN)
    assert (before[1] == topics.NO_COMMAND_NS) is (angle < OPEN)
    assert opened == OPEN


def test_a_jaw_without_fresh_or_finite_commands_stays_where_it_is_led() -> None:
    bench = Bench()
    bench.run(OPEN, 200)
    bench.tick(CLOSED)
    bench.run(None, 500)  # the last command is followed for 0.1 s, at 4 rad/s
    assert bench.row["slave_jaw_setpoint_js"][0] == pytest.approx(OPEN - 4.0 * 0.101, abs=0.0045)
    held = bench.row["slave_jaw_setpoint_js"][0]
    bench.run(math.nan, 100)
    bench.run(math.inf, 100)
    assert bench.row["slave_jaw_setpoint_js"][0] == held


@pytest.mark.parametrize("seed", range(3))
def test_whatever_is_commanded_setpoint_angle_and_effort_keep_their_limits(seed: int) -> None:
    rng, bench = np.random.default_rng(seed), Bench(stiffness=3e4)
    for _ in range(60):
        bench.run(rng.uniform(-5.0, 5.0), int(rng.integers(1, 60)))
    found, p = np.array(bench.rows), bench.given
    assert np.abs(np.diff(found[:, 0])).max() <= 1e-3 * JawParameters().speed_limit * (1.0 + 1e-9)
    assert found[:, 0].max() <= p.upper
    assert found[:, 1].min() >= 0.0
    assert found[:, 1].max() <= p.upper
    assert np.abs(found[:, 3]).max() <= p.effort_limit


@pytest.mark.parametrize("seed", range(1))
@pytest.mark.parametrize(("stiffness", "damping"), [(300.0, 0.0), (1e4, 0.0), (1e6, 0.0), (1e4, 20.0)])
def test_fingers_and_object_never_have_more_energy_than_the_drive_gave(
    seed: int, stiffness: float, damping: float
) -> None:
    bench = Bench(stiffness=stiffness, damping=damping, jaw={"viscous": 0.0})
    rng = np.random.default_rng(seed)
    for _ in range(40):
        bench.run(rng.uniform(-0.2, 0.9), int(rng.integers(1, 80)))
    found, p = np.array(bench.rows), bench.given
    angle, speed, effort = found.T[1:4]
    bent = np.maximum(0.02 - 2.0 * p.finger_length * np.sin(0.5 * angle), 0.0)
    given = np.concatenate(([0.0], np.cumsum(effort[:-1] * np.diff(angle))))
    stored = 0.5 * p.inertia * speed**2 + 0.5 * stiffness * bent**2
    assert (stored <= given + 1e-9).all()
    assert given.max() > 1e-4


def test_an_object_that_is_let_go_falls_as_a_stone_and_stays_where_it_lands() -> None:
    bench = Bench()
    bench.run(CLOSED, 600)
    bench.carry(CLOSED, lift(0.05))
    bench.carry(CLOSED, bench.tip[:3] + np.linspace(0.0, 0.03, 300)[:, None] * [1.0, 0.0, 0.0])
    bench.run(CLOSED, 100)
    begin = len(bench.rows)
    bench.run(OPEN, 400)
    heights = np.array(bench.rows)[begin:, 12]
    falls = np.flatnonzero(heights < heights[0] - 1e-9)[0] - 1
    lands = np.flatnonzero(heights <= PLACE[2])[0]
    assert 1e-3 * (lands - falls) == pytest.approx(math.sqrt(2.0 * 0.05 / WEIGHT), abs=4e-3)
    landed = bench.object
    bench.carry(OPEN, bench.tip[:3] + np.linspace(0.0, 0.2, 500)[:, None] * [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(bench.object, landed)
    np.testing.assert_allclose(landed[:3], PLACE + np.array([0.03, 0.0, 0.0]), atol=1e-9)
    assert bench.grip[DROPS] == 0  # it was let go


@pytest.mark.parametrize("speed", [4.0, 0.5, 0.1])
def test_a_hand_that_opens_the_jaw_in_the_air_lets_go_at_any_speed(speed: float) -> None:
    bench = Bench()
    bench.run(CLOSED, 600)
    bench.carry(CLOSED, lift(0.05))
    for command in np.arange(CLOSED, OPEN, 1e-3 * speed):
        bench.tick(float(command))
    bench.run(OPEN, 200)
    assert bench.object[2] == PLACE[2]
    assert (bench.grip[[IS_GRIPPED, GRIPS, SLIPS, DROPS]] == (0, 1, 0, 0)).all()


def test_an_object_that_slides_out_above_the_table_has_dropped_and_lies_there() -> None:
    bench = Bench()
    bench.run(CLOSED, 600)
    bench.carry(CLOSED, lift(0.05))
    bench.carry(CLOSED, bench.tip[:3] + 400.0 * 0.5 * (1e-3 * np.arange(20)[:, None]) ** 2 * [1.0, 0.0, 0.0])
    bench.run(CLOSED, 500)
    assert (bench.grip[[IS_GRIPPED, GRIPS, SLIPS, DROPS]] == (0, 1, 1, 1)).all()
    assert bench.object[2] == PLACE[2]
    assert bench.row["slave_jaw_measured_js"][0] < 1e-9  # closed on nothing


def test_a_closed_jaw_takes_nothing_along() -> None:
    bench = Bench()
    bench.carry(CLOSED, np.tile(PLACE + np.array([0.1, 0.0, 0.0]), (600, 1)))
    bench.carry(CLOSED, PLACE + np.linspace(0.1, -0.1, 400)[:, None] * [1.0, 0.0, 0.0])
    np.testing.assert_allclose(bench.object[:3], PLACE, atol=1e-12)
    assert bench.grip[GRIPS] == 0


def test_a_gripped_object_turns_with_the_tip_about_the_tip() -> None:
    bench, beside = Bench(), np.array([0.004, 0.0, 0.0])
    bench.carry(OPEN, np.tile(PLACE + beside, (200, 1)))
    bench.run(CLOSED, 600)
    bench.carry(CLOSED, lift(0.05) + beside)
    np.testing.assert_allclose(bench.object[:3] - bench.tip[:3], -beside, atol=1e-9)
    for angle in np.linspace(0.0, 1.0, 1000):
        bench.tip[3:] = math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)
        bench.tick(CLOSED)
    np.testing.assert_allclose(bench.object[3:], bench.tip[3:], atol=1e-9)
    turned = -0.004 * np.array([math.cos(1.0), math.sin(1.0), 0.0])
    np.testing.assert_allclose(bench.object[:3] - bench.tip[:3], turned, atol=1e-9)


def test_an_object_that_is_let_go_in_motion_flies_on_and_rests_where_it_lands() -> None:
    bench = Bench()
    bench.run(CLOSED, 600)
    bench.carry(CLOSED, lift(0.05))
    way = 0.3 * 1e-3 * np.arange(1, 601)[:, None] * [1.0, 0.0, 0.0]  # at 0.3 m/s
    begin = bench.tip[:3].copy()
    bench.carry(CLOSED, begin + way[:200])
    bench.carry(OPEN, begin + way[200:])
    landed = bench.object
    assert landed[2] == PLACE[2]
    assert landed[0] - PLACE[0] > 0.06 + 0.3 * 0.09  # it flew for a tenth of a second
    bench.run(OPEN, 300)
    np.testing.assert_array_equal(bench.object, landed)


# -- pegs ------------------------------------------------------------------------------------------

SIDE = np.array([0.0, 0.04, 0.0])
"""From the peg of the block to another one [m]."""
HEIGHT, CLEARANCE = 0.015, 1.5e-3


def pegged(places: Array = PLACE, **thing: float) -> Bench:
    """Bench whose blocks stand on pegs; another peg stands beside each."""
    rows = np.reshape(places, (-1, 3))
    axes = np.concatenate((rows, rows + SIDE))[:, :2]
    pegs = PegParameters(place=tuple(axes.ravel()), height=HEIGHT, clearance=CLEARANCE)
    return Bench(jaw={"pegs": pegs}, places=places, **thing)


def way(begin: Array, end: Array, speed: float = 0.03) -> Array:
    """Places (N, 3) on the line from one to the other, at a speed [m/s]."""
    ticks = max(int(1e3 * np.linalg.norm(np.subtract(end, begin)) / speed), 1)
    return begin + np.linspace(0.0, 1.0, ticks + 1)[1:, None] * np.subtract(end, begin)


def go(bench: Bench, *targets: ArrayLike, command: float = CLOSED) -> None:
    """Lead the tip from target to target, each (3,) from where the first block stood."""
    for target in targets:
        bench.carry(command, way(bench.tip[:3].copy(), PLACE + np.asarray(target)))


def up(height: float) -> Array:
    return np.array([0.0, 0.0, height])


@pytest.mark.parametrize(("friction", "speed"), [(0.2, 0.01), (0.5, 0.2), (1.0, 0.2)])
def test_a_peg_holds_what_is_pulled_across_it_by_the_friction_that_its_weight_leaves(
    friction: float, speed: float
) -> None:
    bench = pegged(friction=friction)
    bench.run(CLOSED, 600)
    go(bench, up(0.005))
    bench.carry(CLOSED, way(bench.tip[:3].copy(), PLACE + np.array([0.006, 0.0, 0.005]), speed))
    # While it slides, Coulomb's friction of both pads balances the weight and the peg's pull.
    most, weight = 2.0 * friction * bench.grip[FORCE], 0.05 * WEIGHT
    assert bench.board["pull"] == pytest.approx(math.sqrt(most**2 - weight**2), rel=0.02)
    assert math.dist(bench.object[:2], PLACE[:2]) == pytest.approx(CLEARANCE, rel=1e-9)
    assert bench.grip[SLID] > 0.003
    go(bench, [0.02, 0.0, 0.005])
    assert bench.grip[SLIPS] == 1
    assert not bench.grip[IS_GRIPPED]
    assert bench.board["transferred"] == bench.board["dropped"] == 0
    assert bench.object[2] == PLACE[2]  # it slid down the peg that it was on


@pytest.mark.parametrize("rise", [0.98, 1.02])
def test_a_block_comes_off_its_peg_only_by_the_height_of_the_peg(rise: float) -> None:
    bench = pegged()
    bench.run(CLOSED, 600)
    go(bench, up(rise * HEIGHT), up(rise * HEIGHT) + SIDE)
    assert bench.grip[SLIPS] == (rise < 1.0)
    off = math.dist(bench.object[:2], PLACE[:2])
    assert off == pytest.approx(CLEARANCE if rise < 1.0 else 0.04, rel=1e-6)


@pytest.mark.parametrize("share", [0.95, 1.05])
def test_a_block_that_is_let_go_over_a_peg_goes_onto_it_within_its_clearance_else_it_dropped(share: float) -> None:
    bench, above = pegged(), up(0.025)
    bench.run(CLOSED, 600)
    go(bench, above, above + SIDE + [share * CLEARANCE, 0.0, 0.0])
    bench.run(CLOSED, 300)
    assert bench.board["transferred"] == bench.board["dropped"] == 0  # it is still held
    bench.run(OPEN, 600)
    assert bench.object[2] == PLACE[2]
    assert (bench.board["transferred"], bench.board["dropped"]) == ((1, 0) if share < 1 else (0, 1))
    assert bench.grip[DROPS] == 0  # the jaw let go of it


@pytest.mark.parametrize("seed", range(3))
def test_wherever_a_block_is_pulled_below_the_top_its_peg_holds_it_with_friction_at_most(seed: int) -> None:
    rng, bench = np.random.default_rng(seed), pegged()
    bench.run(CLOSED, 600)
    most = 2.0 * 0.5 * bench.grip[FORCE]
    begin, pulls = len(bench.rows), []
    for _ in range(40):
        x, y, z = rng.uniform([-3e-3, -3e-3, 0.0], [3e-3, 3e-3, 0.9 * HEIGHT])
        for place in way(bench.tip[:3].copy(), PLACE + np.array([x, y, z]), speed=rng.uniform(0.01, 0.3)):
            bench.tick(CLOSED, place)
            pulls.append(bench.board["pull"])
    off = np.linalg.norm(np.array(bench.rows)[begin:, 10:12] - PLACE[:2], axis=1)
    assert off.max() == pytest.approx(CLEARANCE, rel=1e-9)
    assert 0.5 * most < max(pulls) <= most * (1.0 + 1e-6)


def test_a_block_that_is_let_go_in_motion_is_stopped_by_the_peg_that_it_comes_onto() -> None:
    bench, low = pegged(), up(0.01)
    bench.run(CLOSED, 600)
    go(bench, up(0.025), up(0.025) + SIDE, low + SIDE)
    begin = bench.tip[:3].copy()
    way_on = 0.2 * 1e-3 * np.arange(1, 401)[:, None] * [0.0, 1.0, 0.0]  # 0.2 m/s, beyond the peg
    bench.carry(OPEN, begin + way_on)
    off = np.linalg.norm(np.array(bench.rows)[-400:, 10:12] - (PLACE + SIDE)[:2], axis=1)
    assert off.max() == pytest.approx(CLEARANCE, rel=1e-9)
    assert bench.board["transferred"] == 1


def test_back_on_its_own_peg_nothing_counts_and_along_the_table_no_peg_is_come_onto() -> None:
    bench, above = pegged(), up(0.025)
    bench.run(CLOSED, 600)
    go(bench, above, above + SIDE, above, up(0.0))
    bench.run(OPEN, 300)
    assert bench.board["transferred"] == bench.board["dropped"] == 0
    bench.run(CLOSED, 300)
    aside = np.array([0.0, 0.02, 0.0])
    go(bench, above, above + aside, aside, SIDE)  # down between the pegs, then along the table
    assert bench.board["dropped"] == 0  # as long as it is held
    bench.run(OPEN, 300)
    np.testing.assert_allclose(bench.object[:2], (PLACE + SIDE)[:2], atol=1e-6)
    assert (bench.board["transferred"], bench.board["dropped"]) == (0, 1)


def test_of_several_blocks_each_moves_only_where_the_jaw_is_and_is_counted_for_itself() -> None:
    places = PLACE + np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.06, 0.0, 0.0]])
    bench, above = pegged(places), up(0.025)
    for i in (2, 0):  # in any order
        others = [k for k in range(3) if k != i]
        before = bench.middles[others]
        at = places[i] - PLACE
        go(bench, above + at, at, command=OPEN)
        bench.run(CLOSED, 600)
        go(bench, at + above, at + above + SIDE)
        bench.run(OPEN, 600)
        np.testing.assert_array_equal(bench.middles[others], before)
        np.testing.assert_allclose(bench.middles[i], places[i] + SIDE, atol=1e-6)
    assert (bench.board["transferred"], bench.board["dropped"]) == (2, 0)
    assert not bench.middles[3:].any()
    bench.sim.reset()
    bench.run(OPEN, 2)
    np.testing.assert_array_equal(bench.middles[:3], places)


# -- the master's side -----------------------------------------------------------------------------


def commanded(parameters: JawCommandParameters, hand: Any = None, buttons: Any = None) -> Array:
    """Angles (N,) that the master's side asks for."""
    stage = JAW_COMMAND.run(parameters)
    angles = []
    for i in range(len(hand if hand is not None else buttons)):
        stage.signals["hand_jaw"] = 0.0 if hand is None else hand[i]
        stage.signals["master_buttons"] = 0.0 if buttons is None else buttons[i]
        stage.step()
        angles.append(float(stage.signals["slave_jaw_servo_jp"][0]))
    return np.array(angles)


def test_a_handle_leads_the_jaw_by_its_share_and_no_farther_than_it_goes() -> None:
    angles = commanded(JawCommandParameters(), hand=[0.0, 0.25, 1.0, 2.0, -1.0])
    np.testing.assert_allclose(angles, [0.8, 0.6, 0.0, 0.0, 0.8])


@pytest.mark.parametrize(("source", "column"), [("clutch", 0), ("fixture", 1), ("mode", 2)])
def test_a_button_closes_the_jaw_as_long_as_it_is_held_or_from_press_to_press(source: str, column: int) -> None:
    buttons = np.zeros((6, 3))
    buttons[[1, 2, 4], column] = 1.0
    buttons[:, (column + 1) % 3] = 1.0  # another one
    held = commanded(JawCommandParameters(source=source), buttons=buttons)
    np.testing.assert_allclose(held, [0.8, 0.0, 0.0, 0.8, 0.0, 0.8])
    toggled = commanded(JawCommandParameters(source=source, toggles=True), buttons=buttons)
    np.testing.assert_allclose(toggled, [0.8, 0.0, 0.0, 0.0, 0.8, 0.8])


# -- sessions --------------------------------------------------------------------------------------


def test_the_block_is_picked_carried_and_set_down_and_the_recording_tells_it(tmp_path: Path) -> None:
    recording = tc.run("pick").save(tmp_path / "bag")
    score = recording.score()
    counts = [score.value(f"jaw.{name}") for name in ("grips", "slips", "drops")]
    assert counts == [1, 0, 0]
    block = recording["slave/jaw/object_cp"].values
    assert block[-1, 1] - block[0, 1] == pytest.approx(-0.03, abs=1e-3)
    assert block[-1, 2] == block[0, 2]
    assert block[:, 2].max() - block[0, 2] > 0.025
    # From 0.8 rad at 4 rad/s to where the block is 2 asin(d / 2 L) wide.
    way = 0.8 - 2.0 * math.asin(0.02 / 0.08)
    lag = 2.0 / 100.0  # two time constants of the law
    assert way / 4.0 - lag < present(score.value("jaw.delay_s")) < way / 4.0 + lag
    js = recording["slave/jaw/measured_js"]
    assert js.values.shape[1] == 3
    gripping = recording["slave/jaw/grip"].values[:, FORCE]
    assert score.value("jaw.peak_force_n") == gripping.max()


def test_three_blocks_are_brought_from_peg_to_peg_and_the_score_says_in_what_time(tmp_path: Path) -> None:
    score = tc.run("peg_transfer").save(tmp_path / "bag").score()
    found = [score.value(f"transfer.{name}") for name in ("transferred", "dropped", "peak_pull_n")]
    assert found == [3, 0, 0.0]
    # From the hand's closing to its opening; the jaw takes as long to grip as to let go.
    assert score.value("transfer.time_s") == pytest.approx(10.6 - 4.6, abs=0.1)


def test_over_pegs_that_are_higher_than_the_hand_lifts_no_block_is_brought() -> None:
    tall = tc.run("peg_transfer", duration=13.0, settings={"jaw_sim.pegs.height": 0.04})
    score = tall.score()
    assert score.value("transfer.transferred") == 0
    assert score.value("jaw.slips") == 1
    force = score.value("jaw.peak_force_n")
    assert (
        present(0.9 * present(force)) < present(score.value("transfer.peak_pull_n")) <= present(force)
    )  # 2 µ F, and µ is 0.5


def test_an_emergency_stop_in_the_air_drops_nothing() -> None:
    script = {"slave.operation.events": ["stop@12.0"]}
    recording = tc.run("pick", settings=script)
    block, grip = recording["slave/jaw/object_cp"], recording["slave/jaw/grip"]
    after = block.values[block.stamp_ns > 13_000_000_000]
    assert after[:, 2].min() > block.values[0, 2] + 0.02  # though the hand opens later
    assert grip.values[-1, IS_GRIPPED] == 1.0
    assert grip.values[-1, DROPS] == 0.0


def test_over_a_network_the_jaw_closes_later_by_its_delay() -> None:
    here = tc.run("pick", duration=7.0).score().value("jaw.delay_s")
    far = (
        tc.run(
            "pick",
            duration=7.0,
            stages=["network", "jaw_command", "jaw", "jaw_sim"],
            settings={"network.there.least_delay": 0.1},
        )
        .score()
        .value("jaw.delay_s")
    )
    assert present(far) - present(here) == pytest.approx(0.1, abs=2e-3)
