"""Two jaws in one world: both see and touch the same objects, and hand them over."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

import teleop_core as tc
from teleop_core.graph import TICK_NS, topics
from teleop_core.kernels import Array, kernel
from teleop_core.session.links import link_texts
from teleop_core.slave.jaw import jaw_sim, sharing
from teleop_core.slave.jaw.grip import WEIGHT
from teleop_core.slave.jaw.parameters import GripObjectParameters, JawSimParameters

PLACE = np.array([0.2, -0.1, 0.05])
BASE = np.array([0.5, -0.2, 0.1])  # of the second arm in the first one's
OPEN, CLOSED = 0.8, 0.0
FORCE, IS_GRIPPED, SLID, GRIPS, SLIPS, DROPS = range(len(topics.SLAVE_JAW_GRIP.columns))


def at(x: float, y: float, z: float = 0.0) -> Array:
    """Place (3,) beside that of the first block [m]."""
    return np.array(PLACE + np.array([x, y, z]))


class Pair:
    """Two jaws whose tips and setpoints are led by hand; each hears of the other a tick later."""

    def __init__(self, places: Any = PLACE, **thing: float) -> None:
        given = JawSimParameters(
            second_base=tuple(BASE), object=GripObjectParameters(place=tuple(np.ravel(places)), **thing)
        )
        self.sims = jaw_sim.JawSim(given), jaw_sim.JawSim(given)
        self.rows = [sim.signals for sim in self.sims]
        self._steps = [sim.load() for sim in self.sims]
        self.tips = [at(0.0, 0.0, 0.1), at(0.1, 0.0, 0.1)]  # in the first one's base
        self.angles = [OPEN, OPEN]
        self.run(2)

    def run(self, ticks: int) -> None:
        """Let time go on."""
        first, second = self.rows
        for _ in range(ticks):
            now_ns = int(first["now_ns"]) + TICK_NS
            for name in ("slave_true_cp", "slave_jaw_grip"):
                first[f"second_{name}"] = second[name]
                first[f"second_{name}_ns"] = second["now_ns"]
            second["first_slave_jaw_board"] = first["slave_jaw_board"]
            second["first_slave_jaw_board_ns"] = first["now_ns"]
            for row, tip, angle, base, step in zip(
                self.rows, self.tips, self.angles, (0.0 * BASE, BASE), self._steps, strict=True
            ):
                row["now_ns"] = row["slave_true_cp_ns"] = row["slave_jaw_setpoint_js_ns"] = now_ns
                row["slave_true_cp"][:3], row["slave_jaw_setpoint_js"] = tip - base, angle
                step()

    def go(self, hand: int, place: Any, time: float = 0.5) -> None:
        """Lead a tip to a place in the first arm's base."""
        begin, count = self.tips[hand].copy(), round(1e3 * time)
        for share in np.linspace(0.0, 1.0, count):
            smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
            self.tips[hand] = begin + smooth * (np.asarray(place) - begin)
            self.run(1)

    def close(self, hand: int, angle: float = CLOSED) -> None:
        """Close a jaw, and wait until it presses."""
        self.angles[hand] = angle
        self.run(300)

    def grip(self, hand: int) -> Array:
        """What a jaw tells of its grip."""
        return np.array(self.rows[hand]["slave_jaw_grip"])

    def middles(self, hand: int = 0) -> Array:
        """Middles of all objects as the simulator of an arm tells them (6, 3)."""
        return np.array(self.rows[hand]["slave_jaw_board"][3:]).reshape(-1, 3)


def handed_over(pair: Pair, angle: float = CLOSED) -> None:
    """Lift the block with the first jaw, and take it with the second."""
    pair.go(0, PLACE)
    pair.close(0)
    pair.go(0, at(0.0, 0.0, 0.05))
    pair.go(1, at(0.0, 0.0, 0.05))
    pair.close(1, angle)


def test_a_block_goes_from_jaw_to_jaw_in_the_air() -> None:
    pair = Pair()
    handed_over(pair)
    assert pair.grip(0)[IS_GRIPPED] == pair.grip(1)[IS_GRIPPED] == 1.0
    pair.close(0, OPEN)
    middle = pair.middles()[0] - pair.tips[1]
    pair.go(1, at(0.1, 0.05, 0.08))
    assert pair.middles()[0] - pair.tips[1] == pytest.approx(middle, abs=1e-4)
    assert pair.grip(0)[[IS_GRIPPED, GRIPS, SLIPS, DROPS]] == pytest.approx([0, 1, 0, 0])
    assert pair.grip(1)[[IS_GRIPPED, GRIPS, SLIPS, DROPS]] == pytest.approx([1, 1, 0, 0])
    pair.close(1, OPEN)
    pair.run(500)
    assert pair.middles()[0][2] == PLACE[2]  # on the table, where the second let it go
    assert pair.middles()[0][:2] == pytest.approx(at(0.1, 0.05)[:2], abs=1e-3)


