"""Laws of teleoperation over random sequences of what operators and supervisors do."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import scaling_desk
from present import present
from scaling_desk import ALIGNED, ANY_HAND
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.graph.signals import STATE, TICK_NS
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot
from teleop_core.session import configuration, virtual

# A command of 0.5 m is rounded to 1e-16 m at every sample.
ROUNDING = 1e-14
# Angle of a product of four unit quaternions.
ANGLE_ROUNDING = 1e-14
# Box centres are reported to a nanometre.
NANOMETRE = 1.0e-9
PAUSE_NS = round(MotionScalingParameters().longest_pause * 1e9)
R_SLAVE_MASTER = axis_map("axes", MotionScalingParameters().axes)
HOME = load_robot("rcrt1").fk(load_robot("rcrt1").home)


def turn_between(a: Array, b: Array) -> float:
    """Angle of the rotation between two quaternions [rad], without losing small ones."""
    w = a @ b
    x = a[0] * b[1:] - b[0] * a[1:] - np.cross(a[1:], b[1:])
    return 2.0 * math.atan2(float(np.linalg.norm(x)), abs(float(w)))


@dataclass
class Sample:
    """What one sample did to the command, and what the hand had done before it."""

    moved: np.ndarray
    turned: float
    hand_step: np.ndarray
    hand_turn: float
    gain: float


class Desk(scaling_desk.Desk):
    """Motion scaling between a hand and a slave that stands where it was told to; events between samples."""

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        self.values = values
        self.row["slave_servo_cp"] = self.row["slave_setpoint_cp"]
        self.sample(np.zeros(3), np.zeros(3))

    def sample(self, step: Array, turn: Array, gap_ns: int = TICK_NS) -> Sample:
        row = self.row
        before, stylus = row["slave_servo_cp"].copy(), row["master_measured_cp"].copy()
        self.step(step, Rotation.from_rotvec(turn).as_matrix(), stamp_step_ns=gap_ns)
        after, held = row["slave_servo_cp"], row["master_measured_cp"]
        turned = turn_between(before[3:], after[3:]), turn_between(stylus[3:], held[3:])
        return Sample(after[:3] - before[:3], turned[0], held[:3] - stylus[:3], turned[1], self.state("gain"))

    @property
    def middle(self) -> Array:
        """Of the box, and its size (6,) [m]."""
        return np.concatenate(self.box())

    def act(self, action: str, value: float) -> int:
        """Do something between two samples; returns the stamp step to the next sample [ns]."""
        if action in {"clutch", "fixture", "mode"}:
            index = ("clutch", "fixture", "mode").index(action)
            self.pressed[index] = 1.0 - self.pressed[index]
        elif action == "reset":
            self.scaling.reset()
        elif action == "retune":
            fine = 0.01 + 0.09 * value
            self.scaling.retune(
                MotionScalingParameters(
                    plausible=ANY_HAND,
                    coarse_gain=0.1 + 3.0 * value,
                    fine_gain=fine,
                    tool_roll=3.0 * value,
                    mode="fine" if value > 0.5 else "coarse",
                    **self.values,
                )
            )
        return round(5e8 * value) + 1 if action == "gap" else TICK_NS


ACTIONS = ("nothing", "clutch", "fixture", "mode", "reset", "retune", "gap")
metres, radians = st.floats(-0.02, 0.02), st.floats(-0.5, 0.5)
triple = st.tuples(metres, metres, metres).map(np.array)
turns = st.tuples(radians, radians, radians).map(np.array)
events = st.lists(st.tuples(st.sampled_from(ACTIONS), st.floats(0.0, 1.0), triple, turns), max_size=40)


@given(events)
def test_no_event_moves_the_command_further_than_gain_times_the_hand(
    happened: list[tuple[str, float, Array, Array]],
) -> None:
    """And not at all while the hand rests."""
    desk, rest = Desk(), np.zeros(3)
    for k, (action, value, *moved) in enumerate(happened):
        step, turn = moved if k % 2 else (rest, rest)
        done = desk.sample(step, turn, desk.act(action, value))
        allowed = done.gain * np.linalg.norm(done.hand_step)
        assert np.linalg.norm(done.moved) <= allowed + ROUNDING, action
        assert done.turned <= done.hand_turn + ANGLE_ROUNDING, action


@given(events)
def test_clutching_resetting_and_pausing_hold_the_command_whatever_the_hand_does(
    happened: list[tuple[str, float, Array, Array]],
) -> None:
    desk = Desk()
    for action, value, step, turn in happened:
        was_clutched = desk.pressed[0] > 0.0
        gap_ns = desk.act(action, value)
        done = desk.sample(step, turn, gap_ns)
        is_held = was_clutched or desk.pressed[0] > 0.0
        if is_held or action == "reset" or gap_ns > PAUSE_NS:
            assert not done.moved.any(), action
            assert done.turned == 0.0, action


@given(events)
def test_scaling_is_linear_between_the_events(happened: list[tuple[str, float, Array, Array]]) -> None:
    desk = Desk()
    for action, value, step, turn in happened:
        was_clutched = desk.pressed[0] > 0.0
        done = desk.sample(step, turn, desk.act(action, value))
        if action in {"nothing", "fixture", "mode"} and not was_clutched:
            expected = done.gain * (R_SLAVE_MASTER @ done.hand_step)
            assert np.allclose(done.moved, expected, rtol=0.0, atol=ROUNDING), action
            assert math.isclose(done.turned, done.hand_turn, abs_tol=ANGLE_ROUNDING), action


@given(events)
def test_attitude_of_an_aligned_tool_follows_the_stylus_in_its_own_frame_after_any_event(
    happened: list[tuple[str, float, Array, Array]],
) -> None:
    desk = Desk(**ALIGNED)
    for action, value, step, turn in happened:
        desk.sample(step, turn, desk.act(action, value))
    desk.pressed[0] = 0.0
    desk.sample(np.zeros(3), np.zeros(3))
    command = desk.row["slave_servo_cp"][3:].copy()
    stylus = Rotation.from_matrix(desk.turn)
    desk.sample(np.zeros(3), np.array([0.3, -0.2, 0.1]))
    before = Rotation.from_quat(command, scalar_first=True)
    after = Rotation.from_quat(desk.row["slave_servo_cp"][3:], scalar_first=True)
    p = desk.scaling.parameters["stylus_tool"].copy()
    stylus_tool = Rotation.from_quat(p, scalar_first=True)
    in_stylus = stylus.inv() * Rotation.from_matrix(desk.turn)
    expected = stylus_tool.inv() * in_stylus * stylus_tool
    assert (expected.inv() * (before.inv() * after)).magnitude() < 1e-13


@given(events, turns)
def test_the_tool_turns_about_the_axis_about_which_the_hand_turns_after_any_event(
    happened: list[tuple[str, float, Array, Array]], turn: Array
) -> None:
    desk = Desk()
    for action, value, step, one in happened:
        desk.sample(step, one, desk.act(action, value))
    desk.pressed[0] = 0.0
    desk.sample(np.zeros(3), np.zeros(3))
    before = Rotation.from_quat(desk.row["slave_servo_cp"][3:], scalar_first=True)
    desk.sample(np.zeros(3), turn)
    after = Rotation.from_quat(desk.row["slave_servo_cp"][3:], scalar_first=True)
    assert np.allclose((after * before.inv()).as_rotvec(), R_SLAVE_MASTER @ turn, rtol=0.0, atol=1e-12)


@given(events, st.lists(st.tuples(triple, turns), min_size=1, max_size=10))
def test_box_stays_at_the_slave_while_clutched(
    happened: list[tuple[str, float, Array, Array]], clutched: list[tuple[Array, Array]]
) -> None:
    desk = Desk()
    desk.act("fixture", 0.0)
    for action, value, step, turn in happened:
        if action in {"clutch", "mode", "nothing"}:
            desk.sample(step, turn, desk.act(action, value))
    before = None
    desk.pressed[0] = 1.0
    for step, turn in clutched:
        desk.sample(step, turn)
        assert before is None or np.abs(desk.middle - before).max() <= NANOMETRE
        before = desk.middle
    desk.pressed[0] = 0.0
    desk.sample(np.full(3, 0.01), np.zeros(3))
    assert np.abs(desk.middle - present(before)).max() <= NANOMETRE


@given(events)
def test_box_stays_where_it_is_until_gain_box_or_slave_change(happened: list[tuple[str, float, Array, Array]]) -> None:
    desk = Desk()
    for action, value, step, turn in happened:
        before, was_on = desk.middle, desk.row["teleop_state"][STATE["is_fixture_on"]]
        desk.sample(step, turn, desk.act(action, value))
        is_on = desk.row["teleop_state"][STATE["is_fixture_on"]]
        if was_on and is_on and action in {"nothing", "clutch", "gap"}:
            # Two roundings to a nanometre.
            assert np.abs(desk.middle - before).max() <= 2.0 * NANOMETRE, action


@given(events)
def test_the_same_hand_never_moves_the_slave_further_in_fine_mode(
    happened: list[tuple[str, float, Array, Array]],
) -> None:
    coarse, fine = Desk(), Desk()
    fine.scaling.retune(MotionScalingParameters(plausible=ANY_HAND, mode="fine"))
    fine.sample(np.zeros(3), np.zeros(3))
    for action, value, step, turn in happened:
        if action in {"mode", "retune"}:
            continue
        moved = [desk.sample(step, turn, desk.act(action, value)).moved for desk in (coarse, fine)]
        assert np.linalg.norm(moved[1]) <= np.linalg.norm(moved[0]) + ROUNDING


@given(triple, st.lists(st.floats(0.01, 1.0), min_size=1, max_size=20))
def test_gain_does_not_depend_on_how_often_the_hand_is_sampled(end: Array, spacing: list[float]) -> None:
    shares = np.cumsum(spacing) / np.sum(spacing)
    once, often = Desk(), Desk()
    once.sample(end, np.zeros(3))
    for share in np.diff(shares, prepend=0.0):
        often.sample(share * end, np.zeros(3), round(9e7 * share) + 1)
    apart = once.row["slave_servo_cp"][:3] - often.row["slave_servo_cp"][:3]
    assert np.abs(apart).max() <= len(spacing) * ROUNDING


# From here on: the whole graph, with its simulated hand, inverse kinematics and slave.
seconds = st.floats(0.0, 2.9).map(lambda t: round(t, 3))
# Presses last 0.1 s, so they come at least 0.15 s apart.
presses = st.lists(st.integers(0, 19).map(lambda k: round(0.15 * k, 3)), max_size=4, unique=True)


def session_of(
    seed: int,
    clutch: Sequence[float] = (),
    fixture: Sequence[float] = (),
    mode: Sequence[float] = (),
    **settings_: str | float | list[float],
) -> virtual.VirtualTime:
    text = [f"{key}={value}" for key, value in settings_.items()]
    texts = [
        f"seed={seed}",
        "operator.approach_time=0.5",
        "operator.center=[0.01, 0.0, 0.03]",
        "operator.period=4.0",
        f"buttons.clutch={sorted(clutch)}",
        f"buttons.fixture={list(fixture)}",
        f"buttons.mode={list(mode)}",
    ]
    session = virtual.VirtualTime(configuration.configure(settings=[*texts, *text]))
    session.run(session.lead + 3)  # until the slave is where it starts, and follows
    return session


def assert_command_moves_with_the_hand(block: NDArray[np.void], first: int) -> None:
    """No tick from ``first`` on moves the command further than gain times the hand."""
    command, hand = block["slave_servo_cp"][first:], block["master_measured_cp"][first:]
    gain = block["teleop_state"][first:][1:, STATE["gain"]]
    moved = np.linalg.norm(np.diff(command[:, :3], axis=0), axis=1)
    allowed = gain * np.linalg.norm(np.diff(hand[:, :3], axis=0), axis=1)
    assert (moved <= allowed + ROUNDING).all()
    turned, allowed_turn = (
        (Rotation.from_quat(q[1:], scalar_first=True) * Rotation.from_quat(q[:-1], scalar_first=True).inv()).magnitude()
        for q in (command[:, 3:], hand[:, 3:])
    )
    assert (turned <= allowed_turn + 10 * ANGLE_ROUNDING).all()


@given(
    st.integers(0, 1000), st.lists(seconds, max_size=4, unique=True).filter(lambda t: len(t) % 2 == 0), presses, presses
)
@settings(max_examples=10)
def test_buttons_in_a_running_session_never_move_the_slave(
    seed: int, clutch: list[float], fixture: list[float], mode: list[float]
) -> None:
    block = session_of(seed, clutch, fixture, mode).run(3000)
    assert_command_moves_with_the_hand(block, 0)
    is_clutched = block["teleop_state"][:, STATE["is_clutched"]] > 0.0
    held = is_clutched[1:] & is_clutched[:-1]
    assert not np.diff(block["slave_servo_cp"], axis=0)[held].any()
    assert np.isfinite(block["slave_measured_js"]).all()
    assert (block["command_status"] == 0).all()


@given(st.integers(0, 1000), st.integers(600, 2500))
@settings(max_examples=10)
def test_restarting_the_scaling_in_motion_holds_the_slave_where_it_is(seed: int, at: int) -> None:
    session = session_of(seed)
    before = session.run(at)[-1]
    session.stages["motion_scaling"].reset()
    after = session.run(500)
    assert np.array_equal(after["slave_servo_cp"][0], before["slave_setpoint_cp"])
    assert_command_moves_with_the_hand(after, 0)
    # The filter passes a tenth of the way that the slave still had to go, back at once.
    lag = np.linalg.norm(before["slave_servo_cp"][:3] - before["slave_setpoint_cp"][:3])
    first_step = after["slave_setpoint_cp"][0, :3] - before["slave_setpoint_cp"][:3]
    assert np.linalg.norm(first_step) <= 0.2 * lag + 1e-6


@given(st.integers(0, 1000))
@settings(max_examples=5)
def test_parameters_changed_in_a_running_session_never_move_the_slave(seed: int) -> None:
    rng, session = np.random.default_rng(seed), session_of(seed)
    before = session.run(800)
    for _ in range(6):
        coarse, roll = rng.uniform(0.1, 3.0), rng.uniform(-3.0, 3.0)
        mode = ("coarse", "fine")[rng.integers(2)]
        session.stages["motion_scaling"].retune(
            MotionScalingParameters(plausible=ANY_HAND, coarse_gain=coarse, mode=mode, tool_roll=roll)
        )
        block = session.run(200)
        assert_command_moves_with_the_hand(np.concatenate((before[-1:], block)), 0)
        before = block


def test_quaternions_stay_unit_over_a_long_session_of_turning_and_clutching() -> None:
    count = 60_000
    rng, session = np.random.default_rng(8), virtual.VirtualTime(configuration.configure(), played="haptic_master")
    turns = Rotation.from_rotvec(0.002 * rng.standard_normal((count, 3)))
    # Products of 100 turns each keep the path smooth and its making fast.
    samples, attitude = session.rows(count), Rotation.identity()
    path = samples["master_measured_cp"]
    for start in range(0, count, 100):
        part = turns[start : start + 100]
        path[start : start + 100, 3:] = (part * attitude).as_quat(scalar_first=True)
        attitude = part[-1] * attitude
    path[:, :3] = 1e-3 * rng.standard_normal((count, 3))
    samples["master_buttons"][:, 0] = (np.arange(count) // 37) % 2
    samples["now_ns"] = TICK_NS * np.arange(1, count + 1)
    for topic in session.played_topics:
        samples[f"{topic.field}_ns"] = samples["now_ns"]
    block: Any = session.replay(samples)
    for field in ("slave_servo_cp", "slave_setpoint_cp", "slave_measured_cp"):
        norms = np.linalg.norm(block[field][:, 3:], axis=1)
        assert np.abs(norms - 1.0).max() < 1e-15, field
