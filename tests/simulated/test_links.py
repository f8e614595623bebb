"""Links between nodes: delayed ones, summed ones, and stages of a user put in between."""

import sys
import textwrap
from collections.abc import Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Any

import pytest

from links import (
    HELPER,
    SETTINGS,
    STAGES,
    WATCHED,
    assert_delay_is_seen_in_the_latency,
    assert_second_source_of_force_acts_beside_the_first,
    assert_stages_run_between_ours,
    is_enough,
)
from teleop_core.bags.reader import Bag
from teleop_core.graph import stage, topics
from teleop_core.graph.topics import Kind, Topic
from teleop_core.session.configuration import configure

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


FORCES = ["master/servo_cf=master/servo_cf", "master/servo_cf=helper/servo_cf"]


def push(peer: "Peer", first: Any, second: Any) -> None:
    """Send one sample of each source that is given."""
    now = peer.time_ns()
    for topic, force in ((topics.MASTER_SERVO_CF, first), (HELPER, second)):
        if force is not None:
            peer.send(topic, now, [force, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_the_master_feels_the_sum_of_all_sources_of_force_that_are_not_silent(peer: "Peer") -> None:
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
    for left, *sources in ((0.5, 0.5, None), (0.25, None, 0.25)):
        feels(0.75, 0.5, 0.25)
        feels(left, *sources)


@pytest.fixture(scope="module")
def stages(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Stages of a user."""
    folder = tmp_path_factory.mktemp("links")
    (folder / "my_stages.py").write_text(textwrap.dedent(STAGES))
    sys.path.insert(0, str(folder))
    made = import_module("my_stages")
    own = (made.COMPILED, made.PLAIN, made.HELPER, made.FAILING)
    for one in own:
        stage.register_stage(one)
    yield
    for one in own:
        stage.STAGES.remove(one.name)
    sys.path.remove(str(folder))
    del sys.modules["my_stages"]


@pytest.fixture(scope="module")
def recorded(stages: None, common_peer: Any, tmp_path_factory: pytest.TempPathFactory) -> Bag:
    """Recording of a session with all of these stages."""
    listeners = [common_peer.listen(topic) for topic in WATCHED]
    settings = [*SETTINGS, "operator.approach_time=1.0"]
    out = tmp_path_factory.mktemp("session") / "bag"
    found: Bag = common_peer.run(configure("free_motion", settings=settings), lambda: is_enough(*listeners), out)
    return found


def test_a_delay_on_a_link_is_seen_in_the_latency_of_the_recording(recorded: Bag) -> None:
    assert_delay_is_seen_in_the_latency(recorded)


def test_a_second_source_of_force_acts_beside_the_first(recorded: Bag) -> None:
    assert_second_source_of_force_acts_beside_the_first(recorded)


def test_stages_of_a_user_run_between_ours_compiled_and_plain(recorded: Bag) -> None:
    assert_stages_run_between_ours(recorded)


def test_an_answer_that_is_no_number_is_counted_and_told_but_not_sent(stages: None, peer: "Peer") -> None:
    answers = peer.listen(Topic("test/failing", Kind.POSE))
    peer.start("failing")

    def ask(x: float) -> int:
        peer.send(topics.MASTER_MEASURED_CP, peer.time_ns(), [x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        return answers.take()

    peer.wait(lambda: ask(0.25), "an answer")
    told = "steps wrote NaN or infinity; their outputs are not sent"
    peer.wait(lambda: ask(1.0) and told in peer.status("failing").message, "a warning")
    count = ask(0.25)
    peer.wait(lambda: ask(0.25) > count, "more answers")
    assert {values[0] for values in answers.values} == {0.25}
