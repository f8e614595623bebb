"""What the recorder has heard is on the disk, whatever ends it."""

import signal
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from live_process import LiveProcess, WorkingTime
from teleop_core.bags.reader import Bag, recover
from teleop_core.graph import topics

if TYPE_CHECKING:
    from ros.conftest import NodeProcess, Peer

pytestmark = pytest.mark.ros

LOST = 0.2
"""What a recorder that is killed may lose of the time for which it and its master worked [s]."""


def start(peer: Any, tmp_path: Path) -> "NodeProcess":
    """A recorder that hears a master at 1 kHz."""
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    peer.wait_value("recorder", "received.master/measured_cp", lambda n: n >= 0)
    peer.start("haptic_master")
    peer.wait_value("recorder", "received.master/measured_cp", lambda n: n > 1500)
    return recorder


@pytest.mark.slow
def test_a_killed_recorder_loses_at_most_a_fifth_of_a_second(peer: "Peer", tmp_path: Path) -> None:
    recorder = start(peer, tmp_path)
    with ExitStack() as stack:
        working = [
            stack.enter_context(WorkingTime(node.process.pid))
            for node in (recorder, peer.nodes[-1])
        ]
        received = peer.status("recorder").number("received.master/measured_cp")
        peer.wait_value("recorder", "received.master/measured_cp", lambda n: n > received + 1000)
        killed = time.time()
        recorder.process.send_signal(signal.SIGKILL)
        recorder.process.wait()
    out, _ = recover(tmp_path / "bag")
    series = Bag(out).read(topics.MASTER_MEASURED_CP)
    last = series.log_ns[-1] * 1e-9
    assert min(one.between(last, killed) for one in working) < LOST
    assert len(series) > 1000


@pytest.mark.slow
def test_a_recorder_whose_directory_moved_keeps_everything_and_does_not_say_success(
    peer: "Peer", tmp_path: Path
) -> None:
    recorder = start(peer, tmp_path)
    (tmp_path / "bag").rename(tmp_path / "moved")
    assert recorder.end(signal.SIGTERM) == 1
    assert f"messages are in {tmp_path / 'moved'}" in recorder.stderr.read_text()
    assert Bag(tmp_path / "moved").topics["master/measured_cp"].count > 1500


@pytest.mark.slow
def test_a_recorder_that_cannot_write_metadata_keeps_everything_for_recover(
    peer: "Peer", tmp_path: Path
) -> None:
    recorder = start(peer, tmp_path)
    (tmp_path / "bag" / "metadata.yaml").mkdir()
    assert recorder.end(signal.SIGINT) == 1
    assert "`teleop recover " in recorder.stderr.read_text()
    out, _ = recover(tmp_path / "bag")
    assert Bag(out).topics["master/measured_cp"].count > 1500


@pytest.mark.slow
@pytest.mark.parametrize(
    "way",
    [
        pytest.param((), id="processes", marks=pytest.mark.soak),
        pytest.param(("--composed",), id="composed"),
    ],
)
def test_live_does_not_call_a_recording_that_moved_recorded(
    peer: "Peer", tmp_path: Path, way: tuple[str, ...]
) -> None:
    live = LiveProcess(tmp_path, *way, env={"ROS_DOMAIN_ID": peer.domain})
    try:
        peer.wait(lambda: list(live.bag.glob("*.mcap")), "a recording")
        live.bag.rename(tmp_path / "moved")
        live.wait_running()
        peer.wait(lambda: peer.has_recorded({"slave/measured_cp": 1500}), "samples")
        live.signal(signal.SIGINT)
        assert live.wait() == 2, live.text
    finally:
        live.close()
    assert str(tmp_path / "moved") in live.text
    assert "next: teleop evaluate" not in live.text
    assert Bag(tmp_path / "moved").topics["slave/measured_cp"].count > 1500
