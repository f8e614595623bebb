"""Side of a fixture: the slave's command stays inside, and never steps farther than the hand."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from any_shape import KINDS, depth_of, found
from scaling_desk import MM, Desk
from teleop_core.base import build, parameter
from teleop_core.coupling.mapping.gains import FixtureParameters
from teleop_core.coupling.mapping.motion_scaling import to_slave_axes
from teleop_core.graph import TICK_NS
from teleop_core.kernels import Array, kernel
from teleop_core.shapes import Shape, register_shape

# Sums of a few hundred steps of millimetres at half a metre [m].
ROUNDING = 1e-12
# Middles of fixtures are reported to a nanometre.
NANOMETRE = 1e-9
LEAVES = 1e-9
"""How far the slave's command may leave a fixture [m]."""
GAINS = st.tuples(st.floats(0.05, 3.0), st.floats(0.02, 1.0)).map(lambda g: (max(g), min(g)))
STEPS = st.tuples(*[st.floats(-5 * MM, 5 * MM)] * 3)
EVENTS = st.sampled_from(["", "", "", "", "mode", "clutch"])
HELD = pytest.mark.parametrize("side", ["slave", "both"])


def fixture(side: str, **values: Any) -> FixtureParameters:
    """Parameters of a fixture; a name says ``__`` for a dot."""
    named = {name.replace("__", "."): value for name, value in values.items()}
    return build(FixtureParameters, {"side": side} | named)


def chosen(side: str, kind: str, parameters: object) -> FixtureParameters:
    """Parameters of a fixture of a kind, around the hand or beside it."""
    named = {f"{kind}.{name}": value for name, value in vars(parameters).items()}
    keep_out = found(kind, parameters, np.zeros(3))[0] > 0.0
    values = {"side": side, "kind": kind, "keep_out": keep_out}
    return build(FixtureParameters, values | named)


class HeldDesk(Desk):
    """A desk with a fixture around hand and slave, whose place at the slave it knows itself."""

    def __init__(self, parameters: FixtureParameters, **values: float) -> None:
        super().__init__(fixture=parameters, **values)
        self.sent = self.step()
        self.press("fixture")
        self.middle = self.sent
        turn = np.empty((3, 3))
        for i in range(3):
            to_slave_axes(self.scaling.parameters, np.eye(3)[i], turn[i])
        self.axes = turn.T

    def gain(self) -> float:
        return float(self.scaling.parameters["gain"][int(self.state("is_fine"))])

    def go(self, move: Any = (0, 0, 0), **how: Any) -> Any:
        """One step of the hand; returns how far the slave's command goes beyond that of it [m]."""
        before, gain = self.sent, self.gain()
        self.sent = self.step(move, **how)
        if self.gain() != gain:
            self.middle = before + (self.middle - before) * (self.gain() / gain)
        return np.linalg.norm(self.sent - before) - self.gain() * np.linalg.norm(move)

    def retune(self, parameters: FixtureParameters) -> None:
        self.scaling.retune(replace(self.scaling.present(), fixture=parameters))

    def moved(self) -> Array:
        """From the middle of the fixture to the slave's command, on the master's side [m]."""
        return self.axes.T @ (self.sent - self.middle) / self.gain()

    def outside(self) -> float:
        """How far the slave's command is outside of the fixture [m]."""
        return self.gain() * depth_of(self.scaling.present().fixture.made, self.moved())[0]


@HELD
@pytest.mark.parametrize("name", KINDS)
@given(st.data())
@settings(max_examples=30)
def test_command_neither_leaves_a_fixture_nor_steps_farther_than_the_hand(
    name: str, side: str, data: st.DataObject
) -> None:
    coarse, fine = data.draw(GAINS)
    desk = HeldDesk(chosen(side, name, data.draw(KINDS[name])), coarse_gain=coarse, fine_gain=fine)
    for event, move, count in data.draw(st.lists(st.tuples(EVENTS, STEPS, st.integers(1, 8)), max_size=12)):
        if event:
            desk.hold(event)
        for _ in range(count):
            before = desk.sent
            assert desk.go(move) <= ROUNDING
            assert desk.outside() <= LEAVES
            assert np.allclose(desk.box()[0], desk.middle, rtol=0, atol=NANOMETRE)
            if event == "clutch":
                assert np.array_equal(desk.sent, before)
        if event:
            desk.hold(event, is_held=False)


@HELD
def test_command_is_the_nearest_place_of_the_box_to_the_hand(side: str) -> None:
    rng, desk, hand = np.random.default_rng(3), HeldDesk(fixture(side)), np.zeros(3)
    for _ in range(500):
        move = rng.normal(scale=3 * MM, size=3) - 0.1 * hand
        hand += move
        desk.go(move)
        assert np.allclose(desk.moved(), np.clip(hand, -15 * MM, 15 * MM), rtol=0, atol=ROUNDING)


