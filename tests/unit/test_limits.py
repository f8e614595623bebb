"""Limits: what the arm cannot follow is drawn back once, however late it is known."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from teleop_core.base import build
from teleop_core.coupling.mapping import gains, limits, motion_scaling
from teleop_core.graph import STATE, TICK_NS, topics
from teleop_core.kernels.geometry import Array

REACH = {name: index for index, name in enumerate(topics.SLAVE_REACH.columns)}
PLAIN: dict[str, Any] = {"axes": ("+x", "+y", "+z"), "tool_axes": ("+x", "+y", "+z"), "tool_roll": 0.0}
STEP, TURN = 1e-4, 1e-3  # of the hand, each sample [m, rad]
WALL, ANGLE = 5e-3, 0.03  # how far along x, and about x, the arm can go [m, rad]
# Sums of a hundred steps.
ROUNDING = 1e-13


class Arm:
    """Motion scaling before an arm that can go so far along x and turn so far about x.

    How far it could follow a command is told ``delay`` samples later.
    """

    def __init__(self, delay: int = 1, **values: Any) -> None:
        self.scaling = motion_scaling.MotionScaling(gains.MotionScalingParameters(**PLAIN, **values))
        self.told: list[Any]
        self.row, self.delay, self.told = self.scaling.signals, delay, []
        self.hand, self.turn, self.stamp_ns = np.zeros(3), 0.0, TICK_NS
        self.step(0)
        self.step(0)

    def step(self, count: int, turn: float = 0.0) -> float:
        """One sample after ``count`` steps of the hand along x; returns the command's x."""
        row, before_ns = self.row, self.stamp_ns
        self.stamp_ns += TICK_NS
        self.hand[0] += count * STEP
        self.turn += turn
        stylus = Rotation.from_rotvec([self.turn, 0, 0]).as_quat(scalar_first=True)
        row["master_measured_cp"] = (*self.hand, *stylus)
        row["master_measured_cp_ns"] = self.stamp_ns
        row["slave_setpoint_cp"] = row["slave_servo_cp"]
        row["slave_setpoint_cp_ns"] = before_ns
        if len(self.told) >= self.delay:
            row["slave_reach"], row["slave_reach_ns"] = self.told[-self.delay]
        self.scaling.step()
        self.told.append((self.answer(), self.stamp_ns))
        return self.x

    def answer(self) -> Array:
        """How far the arm follows the present command."""
        found = np.zeros(len(REACH))
        found[REACH["cut_x"]] = min(0.0, WALL - self.x)
        found[REACH["cut_rx"]] = min(0.0, ANGLE - self.angle)
        is_cut = found.any()
        found[REACH["joint"]] = 2.0 if is_cut else -1.0
        found[REACH["limit"]] = topics.Limit.JOINT if is_cut else topics.Limit.NONE
        return found

    @property
    def x(self) -> float:
        return float(self.row["slave_servo_cp"][0])

    @property
    def angle(self) -> float:
        turned = Rotation.from_quat(self.row["slave_servo_cp"][3:], scalar_first=True)
        return float(turned.as_rotvec()[0])

    def state(self, name: str) -> float:
        return self.row["teleop_state"][STATE[name]]

    def rest(self) -> None:
        for _ in range(self.delay + 2):
            self.step(0)


@pytest.mark.parametrize("delay", [1, 2, 7, 40])
def test_what_is_beyond_is_cut_once_however_late_it_is_known(delay: int) -> None:
    arm = Arm(delay)
    for _ in range(120):  # 7 mm too far
        arm.step(1)
        assert arm.x <= WALL + delay * STEP + ROUNDING
    arm.rest()
    assert arm.x == pytest.approx(WALL, abs=ROUNDING)
    for count in range(1, 30):
        assert arm.step(-1) == pytest.approx(WALL - count * STEP, abs=ROUNDING)


@pytest.mark.parametrize("delay", [1, 7])
def test_turns_beyond_are_cut_too_and_come_back_at_once(delay: int) -> None:
    arm = Arm(delay)
    for _ in range(80):
        arm.step(0, TURN)
    arm.rest()
    assert arm.angle == pytest.approx(ANGLE, abs=1e-9)
    arm.step(0, -5 * TURN)
    assert arm.angle == pytest.approx(ANGLE - 5 * TURN, abs=1e-9)


def test_an_answer_to_a_command_that_is_forgotten_draws_nothing_back() -> None:
    arm = Arm(delay=limits.SENT + 100)
    for _ in range(2 * limits.SENT):
        arm.step(1)
    assert arm.x == pytest.approx(2 * limits.SENT * STEP, abs=1e-9)


@pytest.mark.parametrize("gain", [1.0, 0.25])
def test_the_push_grows_with_the_hand_beyond_the_wall_up_to_its_bound(gain: float) -> None:
    force = gains.ReachForceParameters(stiffness=1000.0, max_force=1.2)
    arm = Arm(coarse_gain=gain, fine_gain=0.1, reach_force=force)
    for _ in range(round(WALL / gain / STEP)):
        arm.step(1)
    assert not arm.row["master_servo_cf"].any()
    for beyond in range(1, 40):
        arm.step(1)
        # It is known a sample later that the arm did not follow.
        expected = min(1.2, 1000.0 * (beyond - 1) * STEP)
        assert -arm.row["master_servo_cf"][0] == pytest.approx(expected, abs=0.11)
    assert not arm.row["master_servo_cf"][1:].any()
    for _ in range(14):  # the wall was dragged along: 1.2 mm back is free
        arm.step(-1)
    assert not arm.row["master_servo_cf"].any()


@pytest.mark.parametrize("delay", [1, 20])
@pytest.mark.parametrize("side", ["slave", "both"])
@pytest.mark.parametrize("half", [4e-3, 6e-3])
def test_where_a_fixture_holds_the_slave_too_the_nearer_of_wall_and_limit_stops_it(
    half: float, side: str, delay: int
) -> None:
    box = {"side": side, "box.size": (2.0 * half,) * 3}
    arm = Arm(delay, fixture=build(gains.FixtureParameters, box))
    for pressed in (1.0, 0.0):
        arm.row["master_buttons"][1] = pressed
        arm.step(0)
    for count in [1] * 80 + [-1] * 200:
        arm.step(count)
        # The middle is reported to a nanometre.
        assert abs(arm.x - arm.state("fixture_center_x")) <= half + 1e-9
        assert arm.x <= min(half, WALL + (delay + 2) * STEP) + ROUNDING
        if half < WALL:
            assert arm.state("limit") == topics.Limit.NONE
