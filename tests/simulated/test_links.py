"""Links between nodes: delayed ones, summed ones, and stages of a user put in between."""

from typing import TYPE_CHECKING, Any

import pytest

from teleop_core.graph import topics
from teleop_core.graph.topics import Kind, Topic

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


HELPER = Topic("helper/servo_cf", Kind.WRENCH, topics.MASTER_SERVO_CF.stamp, "master_base")
FORCES = ["master/servo_cf=master/servo_cf", "master/servo_cf=helper/servo_cf"]


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
