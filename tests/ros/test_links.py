"""Links between nodes: delayed ones, summed ones, and stages of a user put in between."""

import textwrap
import time

import numpy as np
import pytest

from teleop_core import topics
from teleop_core.bags.reader import Bag
from teleop_core.robots import load_robot
from teleop_core.topics import Kind, Topic

pytestmark = pytest.mark.ros

MS = 1_000_000
RUN = ("live", "--scenario", "free_motion", "--set", "operator.approach_time=1.0")
HELPER = Topic("helper/servo_cf", Kind.WRENCH, topics.MASTER_SERVO_CF.stamp, "master_base")
FORCES = ["master/servo_cf=master/servo_cf", "master/servo_cf=helper/servo_cf"]
STAGES = """
    from dataclasses import dataclass

    from teleop_core.kernels import kernel
    from teleop_core.parameters import parameter
    from teleop_core.stage import Stage
    from teleop_core.topics import (
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
both_ways = pytest.mark.parametrize("way", [(), ("--composed",)], ids=["processes", "composed"])


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A user's installed package with four stages."""
    folder = tmp_path / "site"
    about = folder / "my_stages-1.0.dist-info"
    about.mkdir(parents=True)
    (folder / "my_stages.py").write_text(textwrap.dedent(STAGES))
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-stages\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(textwrap.dedent(ENTRIES))
    monkeypatch.setenv("PYTHONPATH", str(folder))


def common(first, second):
    """Values of two series at the stamps that both have."""
    _, i, j = np.intersect1d(first.stamp_ns, second.stamp_ns, return_indices=True)
    assert len(i) > 500
    return first.values[i], second.values[j]


@pytest.mark.slow
@both_ways
def test_a_delay_on_a_link_is_seen_in_the_latency_of_the_recording(teleop, tmp_path, way):
    delay = ("--set", "teleop.delays=[slave/servo_jp=0.05]")
    teleop(*RUN, *delay, "--duration", 3, "--out", tmp_path / "bag", *way)
    bag = Bag(tmp_path / "bag")
    answers, setpoints = bag.read(topics.SLAVE_SERVO_JP), bag.read(topics.SLAVE_SETPOINT_JS)
    in_force = setpoints.stamp_ns > answers.stamp_ns[0]
    latency_ms = (setpoints.log_ns - setpoints.stamp_ns)[in_force] / MS
    assert len(latency_ms) > 1000
    # On a busy machine all is later, but never earlier; twice the delay would be 100 ms.
    assert 50.0 <= latency_ms.min() < 100.0
    assert np.min(answers.log_ns - answers.stamp_ns) / MS < 50.0


@pytest.mark.slow
@both_ways
def test_stages_of_a_user_run_between_ours_compiled_and_plain(teleop, package, tmp_path, way):
    stages = ("--set", "teleop.stages=[compiled_raise, plain_raise]")
    height = ("--set", "plain_raise.height=0.003")
    teleop(*RUN, *stages, *height, "--duration", 3, "--out", tmp_path / "bag", *way)
    bag = Bag(tmp_path / "bag")
    topic = Topic("slave/raised_cp", Kind.POSE)
    asked, raised, twice = (
        bag.read(t) for t in (topics.SLAVE_SERVO_CP, topic, Topic("slave/plain_cp", Kind.POSE))
    )
    for first, second, height in ((asked, raised, 0.002), (raised, twice, 0.003)):
        before, after = common(first, second)
        before[:, 2] += height
        assert np.array_equal(before, after)
    goals, joints = common(twice, bag.read(topics.SLAVE_SERVO_JP))
    reached = np.array([load_robot("rcrt1").fk(q)[:3, 3] for q in joints[-100:]])
    # Noise of the device is faster than the joints, which are there again some ticks later.
    assert np.median(np.abs(reached - goals[-100:, :3]).max(axis=1)) < 1e-4


@pytest.mark.slow
@both_ways
def test_a_second_source_of_force_acts_beside_the_first(teleop, package, tmp_path, way):
    helper = ("--set", "teleop.stages=[helper]")
    teleop(*RUN, *helper, "--duration", 3, "--out", tmp_path / "bag", *way)
    bag = Bag(tmp_path / "bag")
    assert bag.topics["helper/servo_cf"].count > 500
    # Without a fixture nothing else pushes.
    assert not bag.read(topics.MASTER_SERVO_CF).values.any()
    force = bag.read(topics.MASTER_MEASURED_CF).values
    assert np.median(force[:, 0]) == 0.25
    assert not force[:, 1:].any()


def push(peer, first, second):
    """Send one sample of each source that is given."""
    now = time.time_ns()
    for topic, force in ((topics.MASTER_SERVO_CF, first), (HELPER, second)):
        if force is not None:
            peer.send(topic, now, [force, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_the_master_feels_the_sum_of_all_sources_of_force(peer):
    felt = peer.listen(topics.MASTER_MEASURED_CF)
    peer.start("haptic_master", patience=0.0, links=FORCES)

    def feels(wanted, *sources):
        def is_felt():
            push(peer, *sources)
            return felt.take() and felt.values[-1][0] == wanted

        peer.wait(is_felt, f"{wanted} N")

    feels(0.75, 0.5, 0.25)
    feels(0.5, 0.5, 0.0)
    feels(0.25, 0.0, 0.25)


@pytest.mark.parametrize("silent", [0, 1])
def test_a_source_of_force_that_falls_silent_acts_no_more(peer, silent):
    felt = peer.listen(topics.MASTER_MEASURED_CF)
    peer.start("haptic_master", patience=0.0, links=FORCES)
    sources = [0.5, 0.25]

    def is_felt():
        push(peer, *sources)
        return felt.take() and felt.values[-1][0] == 0.75

    peer.wait(is_felt, "both")
    sources[silent] = None
    left = 0.5 if silent else 0.25

    def is_alone():
        push(peer, *sources)
        return felt.take() and felt.values[-1][0] == left

    peer.wait(is_alone, "the other one alone")


def test_an_answer_that_is_no_number_is_counted_and_told_but_not_sent(package, peer):
    answers = peer.listen(Topic("test/failing", Kind.POSE))
    peer.start("failing")

    def ask(x):
        peer.send(topics.MASTER_MEASURED_CP, time.time_ns(), [x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        return answers.take()

    peer.wait(lambda: ask(0.25), "an answer")
    told = "steps wrote NaN or infinity: not sent"
    peer.wait(lambda: ask(1.0) and told in peer.status("failing").message, "a warning")
    count = ask(0.25)
    peer.wait(lambda: ask(0.25) > count, "more answers")
    assert {values[0] for values in answers.values} == {0.25}
