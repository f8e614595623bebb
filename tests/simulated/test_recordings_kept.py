"""What the recorder has heard is on the disk, whatever ends it."""

import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped

from teleop_core.bags.messages import layout
from teleop_core.bags.reader import Bag, recover
from teleop_core.graph import topics
from teleop_core.middleware.platform import Qos
from teleop_drill.simulation.bus import Line

if TYPE_CHECKING:
    from peers import AnyPeer as Peer
    from simulated.conftest import SimulatedPeer

LOST = 0.2
"""What a recorder that is killed may lose [s]."""


def start(peer: Any, tmp_path: Path) -> Any:
    """A recorder that hears a master at 1 kHz."""
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    peer.wait_value("recorder", "received.master/measured_cp", lambda n: n >= 0)
    peer.start("haptic_master")
    peer.wait_value("recorder", "received.master/measured_cp", lambda n: n > 1500)
    return recorder


def test_a_killed_recorder_loses_at_most_a_fifth_of_a_second(peer: "Peer", tmp_path: Path) -> None:
    recorder = start(peer, tmp_path)
    received = peer.status("recorder").number("received.master/measured_cp")
    peer.wait_value("recorder", "received.master/measured_cp", lambda n: n > received + 1000)
    killed_ns = peer.time_ns()
    recorder.process.send_signal(signal.SIGKILL)
    out, _ = recover(tmp_path / "bag")
    series = Bag(out).read(topics.MASTER_MEASURED_CP)
    assert killed_ns - series.log_ns[-1] < 1e9 * LOST
    assert len(series) > 1000


@pytest.mark.parametrize("is_moved", [True, False])
def test_a_recorder_whose_directory_moved_or_takes_no_metadata_keeps_everything_and_does_not_say_success(
    peer: "Peer", tmp_path: Path, is_moved: bool
) -> None:
    recorder = start(peer, tmp_path)
    place = tmp_path / "bag"
    place = place.rename(tmp_path / "moved") if is_moved else place
    if not is_moved:
        (place / "metadata.yaml").mkdir()
    assert recorder.end() == 1
    told = f"messages are in {place}" if is_moved else "`teleop recover "
    assert told in recorder.stderr.read_text()
    if not is_moved:
        place, _ = recover(place)
    assert Bag(place).topics["master/measured_cp"].count > 1500


def test_what_the_middleware_brings_after_a_feed_has_begun_does_not_stand_behind_newer_samples(
    peer: "SimulatedPeer", tmp_path: Path
) -> None:
    """A busy machine brought one sample 39 ms after newer ones of the feed: its stamps went back."""
    topic, platform = topics.MASTER_MEASURED_CP, peer.platform
    form, pose = layout(topic, ()), np.eye(7)[3]
    peer.bus.lines["*", "recorder"] = Line(delay=0.005)
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    channel = recorder.crew.nodes[0].channels[topic.name]
    sender = peer.ros.create_publisher(PoseStamped, f"/{topic.name}", Qos())

    def is_heard() -> bool:
        sender.send(form.encode_one(platform.time_ns(), pose))
        return bool(channel.received)

    peer.wait(is_heard, "a sample")
    recorder.send_signal(signal.SIGSTOP)
    sender.send(form.encode_one(platform.time_ns(), pose))
    channel.join(True, platform.time_ns())
    for _ in range(10):
        platform.sleep(0.001)
        channel.give(form.encode_one(platform.time_ns(), pose), platform.time_ns())
    recorder.send_signal(signal.SIGCONT)
    platform.sleep(0.1)
    assert recorder.end() == 0
    series = Bag(tmp_path / "bag").read(topic)
    assert len(series) > 11
    assert (np.diff(series.stamp_ns) > 0).all()
