"""Own parts in sessions: delays, stages, fixtures, controllers, operators, compiled and plain."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from teleop_core.bags.reader import Bag
from teleop_core.base import NoParameters, PartError, Within, build, parameter
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.graph import STATE, TICK_NS, Stage, register_stage
from teleop_core.graph.topics import (
    MASTER_MEASURED_CP,
    SLAVE_MEASURED_CP,
    SLAVE_SERVO_CP,
    STREAMS,
    Kind,
    Topic,
    passed_on,
)
from teleop_core.hand.operators import register_operator
from teleop_core.kernels import Array, kernel
from teleop_core.robots import load_robot
from teleop_core.session import configuration, runner
from teleop_core.session.virtual import VirtualTime

TICKS = 1500
MS = 1e-3
HOME = load_robot("rcrt1").home
# Slave and hand begin at once: neither moves to another start, nor waits for the other.
AT_ONCE = (f"slave.start={HOME.tolist()}", "patience=0.0")
SHORT = (
    *AT_ONCE,
    "approach_time=0.5",
    "operator.period=2.0",
    "buttons.fixture=[0.2]",
    "buttons.clutch=[0.9, 1.0]",
    "fixture.box.size=[0.01, 0.01, 0.01]",
)


def session(*settings: str, scenario: str = "coarse_box", ticks: int = TICKS) -> NDArray[np.void]:
    return VirtualTime(configuration.configure(scenario, settings=[*SHORT, *settings])).run(ticks)


@pytest.fixture(scope="module")
def plain() -> NDArray[np.void]:
    """Rows of a session without any further part."""
    return session()


def assert_same_streams(block: NDArray[np.void], other: NDArray[np.void], topics: Sequence[Topic] = STREAMS) -> None:
    for topic in topics:
        for field in (topic.field, f"{topic.field}_ns"):
            assert np.array_equal(block[field], other[field]), field


# Delays.


def waits(times: Array) -> Array:
    """Rest until the slave follows, with the delay too; then swing by 20 mm."""
    swing = 0.01 * (1.0 - np.cos(2.0 * np.pi * np.maximum(times - 0.1, 0.0)))
    return np.column_stack((swing, -swing, 0.5 * swing))


def test_delay_of_20_ms_on_the_joint_commands_shifts_the_setpoints_by_20_ticks(own_parts: None) -> None:
    register_operator("waits", waits)
    # The push of the limit that home is at would differ by rounding.
    still = ("operator=waits", "tremor_amplitude=0.0", "gimbal_noise=0.0", "reach_force.is_on=false")
    delayed, plain = session(*still, "teleop.delays=[slave/servo_jp=0.02]"), session(*still)
    assert np.ptp(plain["slave_setpoint_cp"][:, :3], axis=0).min() > 1 * MS
    assert_same_streams(delayed, plain, [t for t in STREAMS if t.name.startswith("master/")])
    for field in ("slave_setpoint_js", "slave_setpoint_cp"):
        # The hand is followed from 20 ticks later on, with other roundings before it moves.
        assert np.allclose(delayed[field][20:], plain[field][:-20], rtol=0, atol=1e-9), field
    assert np.allclose(delayed["slave_setpoint_js"][:20], HOME, rtol=0, atol=1e-15)
    assert np.array_equal(delayed["slave_setpoint_js_ns"], np.maximum(plain["slave_servo_jp_ns"] - 20 * TICK_NS, 1))


@pytest.mark.parametrize(("seconds", "ticks"), [(0.0, 0), (0.0014, 1), (0.001, 1), (0.02, 20)])
def test_delay_on_a_late_link_comes_on_top_of_its_tick(seconds: float, ticks: int) -> None:
    block = session(f"teleop.delays=[master/servo_cf={seconds}]", "fixture.max_force=2.0")
    applied, late = block["master_measured_cf"][:, :3], 1 + ticks
    # What the device applies is what was asked for, this many ticks ago, below its peak force.
    assert np.array_equal(applied[late:], block["master_servo_cf"][:-late, :3])
    assert not applied[:late].any()
    assert np.abs(applied).max() > 0.1


def mirror(name: str, topic: Topic, **more: Any) -> Stage:
    """Stage that repeats the slave's pose, however old, under the name of its topic."""

    def step(parameters: Any, state: Any, signals: Any, dt: Any) -> None:
        signals[topic.field] = signals["slave_measured_cp"]

    return Stage(name, NoParameters, (SLAVE_MEASURED_CP,), (topic,), step=step, **more)