@HELD
def test_a_hand_that_comes_back_moves_the_slave_once_it_is_inside(side: str) -> None:
    desk = HeldDesk(fixture(side))
    desk.go((18 * MM, 0, 0))
    for depth in (2, 1, 0):
        desk.go((-1 * MM, 0, 0))
        assert math.isclose(desk.moved()[0], 15 * MM, abs_tol=ROUNDING), depth
    desk.go((-1 * MM, 0, 0))
    assert math.isclose(desk.moved()[0], 14 * MM, abs_tol=ROUNDING)


@HELD
def test_inside_a_fixture_every_side_has_the_same_bits(side: str) -> None:
    rng = np.random.default_rng(4)
    desks = [HeldDesk(fixture(one)) for one in ("hand", side)]
    at = np.zeros(3)
    for _ in range(200):
        to = rng.uniform(-15 * MM, 15 * MM, 3)
        for desk in desks:
            desk.go(to - at)
        at = to
        assert desks[0].row["slave_servo_cp"].tobytes() == desks[1].row["slave_servo_cp"].tobytes()
        assert desks[0].row["teleop_state"].tobytes() == desks[1].row["teleop_state"].tobytes()


def test_the_hand_feels_a_fixture_of_both_as_its_own_and_that_of_the_slave_not_at_all() -> None:
    rng = np.random.default_rng(5)
    hand, slave, both = (HeldDesk(fixture(side)) for side in ("hand", "slave", "both"))
    for _ in range(200):
        move = rng.normal(scale=2 * MM, size=3)
        for desk in (hand, slave, both):
            desk.go(move)
        assert not slave.row["master_servo_cf"].any()
        assert np.array_equal(hand.row["master_servo_cf"], both.row["master_servo_cf"])
    assert hand.row["master_servo_cf"].any()


@HELD
@pytest.mark.parametrize("button", ["fixture", "mode", "clutch"])
def test_no_button_moves_a_slave_that_is_held_in(side: str, button: str) -> None:
    desk = HeldDesk(fixture(side))
    desk.go((20 * MM, 9 * MM, 0))
    before = desk.sent
    desk.hold(button)
    for is_held in (True, True, False, False):
        desk.hold(button, is_held)
        assert desk.go() <= ROUNDING
    assert np.allclose(desk.sent, before, rtol=0, atol=ROUNDING)


@HELD
def test_switched_off_while_it_holds_a_fixture_leaves_the_slave_where_it_is_led_from(side: str) -> None:
    desk = HeldDesk(fixture(side))
    desk.go((20 * MM, 0, 0))
    desk.hold("fixture")
    assert desk.go((1 * MM, 0, 0)) <= ROUNDING
    desk.hold("fixture", is_held=False)
    before = desk.moved()
    for _ in range(10):
        desk.go((-1 * MM, 2 * MM, 0))
    assert np.allclose(desk.moved() - before, (-10 * MM, 20 * MM, 0), rtol=0, atol=ROUNDING)


@HELD
def test_put_on_while_the_hand_moves_a_fixture_holds_the_slave_from_there(side: str) -> None:
    desk = HeldDesk(fixture(side))
    desk.press("fixture")
    for _ in range(10):
        desk.go((1 * MM, 0, 0))
    desk.hold("fixture")
    assert desk.go((1 * MM, 0, 0)) <= ROUNDING
    desk.middle = desk.sent
    for _ in range(20):
        assert desk.go((1 * MM, 0, 0)) <= ROUNDING
        assert desk.outside() <= LEAVES
    assert math.isclose(desk.moved()[0], 15 * MM, abs_tol=ROUNDING)


@pytest.mark.parametrize(
    "after",
    [
        {"side": "hand"},
        {"box__size": (0.1, 0.1, 0.1)},
        {"box__size": (0.01, 0.01, 0.01)},
        {"kind": "sphere"},
        {"keep_out": True, "place": (0.025, 0.0, 0.0)},
    ],
)
@HELD
def test_what_is_changed_while_the_hand_is_outside_leads_the_slave_by_the_hands_steps(side: str, after: Any) -> None:
    rng, desk = np.random.default_rng(6), HeldDesk(fixture(side))
    desk.go((18 * MM, 4 * MM, 0))
    before = desk.sent
    desk.retune(fixture(**{"side": side} | after))
    desk.go()
    assert np.array_equal(desk.sent, before)
    outside = [desk.outside()]
    for _ in range(40):
        assert desk.go(rng.normal(scale=1 * MM, size=3)) <= ROUNDING
        outside.append(desk.outside())
    if "side" not in after:  # the slave comes in, and stays there
        assert (np.diff(outside) <= ROUNDING).all()
        assert outside[-1] <= LEAVES


