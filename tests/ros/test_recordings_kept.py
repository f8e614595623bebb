"""What the recorder has heard is on the disk, and a session says where."""

import signal
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from live_process import LiveProcess
from teleop_core.bags.reader import Bag

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.mark.soak
@pytest.mark.parametrize("way", [(), ("--composed",)], ids=["processes", "composed"])
def test_live_does_not_call_a_recording_that_moved_recorded(peer: "Peer", tmp_path: Path, way: tuple[str, ...]) -> None:
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
