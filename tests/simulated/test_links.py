"""Links between nodes: delayed ones, summed ones, and stages of a user put in between."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from teleop_core.graph import topics
from teleop_core.graph.topics import Kind, Topic

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


HELPER = Topic("helper/servo_cf", Kind.WRENCH, topics.MASTER_SERVO_CF.stamp, "master_base")
FORCES = ["master/servo_cf=master/servo_cf", "master/servo_cf=helper/servo_cf"]
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


def push(peer: "Peer", first: Any, second: Any) -> None:
    """Send one sample of each source that is given."""
    now = peer.time_ns()
    for topic, force in ((topics.MASTER_SERVO_CF, first), (HELPER, second)):
        if force is not None:
            peer.send(topic, now, [force, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_the_master_feels_the_sum_of_all_sources_of_force(peer: "Peer") -> None:
    felt = peer.listen(topics.MASTER_MEASURED_CF)
    peer.start("haptic_master", patience=0.0, links=FORCES)

    def feels(wanted: float, *sources: object) -> None:
        def is_felt() -> int:
            push(peer, *sources)
            return felt.take() and felt.values[-1][0] == wanted

        peer.wait(is_felt, f"{wanted} N")

    feels(0.75, 0.5, 0.25)
    feels(0.5, 0.5, 0.0)
    feels(0.25, 0.0, 0.25)


@pytest.mark.parametrize("silent", [0, 1])
def test_a_source_of_force_that_falls_silent_acts_no_more(peer: "Peer", silent: int) -> None:
    felt = peer.listen(topics.MASTER_MEASURED_CF)
    peer.start("haptic_master", patience=0.0, links=FORCES)
    sources: Any = [0.5, 0.25]

    def is_felt() -> int:
        push(peer, *sources)
        return felt.take() and felt.values[-1][0] == 0.75

    peer.wait(is_felt, "both")
    sources[silent] = None
    left = 0.5 if silent else 0.25

    def is_alone() -> int:
        push(peer, *sources)
        return felt.take() and felt.values[-1][0] == left

    peer.wait(is_alone, "the other one alone")
