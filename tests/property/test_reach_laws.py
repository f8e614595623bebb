"""Laws of sessions that reach their limits, and of masters of any rate."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from scaling_desk import ANY_HAND
from teleop_core.bags.memory import MemoryBag
from teleop_core.bags.series import Series
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.coupling.mapping.inverse_kinematics import InverseKinematics, InverseKinematicsParameters
from teleop_core.coupling.mapping.motion_scaling import MotionScaling
from teleop_core.graph import STATE, TICK_NS, topics
from teleop_core.hand.operators.shapes import minimum_jerk
from teleop_core.kernels.geometry import Array, pose_from_transform
from teleop_core.robots import load_robot
from teleop_core.session import api, runner, virtual

REACH = {name: index for index, name in enumerate(topics.SLAVE_REACH.columns)}
# The published map of the master's axes to the slave's.
AXES = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]], float)
MICROMETRE = 1e-6


class Chain:
    """Motion scaling and inverse kinematics, with a slave that does what it is told.

    How far a command could be followed is known ``delay`` samples later.
    """

    def __init__(self, robot: str, delay: int = 1, **values: Any) -> None:
        self.robot, self.delay = load_robot(robot), delay
        self.scaling = MotionScaling(MotionScalingParameters(**{"plausible": ANY_HAND} | values))
        self.ik = InverseKinematics(InverseKinematicsParameters(robot=robot))
        self.joints, self.stamp_ns = self.robot.start.copy(), 1_000_000_000
        self.hand, self.attitude, self.clutch = np.zeros(3), Rotation.identity(), 0.0
        self.told: list[Any]
        self.told = []
        self.follow(2)

    def step(self, move: ArrayLike = (0.0, 0.0, 0.0), turn: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """One sample of the hand after a step [m] and a turn [rad]; returns the tip's place."""
        before_ns, self.stamp_ns = self.stamp_ns, self.stamp_ns + TICK_NS
        self.hand = self.hand + np.asarray(move)
        self.attitude = Rotation.from_rotvec(turn) * self.attitude
        row, solver = self.scaling.signals, self.ik.signals
        x, y, z, w = self.attitude.as_quat()
        row["master_measured_cp"] = (*self.hand, w, x, y, z)
        row["master_measured_cp_ns"], row["slave_setpoint_cp_ns"] = self.stamp_ns, before_ns
        row["master_buttons"][0] = self.clutch
        pose_from_transform(self.robot.fk(self.joints), row["slave_setpoint_cp"])
        if len(self.told) >= self.delay:
            row["slave_reach"], row["slave_reach_ns"] = self.told[-self.delay]
        self.scaling.step()
        solver["slave_servo_cp"], solver["slave_servo_cp_ns"] = row["slave_servo_cp"], self.stamp_ns
        solver["slave_setpoint_js"], solver["slave_setpoint_js_ns"] = self.joints, before_ns
        self.ik.step()
        self.joints = solver["slave_servo_jp"].copy()
        self.told.append((solver["slave_reach"].copy(), self.stamp_ns))
        return self.robot.fk(self.joints)[:3, 3]

    def follow(self, samples: int, move: ArrayLike = (0.0, 0.0, 0.0), turn: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        for _ in range(samples):
            place = self.step(move, turn)
        return place

    def rest(self) -> Array:
        """Wait with a still hand until the arm has caught up; returns the tip's place."""
        place = self.follow(self.delay + 40)
        for _ in range(20_000):
            if self.reach("position_residual") < 1e-9 and self.reach("rotation_residual") < 1e-9:
                return place
            place = self.step()
        raise AssertionError("the arm never comes to rest")

    def reach(self, name: str) -> float:
        return self.told[-1][0][REACH[name]]

    def state(self, name: str) -> float:
        return self.scaling.signals["teleop_state"][STATE[name]]

    @property
    def force(self) -> Array:
        return self.scaling.signals["master_servo_cf"][:3].copy()


def wander(chain: Chain, rng: np.random.Generator) -> tuple[Array, Array]:
    """Legs of the hand in any direction, with turns and clutch strokes; the last leg's step."""
    for _ in range(rng.integers(1, 4)):
        way = rng.normal(size=3)
        move, turn = 1e-4 * way / np.linalg.norm(way), 4e-4 * rng.uniform() * rng.normal(size=3)
        if rng.random() < 0.3:
            chain.clutch = 1.0
            chain.follow(20, 1e-4 * rng.normal(size=3))
            chain.clutch = 0.0
            chain.step()
        chain.follow(int(rng.integers(500, 2500)), move, turn)
    return move, turn


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("robot", "gain"), [("rcrt1", 1.0), ("rcrt1", 0.5), ("puma560", 1.0)])
def test_a_hand_that_turns_back_from_beyond_reach_moves_the_slave_at_once(robot: str, gain: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = Chain(robot, delay=int(rng.integers(1, 30)), coarse_gain=gain)
    move, turn = wander(chain, rng)
    begin = chain.rest()
    for count in range(1, 201):  # slowly: drives are slow where an arm is stretched
        place = chain.step(-0.1 * move, -0.1 * turn)
        wanted = begin + count * gain * AXES @ (-0.1 * move)
        assert np.linalg.norm(place - wanted) < 30 * MICROMETRE
    assert np.linalg.norm(place - wanted) < MICROMETRE


@pytest.mark.slow
def test_those_ways_lead_beyond_reach_through_joints_and_the_workspace() -> None:
    limits = set()
    for robot in ("rcrt1", "puma560"):
        for seed in (*range(6), 17):
            chain = Chain(robot)
            wander(chain, np.random.default_rng(seed))
            limits |= {topics.Limit(int(reach[REACH["limit"]])) for reach, _ in chain.told}
    assert {topics.Limit.NONE, topics.Limit.JOINT, topics.Limit.WORKSPACE} <= limits


def beyond(**values: Any) -> tuple[Chain, Array]:
    """A chain whose hand has pushed 50 mm beyond the end of d3, outward along the arm."""
    chain = Chain("rcrt1", **values)
    tip, arm = chain.robot.fk(chain.robot.start)[:3, 3], chain.robot
    out = arm.jacobian(arm.start)[:3, 2]
    assert out @ tip > 0.0
    step = 4e-5 * AXES.T @ (out / np.linalg.norm(out))
    chain.follow(3200, step)
    return chain, step


def test_the_state_names_the_joint_at_its_limit_until_the_hand_has_come_back_without_a_force_too() -> None:
    values = MotionScalingParameters().reach_force
    chain, step = beyond(reach_force=type(values)(is_on=False))
    assert not chain.force.any()
    assert chain.state("limit") == topics.Limit.JOINT
    assert chain.state("limited_joint") == 2
    chain.follow(1000)
    assert chain.state("limit") == topics.Limit.JOINT
    chain.follow(400, -step)
    assert chain.state("limit") == topics.Limit.NONE
    assert chain.state("limited_joint") == -1


def test_a_clutch_stroke_beyond_reach_takes_the_slave_no_further_out() -> None:
    chain, step = beyond()
    place = chain.rest()
    for _ in range(5):
        chain.clutch = 1.0
        chain.follow(500, -step)
        chain.clutch = 0.0
        chain.follow(500, step)
    assert np.linalg.norm(chain.rest() - place) < MICROMETRE
    back = chain.follow(10, -step)
    assert np.linalg.norm(back - place - 10 * AXES @ -step) < MICROMETRE


# -- masters of any rate ---------------------------------------------------------------------------

SPEED = 30e-3 * 1.875 / 1.2  # largest of a minimum-jerk move by 30 mm in 1.2 s


def master_bag(stamps_ns: Any) -> MemoryBag:
    """Recording of a hand that rests, moves by 30 mm within 1.2 s, and rests."""
    share = minimum_jerk((stamps_ns * 1e-9 - 1.3) / 1.2)
    poses = np.zeros((len(stamps_ns), 7))
    poses[:, 3], poses[:, 1] = 1.0, 30e-3 * share
    series = {topics.MASTER_MEASURED_CP: Series(stamps_ns, stamps_ns, poses)}
    return MemoryBag("hand", series, {}, {})


def setpoints(stamps_ns: NDArray[np.int64], **values: Any) -> tuple[Array, Array]:
    """Times of the hand (N,) [s] and the tip's setpoint (N, 3) [m] in a replay.

    The reference filter, which lags behind any master, is off.
    """
    values = {"slave.reference_filter.is_on": False} | values
    session = virtual.VirtualTime(api.configuration(settings=values), played="haptic_master")
    rows = np.concatenate(list(runner.replayed_blocks(session, master_bag(stamps_ns))[0]))
    last = rows["now_ns"][-1] - stamps_ns[-1]
    rows = rows[rows["slave_setpoint_cp_ns"] > topics.NO_COMMAND_NS]  # after the move to where it starts
    return (rows["now_ns"] - last) * 1e-9, rows["slave_setpoint_cp"][:, :3]


def every(period_ns: int, end_ns: int = 4_000_000_000) -> NDArray[np.int64]:
    return np.arange(1_000_000_000, end_ns, period_ns, dtype=np.int64)


@pytest.mark.parametrize("interpolation", ["none", "linear", "minimum_jerk"])
@pytest.mark.parametrize("rate_hz", [10, 125, 500])
def test_a_slow_master_costs_one_of_its_periods_and_no_more(rate_hz: int, interpolation: str) -> None:
    times, fast = setpoints(every(TICK_NS))
    period = 1.0 / rate_hz
    kind = {"slave.interpolation": interpolation}
    slow_times, slow = setpoints(every(round(period * 1e9)), **kind)
    after = slow_times >= max(times[0], slow_times[0])
    same = np.stack([np.interp(slow_times[after], times, c) for c in fast.T], axis=1)
    off = np.linalg.norm((slow[after] - slow[-1]) - (same - fast[-1]), axis=1)
    # Held for a period at most, and with interpolation reached another period later.
    periods = 1.0 if interpolation == "none" else 2.0
    assert off.max() < periods * period * SPEED + 1e-4
    assert np.linalg.norm(slow[-1] - slow[0]) == pytest.approx(30e-3, abs=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_irregular_stamps_and_losses_lose_none_of_the_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    stamps = np.cumsum(rng.integers(20_000_000, 130_000_000, 40)) + 900_000_000
    stamps = stamps[(rng.random(len(stamps)) > 0.15) | (stamps > 2_600_000_000)]
    stamps = stamps[: np.searchsorted(stamps, 3_500_000_000)]
    _, slave = setpoints(stamps.astype(np.int64))
    assert np.linalg.norm(slave[-1] - slave[0]) == pytest.approx(30e-3, abs=2e-4)


def test_after_a_pause_of_the_master_the_slave_does_not_jump_after_the_hand() -> None:
    stamps = np.concatenate((every(10_000_000, 1_500_000_000), every(10_000_000) + 1_500_000_000))
    _, slave = setpoints(stamps)
    assert np.linalg.norm(np.diff(slave, axis=0), axis=1).max() < 1e-4
    assert np.linalg.norm(slave[-1] - slave[0]) < 1e-3
    assert math.isfinite(slave.sum())
