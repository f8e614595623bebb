"""Links between nodes: delayed ones, summed ones, and stages of a user put in between."""

import signal
import textwrap
import time
from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from _pytest.mark.structures import MarkDecorator

from live_process import CALM, LiveProcess, wait_until
from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.graph.topics import Kind, Topic
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros

MS = 1_000_000
HELPER = Topic("helper/servo_cf", Kind.WRENCH, topics.MASTER_SERVO_CF.stamp, "master_base")
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
RAISED, TWICE = (Topic(name, Kind.POSE) for name in ("slave/raised_cp", "slave/plain_cp"))


def both_ways(topic: Topic, is_enough: Callable[..., object], *settings: object) -> MarkDecorator:
    """A session of these settings, in processes and composed, until it has enough of a topic."""
    ways = [(topic, is_enough, settings, way) for way in ((), ("--composed",))]
    return pytest.mark.parametrize("recorded", ways, ids=["processes", "composed"], indirect=True)


def is_led(setpoints: Any) -> bool:
    """Whether commands have been in force for a second and a half, and many different ones."""
    in_force = [stamp for stamp in setpoints.stamps if stamp > topics.NO_COMMAND_NS]
    return len(in_force) > 1500 and len(set(in_force)) > 300


def is_free(reach: Any) -> Any:
    """Which answers (N,) of the inverse kinematics nothing keeps from what was asked for."""
    return np.array(reach)[:, topics.SLAVE_REACH.columns.index("limit")] == topics.Limit.NONE


late_and_helped = both_ways(
    topics.SLAVE_SETPOINT_JS, is_led,
    "teleop.delays=[slave/servo_jp=0.05]", "teleop.stages=[helper]",
)  # fmt: skip
in_between = both_ways(
    topics.SLAVE_REACH, lambda reach: reach.values and is_free(reach.values).sum() > 1000,
    "teleop.stages=[compiled_raise, plain_raise]", "plain_raise.height=0.003",
)  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a user's installed package with four stages."""
    folder = tmp_path_factory.mktemp("links") / "site"
    about = folder / "my_stages-1.0.dist-info"
    about.mkdir(parents=True)
    (folder / "my_stages.py").write_text(textwrap.dedent(STAGES))
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-stages\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(textwrap.dedent(ENTRIES))
    return folder


@pytest.fixture
def package(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package, found by what the test starts."""
    monkeypatch.setenv("PYTHONPATH", str(site))


@pytest.fixture(scope="module")
def recorded(
    request: pytest.FixtureRequest,
    site: Array,
    common_peer: "Peer",
    tmp_path_factory: pytest.TempPathFactory,
) -> Bag:
    """Recording of a session of the user; tests of the same session share it."""
    topic, is_enough, settings, way = request.param
    listener = common_peer.listen(topic)
    session = LiveProcess(
        tmp_path_factory.mktemp("session"), "--scenario", "free_motion", *way,
        env={"ROS_DOMAIN_ID": common_peer.domain, "PYTHONPATH": str(site)},
        settings=(*settings, "operator.approach_time=1.0", CALM),
    )  # fmt: skip

    def has_enough() -> int:
        assert session.process.poll() is None, session.text
        return listener.take() and is_enough(listener)

    try:
        session.wait_running()
        wait_until(has_enough, f"enough of {topic.name}", 300.0)
        session.signal(signal.SIGINT)
        assert session.wait() == 0, session.text
        return session.recorded()
    finally:
        session.close()


def common(*series: Any) -> list[Any]:
    """Values of some series at the stamps that all have."""
    stamps = reduce(np.intersect1d, (one.stamp_ns for one in series))
    assert len(stamps) > 500
    found = [np.unique(one.stamp_ns, return_index=True) for one in series]
    places = [index[np.searchsorted(own, stamps)] for own, index in found]
    return [one.values[place] for one, place in zip(series, places, strict=True)]


@pytest.mark.slow
@late_and_helped
def test_a_delay_on_a_link_is_seen_in_the_latency_of_the_recording(recorded: Bag) -> None:
    answers, setpoints = (
        recorded.read(topic) for topic in (topics.SLAVE_SERVO_JP, topics.SLAVE_SETPOINT_JS)
    )
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


@pytest.mark.slow
@late_and_helped
def test_a_second_source_of_force_acts_beside_the_first(recorded: Bag) -> None:
    helper = recorded.read(HELPER)
    assert len(helper) > 500
    # Without a fixture nothing else pushes.
    assert not recorded.read(topics.MASTER_SERVO_CF).values.any()
    felt = recorded.read(topics.MASTER_MEASURED_CF)
    force = felt.values[felt.stamp_ns > helper.stamp_ns[0]]
    assert np.median(force[:, 0]) == 0.25
    assert not force[:, 1:].any()


@pytest.mark.slow
@in_between
def test_stages_of_a_user_run_between_ours_compiled_and_plain(recorded: Bag) -> None:
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


def test_an_answer_that_is_no_number_is_counted_and_told_but_not_sent(
    package: None, peer: "Peer"
) -> None:
    answers = peer.listen(Topic("test/failing", Kind.POSE))
    peer.start("failing")

    def ask(x: float) -> int:
        peer.send(topics.MASTER_MEASURED_CP, time.time_ns(), [x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        return answers.take()

    peer.wait(lambda: ask(0.25), "an answer")
    told = "steps wrote NaN or infinity: not sent"
    peer.wait(lambda: ask(1.0) and told in peer.status("failing").message, "a warning")
    count = ask(0.25)
    peer.wait(lambda: ask(0.25) > count, "more answers")
    assert {values[0] for values in answers.values} == {0.25}
