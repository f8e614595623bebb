"""The clock that nodes go by, and that of a recording that is played."""

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rosgraph_msgs.msg import Clock

from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.nodes.children import environment

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros
EXAMPLE = Path(__file__).resolve().parents[2] / "bags" / "example"


@pytest.mark.parametrize("name", ["slave", "recorder"])
def test_a_clock_of_others_is_refused_in_one_line_at_the_start(peer: "Peer", tmp_path: Path, name: str) -> None:
    node = peer.start(name, wait="", use_sim_time=True)
    assert node.wait() == 2
    (line,) = node.stderr.read_text().splitlines()
    assert f"{name}.use_sim_time is True, must be false: nodes step in real time" in line


def test_a_clock_of_others_is_refused_at_run_time(peer: "Peer") -> None:
    peer.start("slave")
    (result,) = peer.set("slave", use_sim_time=True)
    assert not result.successful
    assert "nodes step in real time" in result.reason


def test_a_played_recording_tells_its_time_on_clock(peer: "Peer") -> None:
    bag, came = Bag(EXAMPLE), []

    def take_clock(message: Any) -> None:
        came.append(message.clock)

    peer.node.create_subscription(Clock, "/clock", take_clock, 1000)
    command = [sys.executable, "-m", "teleop_core.cli", "play", str(EXAMPLE), "--rate", "2"]
    command += ["--topics", topics.MASTER_MEASURED_CP.name, "--clock", "50"]
    env = environment() | {"ROS_DOMAIN_ID": peer.domain}
    player = subprocess.Popen(command, env=env)
    try:
        peer.wait(lambda: peer.spin() or len(came) > 60, "the time of the recording")
    finally:
        player.terminate()
        player.wait()
    told = np.array([clock.sec * 1_000_000_000 + clock.nanosec for clock in came])
    steps = np.diff(told) / 20_000_000
    assert (steps >= 1).all()
    assert np.allclose(steps, np.round(steps))
    assert bag.start_ns <= told[0]
    assert told[-1] <= bag.end_ns
