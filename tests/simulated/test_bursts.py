"""Bursts: what a late sender makes up for, and what a late reader finds."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from teleop_core.graph import topics
from teleop_core.graph.stage import STAGES
from teleop_core.kernels.geometry import Array, pose_from_transform
from teleop_core.nodes.making import make_node
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from peers import AnyPeer as Peer
    from peers import Listener

ARM = load_robot("rcrt1")
MS = 1_000_000


def has(listener: "Listener", count: int) -> bool:
    return listener.take() >= count


@pytest.mark.parametrize("is_side", [False, True], ids=["alone", "in a side of a session"])
def test_slave_answers_every_sample_of_its_arm_also_several_that_come_within_a_tick(peer: Any, is_side: bool) -> None:
    answers = peer.listen(topics.SLAVE_MEASURED_CP)
    if is_side:
        peer.side("slave", slave={"start": ARM.home.tolist()})
    else:
        peer.start("slave", has_arm=False)
    where: dict[int, Array] = {}

    def say(count: int) -> None:
        for _ in range(count):
            stamp = 1_000 * MS + len(where) * MS
            where[stamp] = ARM.home + 1e-6 * len(where) * np.eye(6)[0]
            state = [where[stamp], np.zeros(6), np.zeros(6)]
            peer.send(topics.SLAVE_MEASURED_JS, stamp, np.concatenate(state))

    def is_heard() -> int:
        say(1)
        return answers.take()

    peer.wait(is_heard, "a first answer")
    for _ in range(40):
        wanted = answers.take() + 5
        say(5)
        peer.wait(partial(has, answers, wanted), "an answer to each of a burst", timeout=30.0)
    answers.insist_on_all()
    assert answers.stamps == [stamp for stamp in where if stamp >= answers.stamps[0]]
    for stamp, pose in zip(answers.stamps, answers.values, strict=True):
        expected = np.empty(7)
        pose_from_transform(np.ascontiguousarray(ARM.fk(where[stamp])), expected)
        assert np.array_equal(pose, expected)


@pytest.mark.parametrize("count", [200, 400])
def test_what_comes_while_a_node_is_late_waits_for_it_up_to_its_catch_up(peer: "Peer", count: int) -> None:
    given = {"max_catch_up": 300, "autostart": False}
    node = make_node(STAGES.find("slave"), platform=peer.platform, values=given)
    node.ros.trigger("configure")
    measured = node.input(topics.SLAVE_MEASURED_JS)
    for tick in range(1, count + 1):
        state = [ARM.home, np.zeros(6), np.zeros(6)]
        peer.send(topics.SLAVE_MEASURED_JS, tick * MS, np.concatenate(state))
    peer.sleep(0.1)
    stamps = []
    while measured.take():
        stamps.append(measured.stamp_ns)
    assert stamps == [tick * MS for tick in range(1, count + 1)][-300:]