def test_a_slave_outside_comes_in_as_far_as_the_hand_moves_when_it_is_held_from_now_on() -> None:
    desk = HeldDesk(fixture("hand"))
    desk.go((18 * MM, 0, 0))
    desk.retune(fixture("slave"))
    for left in (2, 1, 0, 0):  # whichever way the hand moves
        desk.go((0, 1 * MM, 0))
        assert math.isclose(desk.outside(), left * MM, abs_tol=LEAVES)


@HELD
def test_a_slave_that_went_its_own_way_is_led_from_there_without_a_step(side: str) -> None:
    desk = HeldDesk(fixture(side))
    desk.go((18 * MM, 0, 0))
    for _ in range(200):
        desk.go(does_follow=False)
    desk.row["slave_setpoint_cp"][1] += 4 * MM
    for _ in range(200):
        desk.go(does_follow=False)
    assert np.allclose(desk.sent, desk.row["slave_setpoint_cp"][:3], rtol=0, atol=ROUNDING)
    desk.row["slave_setpoint_cp_ns"] = desk.row["master_measured_cp_ns"]
    for _ in range(20):
        assert desk.go((1 * MM, 1 * MM, 0)) <= ROUNDING


@HELD
def test_tremor_that_is_left_out_of_the_pose_moves_no_slave(side: str) -> None:
    rng, desk = np.random.default_rng(8), HeldDesk(fixture(side))
    for i in range(300):
        desk.hold("clutch", is_held=i % 50 > 40)
        desk.row["master_filtered_out"] = rng.normal(scale=1 * MM, size=3)
        before = desk.sent
        assert desk.go(rng.normal(scale=3 * MM, size=3) if i % 3 else (0, 0, 0)) <= ROUNDING
        if i % 3 == 0 or i % 50 > 40:
            assert np.array_equal(desk.sent, before)


@HELD
def test_after_a_pause_of_the_master_the_slave_stays_where_it_is(side: str) -> None:
    desk = HeldDesk(fixture(side))
    desk.go((18 * MM, 0, 0))
    before = desk.sent
    desk.go((3 * MM, 3 * MM, 0), stamp_step_ns=1000 * TICK_NS)
    assert np.allclose(desk.sent, before, rtol=0, atol=ROUNDING)
    assert desk.go((0, 1 * MM, 0)) <= ROUNDING
    assert desk.outside() <= LEAVES


@HELD
@pytest.mark.parametrize("aside", [0.0, 1e-6, 2 * MM])
def test_a_hand_that_goes_through_a_forbidden_body_does_not_throw_the_slave_across(side: str, aside: float) -> None:
    desk = HeldDesk(fixture(side, kind="sphere", keep_out=True, place=(0.03, 0.0, 0.0)))
    desk.go((0, aside, 0))
    for _ in range(46):
        assert desk.go((1 * MM, 0, 0)) <= ROUNDING
        assert desk.outside() <= LEAVES
    before = desk.moved()
    desk.go((-3 * MM, 0, 0))  # it is led on from where it is
    assert desk.moved()[0] <= before[0] - 0.5 * MM


@dataclass(frozen=True, kw_only=True)
class WedgeParameters:
    """The second plane's way out; the first one's is x."""

    out: tuple[float, ...] = parameter((-math.cos(0.2), math.sin(0.2)), length=2, doc="x, y")


@kernel
def wedge_distance(offset: Any, numbers: Any, out: Any) -> Any:
    """Distance from the deeper of two planes: one round leads in only where one is crossed."""
    first, second = offset[0] - 0.01, numbers[0] * offset[0] + numbers[1] * offset[1] - 0.01
    x, y = (1.0, 0.0) if first >= second else (numbers[0], numbers[1])
    out[0], out[1], out[2] = x, y, 0.0
    return max(first, second)


@HELD
def test_a_shape_that_does_not_lead_in_within_a_few_rounds_holds_the_slave_where_it_may_be(
    own_parts: None, side: str
) -> None:
    register_shape(Shape("wedge", WedgeParameters, wedge_distance, lambda _: np.zeros((2, 3))))
    rng, desk = np.random.default_rng(7), HeldDesk(fixture(side, kind="wedge"))
    for move in ((0.0, 95 * MM, 0.0), (0.0, 25 * MM, 0.0), *rng.normal(scale=2 * MM, size=(300, 3))):
        assert desk.go(move) <= ROUNDING
        assert desk.outside() <= LEAVES
    for _ in range(60):  # back where there is room
        desk.go((0.0, -2 * MM, 0.0))
    assert desk.moved()[1] < 20 * MM
    assert desk.outside() <= LEAVES
