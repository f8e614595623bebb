"""Parameters that a button changes, and the clock that nodes go by."""

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from rosgraph_msgs.msg import Clock

from foreign_hand import Hand
from teleop_core.bags.reader import Bag
from teleop_core.graph import topics
from teleop_core.nodes.children import environment

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = pytest.mark.ros
EXAMPLE = Path(__file__).resolve().parents[2] / "bags" / "example"
PRESS, RELEASE = (0, 0, 1), (0, 0, 0)


def mode(peer: "Peer") -> Any:
    request = GetParameters.Request(names=["mode"])
    answer = peer.call(GetParameters, "/motion_scaling/get_parameters", request)
    return answer.values[0].string_value


def press(peer: "Peer", hand: Hand, expected: str) -> None:
    """Press the mode button until the parameter shows the mode, and release it."""

    def shown() -> Any:
        hand.move(*PRESS)
        return mode(peer) == expected

    peer.wait(shown, f"parameter mode {expected}")
    hand.moved(*RELEASE)


def test_mode_as_a_parameter_follows_the_button_and_can_be_set_back(peer: "Peer") -> None:
    peer.start("motion_scaling", feedback_timeout=5.0)
    hand = Hand(peer)
    hand.engage(*RELEASE)
    coarse = hand.moved(*RELEASE)
    press(peer, hand, "fine")
    assert hand.moved(*RELEASE) == pytest.approx(0.1 * coarse, rel=0.2)
    (result,) = peer.set("motion_scaling", mode="coarse")
    assert result.successful
    assert hand.moved(*RELEASE) == pytest.approx(coarse, rel=0.2)
    press(peer, hand, "fine")
    assert peer.set("motion_scaling", fine_gain=0.2)[0].successful
    assert hand.moved(*RELEASE) == pytest.approx(0.2 * coarse, rel=0.2)  # and the mode stays
    assert mode(peer) == "fine"


@pytest.mark.parametrize("name", ["slave", "recorder"])
def test_a_clock_of_others_is_refused_in_one_line_at_the_start(
    peer: "Peer", tmp_path: Path, name: str
) -> None:
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
