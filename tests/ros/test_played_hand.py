"""A recorded hand over real topics: ``teleop play`` is the operator."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import teleop_core as tc
from peers import at_rest
from teleop_core.graph.topics import HAND_BUTTONS, HAND_SERVO_CP, SLAVE_MEASURED_CP
from teleop_core.hand.input_device import UNHELD
from teleop_core.nodes.children import environment

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.soak]


def test_a_recorded_hand_that_is_played_is_the_operator(
    peer: "Peer", compose: Callable[..., object], tmp_path: Path
) -> None:
    bag = tmp_path / "hand"
    settings = {"operator.approach_time": 1.0, "tremor_amplitude": 0.0}
    tc.run("free_motion", duration=30.0, out=bag, settings=settings)
    slave = {"starts_at_home": True, "operation": {"longest_outage": 0.0}}
    compose(operator={"kind": "elsewhere"}, slave=slave)
    tips = peer.listen(SLAVE_MEASURED_CP)
    peer.wait(lambda: peer.status("haptic_master").message.endswith(UNHELD), "a free stylus")
    peer.wait(at_rest(tips), "rest")
    tips.forget()
    command = [sys.executable, "-m", "teleop_core.commands.cli", "play", str(bag), "--topics",
               HAND_SERVO_CP.name, HAND_BUTTONS.name]  # fmt: skip
    player = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment() | {"ROS_DOMAIN_ID": peer.domain})

    def moves() -> int:
        assert player.poll() is None, "the player ended"
        return tips.take() and np.ptp(np.array(tips.values)[:, :3], axis=0).max() > 5e-3

    try:
        peer.wait(moves, "motion of the slave")
    finally:
        player.terminate()
        player.wait(60)
