"""Start, stop, split and mark a recording by services: whatever is closed can be read."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from std_srvs.srv import Trigger

from teleop_core.bags.reader import Bag
from teleop_core.bags.recording import MARKS, RecordingParameters
from teleop_core.bags.reports import report
from teleop_core.base.errors import ParameterError
from teleop_core.graph import topics

if TYPE_CHECKING:
    from peers import AnyPeer as Peer


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
            return self.peer.status("recorder").number(key) >= before + count

        self._stamp = self.peer.feed(heard, "samples at the recorder", {MASTER: REST}, after=self._stamp)


def count(path: Path, topic: Any = MASTER) -> int:
    return Bag(path).topics[topic.name].count


@pytest.mark.slow
def test_a_split_closes_the_recording_and_goes_on_in_the_next_directory(peer: "Peer", tmp_path: Path) -> None:
    session = Session(peer, out=str(tmp_path / "bag"))
    session.send()
    assert session.ask("split") == (True, f"{tmp_path}/bag is closed; the recording continues in {tmp_path}/bag_1")
    first = count(tmp_path / "bag")
    assert first >= 100
    session.send()
    assert session.ask("split")[0]
    session.send()
    assert session.node.end() == 0
    second, third = Bag(tmp_path / "bag_1"), Bag(tmp_path / "bag_2")
    assert second.topics[MASTER.name].count >= 100
    assert second.start_ns >= Bag(tmp_path / "bag").end_ns
    assert third.metadata == second.metadata
    assert count(tmp_path / "bag") == first


@pytest.mark.slow
def test_nothing_is_recorded_between_stop_and_start(peer: "Peer", tmp_path: Path) -> None:
    session = Session(peer, out=str(tmp_path / "bag"))
    session.send()
    assert session.ask("start") == (False, f"records already to {tmp_path}/bag")
    assert session.ask("stop") == (True, f"stopped; recorded in {tmp_path}/bag")
    assert session.ask("stop") == (False, f"is stopped; the last one is {tmp_path}/bag")
    assert session.ask("mark")[0] is False
    whole = count(tmp_path / "bag")
    session.send()
    assert count(tmp_path / "bag") == whole
    assert session.ask("start") == (True, f"records to {tmp_path}/bag_1")
    session.send()
    assert session.node.end() == 0
    assert count(tmp_path / "bag_1") >= 100
    last, first = Bag(tmp_path / "bag").read(MASTER), Bag(tmp_path / "bag_1").read(MASTER)
    assert first.stamp_ns[0] - last.stamp_ns[-1] >= 100 * MS


def test_marks_keep_their_text_and_time(peer: "Peer", tmp_path: Path) -> None:
    session = Session(peer, out=str(tmp_path / "bag"))
    session.send()
    assert session.ask("mark") == (True, f"marked '1' in {tmp_path}/bag")
    assert peer.set("recorder", mark="needle in")[0].successful
    assert session.ask("mark") == (True, f"marked 'needle in' in {tmp_path}/bag")
    session.send()
    assert session.node.end() == 0
    bag = Bag(tmp_path / "bag")
    marks = bag.reports(MARKS)
    assert [mark.message for mark in marks] == ["1", "needle in"]
    assert bag.start_ns < marks[0].stamp_ns < marks[1].stamp_ns < bag.end_ns


def test_a_recorder_that_waits_begins_at_the_start_service(peer: "Peer", tmp_path: Path) -> None:
    session = Session(peer, wait="", out=str(tmp_path / "bag"), autostart=False)
    assert session.ask("split") == (False, "is not active, and therefore does not record")
    assert not (tmp_path / "bag").exists()
    assert session.ask("start") == (True, f"records to {tmp_path}/bag")
    peer.wait_state("recorder", "active")
    session.send()
    assert session.node.end() == 0
    assert count(tmp_path / "bag") >= 100


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


def test_topics_of_other_nodes_are_recorded_byte_for_byte(peer: "Peer", tmp_path: Path) -> None:
    name = "camera/front/image_raw/compressed"
    session = Session(peer, out=str(tmp_path / "bag"), also=[name])
    publisher = peer.publisher(topics.Topic(name, topics.Kind.REPORT, message="sensor_msgs/msg/CompressedImage"))
    sent = [bytes([0, 1, 0, 0, number]) + bytes(100_000) for number in range(20)]
    for data in sent:
        publisher.send(data)
        session.send(10)
    assert session.node.end() == 0
    bag = Bag(tmp_path / "bag")
    assert bag.topics[name].type == "sensor_msgs/msg/CompressedImage"
    kept = [data for *_, data in bag.raw([name])]
    assert len(kept) > 15  # the first ones may come before recorder and sender have found each other
    assert kept == sent[-len(kept) :]


@pytest.mark.parametrize("entry", ["imu", "imu=Imu", "=sensor_msgs/msg/Imu"])
def test_further_topics_without_a_type_are_refused(entry: str) -> None:
    with pytest.raises(ParameterError, match="PACKAGE/msg/TYPE"):
        RecordingParameters(also=(entry,))