def test_both_simulators_tell_the_same_places_each_in_its_base() -> None:
    pair = Pair([PLACE, at(0.0, 0.04, 0.0)])
    handed_over(pair)
    before = pair.middles()
    pair.run(1)
    assert pair.middles(1)[:2] == pytest.approx(before[:2] - BASE, abs=1e-15)
    told = pair.rows[1]["slave_jaw_object_cp"][:3]
    assert told == pytest.approx(before[0] - BASE, abs=1e-15)


def test_two_jaws_carry_two_blocks_at_a_time() -> None:
    pair = Pair([PLACE, at(0.0, 0.04, 0.0)])
    pair.go(0, PLACE)
    pair.go(1, at(0.0, 0.04, 0.0))
    pair.angles = [CLOSED, CLOSED]
    pair.run(300)
    for step in np.linspace(0.0, 0.03, 400):
        pair.tips = [at(0.0, 0.0, step), at(0.0, 0.04 + step, step)]
        pair.run(1)
    pair.run(10)
    wanted = [at(0.0, 0.0, 0.03), at(0.0, 0.07, 0.03)]
    assert pair.middles()[:2] == pytest.approx(np.array(wanted), abs=3e-4)


def test_of_two_jaws_that_part_the_stronger_keeps_the_block() -> None:
    pair = Pair(friction=0.3)
    handed_over(pair, 0.42)  # near the angle where the pads touch, so that it presses less
    assert 0.0 < pair.grip(1)[FORCE] < 0.7 * pair.grip(0)[FORCE]
    place = pair.middles()[0]
    pair.go(1, pair.tips[1] + [0.008, 0.0, 0.0], 0.2)
    assert pair.middles()[0] == pytest.approx(place, abs=1e-6)
    assert pair.grip(1)[SLIPS] == 1.0
    assert pair.grip(0)[SLIPS] == 0.0


def test_two_jaws_hold_what_is_too_heavy_for_one() -> None:
    force = Pair()
    force.go(0, PLACE)
    force.close(0)
    push = float(force.grip(0)[FORCE])
    # Friction of one jaw carries 2 µ F; the block weighs half as much again.
    pair = Pair(friction=0.05 * WEIGHT / (1.5 * 2.0 * push), mass=0.05)
    pair.go(0, PLACE)
    pair.go(1, PLACE)
    pair.angles = [CLOSED, CLOSED]
    pair.run(300)
    for height in np.linspace(0.0, 0.02, 1000):
        pair.tips = [at(0.0, 0.0, height)] * 2
        pair.run(1)
    assert pair.middles()[0][2] == pytest.approx(PLACE[2] + 0.02, abs=2e-4)
    pair.close(1, OPEN)
    pair.run(300)
    assert pair.middles()[0][2] == PLACE[2]


@kernel
def shared(own: Array, tip: Array, most: float, other: Array, against: float) -> None:
    """Call the inner kernel."""
    sharing.share_speed(own, tip, most, other, against)


def test_the_speed_between_two_jaws_is_the_least_of_a_convex_function() -> None:
    rng = np.random.default_rng(3)
    kinds = set()
    for _ in range(200):
        own, tip, other = rng.normal(size=(3, 3))
        most, against = rng.uniform(0.05, 2.0, 2)
        found = own.copy()
        shared(found, tip, most, other, against)

        def cost(
            v: Array,
            own: Array = own,
            tip: Array = tip,
            other: Array = other,
            most: float = most,
            against: float = against,
        ) -> float:
            far = np.linalg.norm(v - tip) * most + np.linalg.norm(v - other) * against
            return float(0.5 * np.square(v - own).sum() + far)

        starts = (own, tip, other, 0.5 * (tip + other))
        best = min(minimize(cost, v, method="Nelder-Mead").fun for v in starts)
        assert cost(found) <= best + 1e-6
        kinds.add((np.array_equal(found, tip), np.array_equal(found, other)))
    assert kinds == {(True, False), (False, True), (False, False)}


def test_ports_between_arms_are_fed_by_the_other_of_the_first_two() -> None:
    graph = tc.build_graph(["left", "right", "third"], ["jaw_command", "jaw", "jaw_sim"])
    found = {
        (link.reader.name, link.port.name): link.topic.name
        for link in graph.links
        if link.port in topics.PORTS_BETWEEN_ARMS
    }
    assert found == {
        ("jaw_sim", "second/slave/true_cp"): "right/slave/true_cp",
        ("jaw_sim", "second/slave/jaw/grip"): "right/slave/jaw/grip",
        ("right/jaw_sim", "first/slave/jaw/board"): "slave/jaw/board",
    }
    texts = {member.name: link_texts(graph, member) for member in graph.members}
    assert "second/slave/jaw/grip=right/slave/jaw/grip" in texts["jaw_sim"]
    assert "first/slave/jaw/board=../slave/jaw/board" in texts["right/jaw_sim"]
