"""Links between stages with delays, sums, and stages of a user: what holds in any session."""

from functools import reduce
from typing import Any

import numpy as np

from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.robots import load_robot

MS = 1_000_000
HELPER = topics.Topic("helper/servo_cf", topics.Kind.WRENCH, topics.MASTER_SERVO_CF.stamp, "master_base")
STAGES = """
    from dataclasses import dataclass

    from teleop_core.kernels import kernel
    from teleop_core.base.parameters import parameter
    from teleop_core.graph.stage import Stage
    from teleop_core.graph.topics import (
        MASTER_MEASURED_CP, MASTER_SERVO_CF, SLAVE_SERVO_CP, Kind, Topic, passed_on,
    )


    @dataclass(frozen=True, kw_only=True)
    class Raise:
        height: float = parameter(0.002, unit="m", lower=0.0, upper=0.1, doc="how far up")


    def lift(source, target, height):
        for i in range(7):
            target[i] = source[i]
        target[2] += height


    lift_kernel = kernel(lift)


    @kernel
    def compiled_step(p, s, row, dt):
        lift_kernel(row.slave_servo_cp, row.slave_raised_cp, p.height)


    def plain_step(p, s, row, dt):
        lift(row.slave_servo_cp, row.slave_plain_cp, p.height)


    def stage(name, topic, step):
        return Stage(
            name, Raise, reads=(SLAVE_SERVO_CP,),
            writes=(Topic(topic, Kind.POSE, passed_on("slave/servo_cp"), "slave_base"),),
            step=step, trigger=SLAVE_SERVO_CP, replaces=SLAVE_SERVO_CP,
        )


    COMPILED = stage("compiled_raise", "slave/raised_cp", compiled_step)
    PLAIN = stage("plain_raise", "slave/plain_cp", plain_step)


    @dataclass(frozen=True, kw_only=True)
    class Nothing:
        pass


    def push(p, s, row, dt):
        row.helper_servo_cf[0] = 0.25


    HELPER = Stage(
        "helper", Nothing, reads=(MASTER_MEASURED_CP,),
        writes=(Topic("helper/servo_cf", Kind.WRENCH, passed_on("master/measured_cp"),
                      "master_base", adds_to="master/servo_cf"),),
        step=push, trigger=MASTER_MEASURED_CP,
    )


    def fails(p, s, row, dt):
        for i in range(7):
            row.test_failing[i] = row.master_measured_cp[i]
        if row.master_measured_cp[0] > 0.5:
            row.test_failing[0] = float("nan")


    FAILING = Stage(
        "failing", Nothing, reads=(MASTER_MEASURED_CP,),
        writes=(Topic("test/failing", Kind.POSE, passed_on("master/measured_cp")),),
        step=fails, trigger=MASTER_MEASURED_CP,
    )
"""
ENTRIES = """
    [teleop_core.stages]
    compiled_raise = my_stages:COMPILED
    plain_raise = my_stages:PLAIN
    helper = my_stages:HELPER
    failing = my_stages:FAILING
"""
RAISED, TWICE = (topics.Topic(name, topics.Kind.POSE) for name in ("slave/raised_cp", "slave/plain_cp"))
SETTINGS = (
    "teleop.stages=[helper, compiled_raise, plain_raise]",
    "teleop.delays=[slave/servo_jp=0.05]",
    "plain_raise.height=0.003",
)
WATCHED = (topics.SLAVE_SETPOINT_JS, topics.SLAVE_REACH)


def is_led(setpoints: Any) -> bool:
    """Whether commands have been in force for a second and a half, and many different ones."""
    in_force = [stamp for stamp in setpoints.stamps if stamp > topics.NO_COMMAND_NS]
    return len(in_force) > 1500 and len(set(in_force)) > 300


def is_free(reach: Any) -> Any:
    """Which answers (N,) of the inverse kinematics nothing keeps from what was asked for."""
    return np.array(reach)[:, topics.SLAVE_REACH.columns.index("limit")] == topics.Limit.NONE


def is_enough(setpoints: Any, reach: Any) -> bool:
    """Whether listeners to :data:`WATCHED` have heard what the laws need."""
    setpoints.take()
    return bool(reach.take() and is_led(setpoints) and is_free(reach.values).sum() > 1000)


def common(*series: Any) -> list[Any]:
    """Values of some series at the stamps that all have."""
    stamps = reduce(np.intersect1d, (one.stamp_ns for one in series))
    assert len(stamps) > 500
    found = [np.unique(one.stamp_ns, return_index=True) for one in series]
    places = [index[np.searchsorted(own, stamps)] for own, index in found]
    return [one.values[place] for one, place in zip(series, places, strict=True)]


def assert_delay_is_seen_in_the_latency(recorded: Bag) -> None:
    """The one of :data:`SETTINGS`, once."""
    answers, setpoints = (recorded.read(topic) for topic in (topics.SLAVE_SERVO_JP, topics.SLAVE_SETPOINT_JS))
    in_force = setpoints.stamp_ns > answers.stamp_ns[0]
    latency_ms = (setpoints.log_ns - setpoints.stamp_ns)[in_force] / MS
    assert len(latency_ms) > 1000
    # On a busy machine all is later, but never earlier.
    assert latency_ms.min() >= 50.0
    # It is this link that is late, and late once: a session that is behind is so on both sides.
    _, i, j = np.intersect1d(answers.stamp_ns, setpoints.stamp_ns, return_indices=True)
    way_ms = (setpoints.log_ns[j] - answers.log_ns[i]) / MS
    assert len(way_ms) > 50
    assert way_ms.min() < 75.0  # twice the delay would be 100 ms
    assert np.median(way_ms) > 25.0


def assert_second_source_of_force_acts_beside_the_first(recorded: Bag) -> None:
    """The helper's 0.25 N, where nothing else pushes."""
    helper = recorded.read(HELPER)
    assert len(helper) > 500
    # Without a fixture nothing else pushes.
    assert not recorded.read(topics.MASTER_SERVO_CF).values.any()
    felt = recorded.read(topics.MASTER_MEASURED_CF)
    force = felt.values[felt.stamp_ns > helper.stamp_ns[0]]
    assert np.median(force[:, 0]) == 0.25
    assert not force[:, 1:].any()


def assert_stages_run_between_ours(recorded: Bag) -> None:
    """Compiled and plain ones, one after the other."""
    asked, raised, twice = (recorded.read(t) for t in (topics.SLAVE_SERVO_CP, RAISED, TWICE))
    for first, second, height in ((asked, raised, 0.002), (raised, twice, 0.003)):
        before, after = common(first, second)
        before[:, 2] += height
        assert np.array_equal(before, after)
    answers, reach = recorded.read(topics.SLAVE_SERVO_JP), recorded.read(topics.SLAVE_REACH)
    goals, joints, limits = common(twice, answers, reach)
    reached = np.array([load_robot("rcrt1").fk(q)[:3, 3] for q in joints])
    off = np.linalg.norm(reached - goals[:, :3], axis=1)
    # Joints have their speeds: how far each answer falls short of the last stage's goal is told.
    told = limits[:, topics.SLAVE_REACH.columns.index("position_residual")]
    assert np.allclose(off, told, atol=1e-9)
    assert is_free(limits).sum() > 500
    assert off[is_free(limits)].max() < 1e-3 + 1e-9