@pytest.mark.slow
def test_delay_to_one_reader_leaves_the_others_in_time(own_parts: None, plain: NDArray[np.void]) -> None:
    first, second = (Topic(f"test/{name}", Kind.POSE, passed_on("slave/measured_cp")) for name in "ab")
    register_stage(mirror("first", first))
    register_stage(mirror("second", second, late=(SLAVE_MEASURED_CP,)))
    block = session(
        "teleop.stages=[first, second]",
        "teleop.delays=[slave/measured_cp@first=0.005, slave/measured_cp@second=0.002]",
        ticks=300,
    )
    pose, stamp = block["slave_measured_cp"], block["slave_measured_cp_ns"]
    for name, late in (("a", 5), ("b", 3)):
        assert np.array_equal(block[f"test_{name}"][late:], pose[:-late])
        assert np.array_equal(block[f"test_{name}_ns"][late:], stamp[:-late])
    assert_same_streams(block, plain[:300])


def test_slave_whose_setpoints_come_late_follows_once_they_come_and_while_newer_ones_do(
    plain: NDArray[np.void],
) -> None:
    stopped = "slave.operation.events=[stop@0.6]"
    block = session("teleop.delays=[slave/setpoint_cp=0.15]", stopped, ticks=1100)
    state = block["teleop_state"][:, STATE["is_following"]]
    assert not state[:150].any()
    assert state[200:600].all()
    assert not state[600 + 150 + 110 :].any()
    assert plain["teleop_state"][200:400, STATE["is_following"]].all()


# Stages.

LIMITED = Topic("slave/limited_cp", Kind.POSE, passed_on("slave/servo_cp"), "slave_base")


@dataclass(frozen=True, kw_only=True)
class LimitParameters:
    """How fast the tool may go."""

    speed: float = parameter(0.02, Within(1e-3, 1.0, "m/s"), "along each axis")


def limit_step(p: Any, s: Any, row: Any, dt: float) -> None:
    for i in range(7):
        row.slave_limited_cp[i] = row.slave_servo_cp[i]
    reach = p.speed * dt
    for i in range(3):
        if s.is_begun:
            step = min(max(row.slave_servo_cp[i] - s.place[i], -reach), reach)
            row.slave_limited_cp[i] = s.place[i] + step
        s.place[i] = row.slave_limited_cp[i]
    s.is_begun = 1


LIMIT = kernel(limit_step)


def limit(name: str, step: Callable[[object, object, object, float], None]) -> Stage:
    return Stage(
        name,
        LimitParameters,
        (SLAVE_SERVO_CP,),
        (LIMITED,),
        step=step,
        state=(("place", "f8", (3,)), ("is_begun", "i8")),
        trigger=SLAVE_SERVO_CP,
        replaces=SLAVE_SERVO_CP,
    )


def test_parameters_of_an_own_stage_are_set_like_others(own_parts: None) -> None:
    register_stage(limit("limit", LIMIT))
    block = session("teleop.stages=[limit]", "limit.speed=0.01")
    steps = np.abs(np.diff(block["slave_limited_cp"][:, :3], axis=0))
    assert steps.max() < 0.01 * MS + 1e-15


def test_own_stage_is_recorded_with_its_topic_and_stamp(own_parts: None, tmp_path: Path) -> None:
    register_stage(limit("limit", LIMIT))
    settings = [*AT_ONCE, "teleop.stages=[limit]", "duration=0.2"]
    runner.simulate(configuration.configure(settings=settings), tmp_path / "bag")
    series = Bag(tmp_path / "bag").read(LIMITED)
    assert np.array_equal(series.stamp_ns, TICK_NS * np.arange(1, 201))


