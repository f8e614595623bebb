"""Who may end a session with its task hears of every arm's."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from teleop_core.graph.topics import TASK_STATE
from teleop_core.nodes.task_end import TaskEnd
from teleop_core.session.configuration import configure

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

LEFT, OVER = np.zeros((2, len(TASK_STATE.columns)))
OVER[TASK_STATE.columns.index("is_over")] = 1.0


@pytest.mark.parametrize("last", ["", "right"])
def test_a_session_of_two_arms_has_no_goal_left_once_both_say_so(peer: "Peer", last: str) -> None:
    arms = configure("point", settings=["teleop.arms=[left, right]"])
    end = TaskEnd(peer, arms.graph)
    topics = {arm: TASK_STATE.of_arm(arm) for arm in ("", "right")}
    for topic in topics.values():
        peer.send(topic, 1_000_000, LEFT)
    for arm, topic in topics.items():
        if arm != last:
            peer.send(topic, 2_000_000, OVER)
    peer.sleep(0.5)
    assert not end.is_there()
    peer.send(topics[last], 2_000_000, OVER)
    peer.wait(end.is_there, "the end of both tasks")


def test_a_session_without_a_task_does_not_end_with_one(peer: "Peer") -> None:
    assert not TaskEnd(peer, configure("coarse_box").graph).is_there()
