"""A recording that is played in simulated time, for the machines that have no ``ros2 bag``."""

from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from simulated.conftest import SimulatedPeer
from teleop_core.bags.reader import Bag
from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.graph import topics
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.play import play
from teleop_drill.simulation.platform import SimulatedPlatform

EXAMPLE = Path(__file__).parents[2] / "bags/example"
NAMES = ["master/measured_cp", "/master/buttons"]
RATE = 2.0


def test_a_recording_is_published_as_it_was(peer: SimulatedPeer) -> None:
    bag, sent = Bag(EXAMPLE), list[int]()
    pose, state = peer.listen(topics.MASTER_MEASURED_CP), peer.listen(topics.MASTER_BUTTONS)

    def work(platform: SimulatedPlatform) -> int:
        sent.append(play(bag, NAMES, RATE, Console(quiet=True), platform))
        return 0

    player = peer.foreign("player", work)
    began_ns = peer.platform.monotonic_ns()
    peer.wait(lambda: (pose.take(), state.take(), player.is_dead)[-1], "end of the recording")
    assert peer.platform.monotonic_ns() - began_ns >= (bag.end_ns - bag.start_ns) / RATE
    series = bag.read(topics.MASTER_MEASURED_CP)
    assert sent == [2 * len(series)]
    for listener in (pose, state):
        assert listener.take() + listener.lost == len(series)
    where = np.searchsorted(series.stamp_ns, pose.stamps)
    np.testing.assert_array_equal(series.stamp_ns[where], pose.stamps)
    np.testing.assert_array_equal(series.values[where], np.array(pose.values))


@pytest.mark.parametrize("after", [0.5, 1.5])
def test_a_signal_ends_it_where_it_waits(peer: SimulatedPeer, after: float) -> None:
    interrupt = Interrupt()
    player = peer.foreign(
        "player", lambda platform: play(Bag(EXAMPLE), NAMES, 0.1, Console(quiet=True), platform, interrupt)
    )
    peer.platform.sleep(after)
    assert not player.is_dead
    interrupt.ask()
    peer.wait(lambda: player.is_dead, "its end", 0.2)


def test_it_refuses_what_is_not_there() -> None:
    with pytest.raises(RecordingError, match="lacks no/topic"):
        play(Bag(EXAMPLE), ["no/topic"], 1.0, Console(quiet=True))
    with pytest.raises(ParameterError) as caught:
        play(Bag(EXAMPLE), None, 0.0, Console(quiet=True))
    assert caught.value.name == "--rate"