def test_what_a_plain_stage_raises_reaches_the_user(own_parts: None) -> None:
    def step(parameters: Any, state: Any, signals: Any, dt: float) -> None:
        if signals["now_ns"] > 5 * TICK_NS:
            raise RuntimeError("my own mistake")

    topic = Topic("test/x", Kind.POSE, passed_on("slave/measured_cp"))
    register_stage(Stage("raising", NoParameters, (SLAVE_MEASURED_CP,), (topic,), step=step))
    with pytest.raises(PartError, match=r"RuntimeError: my own mistake \(test_own_parts") as told:
        session("teleop.stages=[raising]", ticks=10)
    assert isinstance(told.value.__cause__, RuntimeError)


# A second source of force.

PUSH = Topic("contact/servo_cf", Kind.WRENCH, passed_on("master/measured_cp"), "master_base", adds_to="master/servo_cf")


def push_step(p: Any, s: Any, row: Any, dt: float) -> None:
    row.contact_servo_cf[0] = p.newton


@dataclass(frozen=True, kw_only=True)
class PushParameters:
    """A steady push."""

    newton: float = parameter(1.0, Within(unit="N"), "along the master's x")


def test_second_source_of_force_is_added_and_pushes_the_hand(own_parts: None, plain: NDArray[np.void]) -> None:
    register_stage(Stage("contact", PushParameters, (MASTER_MEASURED_CP,), (PUSH,), step=push_step))
    block = session("teleop.stages=[contact]", "contact.newton=1.5", "fixture.max_force=1.5")
    applied, walls = block["master_measured_cf"][1:, :3], block["master_servo_cf"][:-1, :3]
    assert np.array_equal(applied, walls + np.array((1.5, 0.0, 0.0)))
    assert np.abs(walls).max() > 0.1
    # Force over the hand's 300 N/m and the device's 1260 N/m, less what friction holds.
    moved = block["master_measured_cp"][150, 0] - plain["master_measured_cp"][150, 0]
    assert 0.5 * 1.5 / 300.0 < moved < 1.1 * (1.5 / 300.0 + 1.5 / 1260.0)


# Fixtures, controllers and operators.


# Axis maps.


def test_other_axis_map_moves_the_slave_along_other_axes() -> None:
    line = (
        "operator=line",
        "operator.size=[0.02, 0.0, 0.0]",
        "rotation=0.0",
        "operator.center=[0.0, 0.0, 0.0]",
        "operator.tilt=[0.0, 0.0, 0.0]",
    )
    still = (*line, "approach_time=0.5", "operator.period=2.0", "buttons.fixture=[]",
             "buttons.clutch=[]", "tremor_amplitude=0.0", "starts_at_home=false")  # fmt: skip
    axes = {
        "['-z', '-x', '+y']": (1, -1.0),  # the published one
        "['+y', '+z', '+x']": (2, 1.0),
    }
    for text, (axis, sign) in axes.items():
        block: Any = VirtualTime(configuration.configure("coarse_box", settings=[*still, f"axes={text}"]))
        block.run(block.lead)  # where it starts, all directions have room
        block = block.run(1200)
        command = block["slave_servo_cp"][:, :3] - block["slave_servo_cp"][0, :3]
        hand = block["master_measured_cp"][:, 0] - block["master_measured_cp"][0, 0]
        assert hand.max() > 5 * MS
        assert np.allclose(command[:, axis], sign * hand, rtol=0, atol=1e-13), text
        # The hand itself keeps to its line, to a step of the device's reading.
        assert np.abs(np.delete(command, axis, axis=1)).max() <= 0.056 * MS, text


# What composes the tick anew.


def test_another_kind_of_fixture_holds_from_the_next_block_on() -> None:
    virtual = VirtualTime(configuration.configure("coarse_box"))
    virtual.run(5000)
    wide = {"fixture.kind": "sphere", "fixture.sphere.radius": 0.25}
    virtual.stages["motion_scaling"].retune(build(MotionScalingParameters, wide))
    assert not virtual.run(4000)["master_servo_cf"][1:].any()
    virtual.stages["motion_scaling"].retune(build(MotionScalingParameters, {}))
    assert virtual.run(4000)["master_servo_cf"].any()
