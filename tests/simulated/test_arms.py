"""Arms as nodes: namespaces keep topics, reports and recordings apart."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from teleop_core.bags.reader import Bag
from teleop_core.bags.transforms import TF
from teleop_core.graph import topics
from teleop_core.robots import load_robot
from teleop_core.session.configuration import configure

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

MS = 1_000_000
REST = [0.0, -0.06, -0.08, 1.0, 0.0, 0.0, 0.0]
LEFT_JOINTS = topics.SLAVE_MEASURED_JS.of_arm("left")
LEFT_MASTER = topics.MASTER_MEASURED_CP.of_arm("left")


def test_a_node_in_a_namespace_publishes_and_reports_below_it(peer: "Peer") -> None:
    inside, outside = peer.listen(LEFT_JOINTS), peer.listen(topics.SLAVE_MEASURED_JS)
    peer.start("slave", arm="left", robot="puma560")
    peer.wait(lambda: inside.take() > 100, "left/slave/measured_js")
    np.testing.assert_allclose(inside.values[0][:6], load_robot("puma560").home, atol=1e-3)
    assert outside.take() == 0
    assert set(peer.observer.statuses) == {"left/slave", "left/slave_sim"}


def test_a_recorder_in_a_namespace_records_the_topics_of_its_arm(peer: "Peer", tmp_path: Path) -> None:
    recorder = peer.start("recorder", arm="left", out=str(tmp_path / "bag"))
    stamp = 0

    def heard() -> Any:
        nonlocal stamp
        stamp += MS
        peer.send(LEFT_MASTER, stamp, REST)
        peer.send(topics.MASTER_MEASURED_CP, stamp, [0.1, *REST[1:]], readers=0)
        return peer.status("left/recorder").number(f"received.{LEFT_MASTER.name}") > 100

    peer.wait(heard, "samples at the recorder")
    assert recorder.end() == 0
    bag = Bag(tmp_path / "bag")
    streams = {name for name in bag.topics if bag.topics[name].count}
    assert streams == {LEFT_MASTER.name, topics.DIAGNOSTICS.name}
    shared = {topics.DIAGNOSTICS.name, TF.name}
    assert all(name.startswith("left/") for name in {*bag.topics} - shared)
    assert (bag.read(LEFT_MASTER).values == REST).all()


@pytest.mark.slow
def test_nodes_of_two_arms_hand_a_block_from_jaw_to_jaw(peer: Any, tmp_path: Path) -> None:
    still, lifted = [0.0, 0.0, 0.02], [-0.03, 0.0, 0.02]
    given = [
        "teleop.arms=[left, right]",
        "jaw_sim.second_base=[0.0, -0.03, 0.0]",
        f"left/operator.tour.points={[*still, 0.0, -0.03, 0.02, *still * 4]}",
        "left/operator.buttons.jaw=[5.3, 9.5]",
        f"right/operator.tour.points={[0.0, 0.0, 0.0, -0.03, 0.0, 0.0, *lifted * 2, *still * 2]}",
        "right/operator.buttons.jaw=[8.5, 14.0]",
    ]
    first, second = topics.SLAVE_JAW_GRIP, topics.SLAVE_JAW_GRIP.of_arm("right")
    grips = {topic: peer.listen(topic) for topic in (first, second)}
    taken = first.columns.index("is_gripped")

    def is_handed_over() -> bool:
        for listener in grips.values():
            listener.take()
        rows = [listener.values[-1] for listener in grips.values() if len(listener.values)]
        return len(rows) == 2 and not rows[0][taken] and bool(rows[1][taken])

    bag = peer.run(configure("pick", settings=given), is_handed_over, tmp_path / "bag")
    for topic in (first, second):
        told = bag.read(topic).values
        assert told[-1, first.columns.index("grips")] == 1.0
        assert told[-1, first.columns.index("drops")] == 0.0
    board = bag.read(topics.SLAVE_JAW_BOARD.of_arm("right")).values
    assert board[-1, 5] > board[0, 5] + 0.01, "the block is not in the air"
