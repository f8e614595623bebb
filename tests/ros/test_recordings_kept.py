"""What the recorder has heard is on the disk, whatever ends it."""

import signal
import subprocess
import sys
import time

import pytest

from teleop_core import topics
from teleop_core.bags.reader import Bag, recover

pytestmark = pytest.mark.ros

LOST_NS = 200_000_000
"""What a recorder that is killed may lose [ns]."""


def start(peer, tmp_path):
    """A recorder that hears a master at 1 kHz."""
    recorder = peer.start("recorder", out=str(tmp_path / "bag"))
    peer.wait_value("recorder", "received.master/measured_cp", lambda n: n >= 0)
    peer.start("haptic_master")
    peer.wait_value("recorder", "received.master/measured_cp", lambda n: n > 1500)
    return recorder


@pytest.mark.slow
def test_a_killed_recorder_loses_at_most_a_fifth_of_a_second(peer, tmp_path):
    recorder = start(peer, tmp_path)
    killed_ns = time.time_ns()
    recorder.process.send_signal(signal.SIGKILL)
    recorder.process.wait()
    out, _ = recover(tmp_path / "bag")
    series = Bag(out).read(topics.MASTER_MEASURED_CP)
    assert killed_ns - int(series.log_ns[-1]) < LOST_NS
    assert len(series) > 1000


@pytest.mark.slow
def test_a_recorder_whose_directory_moved_keeps_everything_and_does_not_say_success(peer, tmp_path):
    recorder = start(peer, tmp_path)
    (tmp_path / "bag").rename(tmp_path / "moved")
    assert recorder.end(signal.SIGTERM) == 1
    assert f"messages are in {tmp_path / 'moved'}" in recorder.stderr.read_text()
    assert Bag(tmp_path / "moved").topics["master/measured_cp"].count > 1500


@pytest.mark.slow
def test_a_recorder_that_cannot_write_metadata_keeps_everything_for_recover(peer, tmp_path):
    recorder = start(peer, tmp_path)
    (tmp_path / "bag" / "metadata.yaml").mkdir()
    assert recorder.end(signal.SIGINT) == 1
    assert "`teleop recover " in recorder.stderr.read_text()
    out, _ = recover(tmp_path / "bag")
    assert Bag(out).topics["master/measured_cp"].count > 1500


@pytest.mark.slow
@pytest.mark.parametrize("way", [(), ("--composed",)], ids=["processes", "composed"])
def test_live_does_not_call_a_recording_that_moved_recorded(peer, tmp_path, way):
    out = tmp_path / "bag"
    command = [sys.executable, "-m", "teleop_core.cli", "live", "--duration", "2", *way]
    with subprocess.Popen(
        [*command, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as live:
        peer.wait(lambda: list(out.glob("*.mcap")) or live.poll() is not None, "a recording")
        out.rename(tmp_path / "moved")
        said, told = live.communicate(timeout=120)
    assert live.returncode == 2, said + told
    assert str(tmp_path / "moved") in told
    assert "next: teleop evaluate" not in said
    assert Bag(tmp_path / "moved").topics["slave/measured_cp"].count > 1500
