"""Start, stop, split and mark a recording by services: whatever is closed can be read."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from std_srvs.srv import Trigger

from teleop_core.bags.messages import report
from teleop_core.bags.reader import Bag
from teleop_core.graph import topics

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros

MS = 1_000_000
REST = [0.0, -0.06, -0.08, 1.0, 0.0, 0.0, 0.0]
MASTER = topics.MASTER_MEASURED_CP


class Session:
    """A recorder and a master that sends to it."""

    def __init__(self, peer: "Peer", **parameters: Any) -> None:
        self.peer, self._stamp = peer, 0
        self.node = peer.start("recorder", **parameters)

    def ask(self, service: str | int) -> Any:
        answer = self.peer.call(Trigger, f"/recorder/{service}", Trigger.Request())
        return answer.success, answer.message

    def send(self, count: int = 100) -> None:
        """Send until the recorder has taken that many more."""
        key = f"received.{MASTER.name}"
        before = self.peer.status("recorder").number(key)

        def heard() -> Any:
            self._stamp += MS
            self.peer.send(MASTER, self._stamp, REST)
            return self.peer.status("recorder").number(key) >= before + count

        self.peer.wait(heard, "samples at the recorder")


def count(path: Path, topic: Any = MASTER) -> int:
    return Bag(path).topics[topic.name].count


def test_a_new_recording_begins_with_the_last_state(peer: "Peer", tmp_path: Path) -> None:
    session = Session(peer, out=str(tmp_path / "bag"))
    state = report(7, "teleop", 0, "FOLLOWING", {"is_following": "1"})
    peer.publisher(topics.TELEOP_STATE).publish(state)
    peer.wait_value("recorder", f"received.{topics.TELEOP_STATE.name}", lambda n: n > 0)
    assert session.ask("split")[0]
    assert session.node.end() == 0
    for name in ("bag", "bag_1"):
        (found,) = Bag(tmp_path / name).reports(topics.TELEOP_STATE)
        assert (found.stamp_ns, found.message) == (7, "FOLLOWING")
