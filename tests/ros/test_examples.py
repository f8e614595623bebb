"""Examples that need real nodes beside them; the others are in tests/scenario."""

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from example_runs import EXAMPLES, numbers, run
from teleop_core.graph.operation import State
from teleop_core.nodes.children import environment
from teleop_core.nodes.remote_control import RemoteControl

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.mark.soak
def test_plain_ros_node_leads_the_slave_in_place_of_the_simulated_master_no_farther_than_it_goes(
    peer: "Peer", tmp_path: Path
) -> None:
    for name in ("slave", "inverse_kinematics", "motion_scaling"):
        peer.start(name)
    text = run("ros_device", tmp_path, **(environment() | {"ROS_DOMAIN_ID": peer.domain}))
    forces, samples = (numbers(pattern, text)[0] for pattern in (r"(\d+) forces", r"(\d+) samples"))
    assert samples == 2000
    assert forces > 0.5 * samples
    assert 18.0 < numbers(r"slave: ([\d.]+) mm", text)[0] < 20.5


def test_a_session_is_broken_in_a_way_of_ones_own(tmp_path: Path) -> None:
    text = run("own_exercise", tmp_path)
    assert "\u2713 shaken: ENABLED" in text
    assert numbers(r"went (\d+) mm", text)[0] > 50.0


@pytest.mark.soak
def test_a_crtk_client_moves_the_tip_and_comes_back_with_drives_of_others(peer: "Peer", tmp_path: Path) -> None:
    pytest.importorskip("crtk_msgs")
    env = environment() | {"ROS_DOMAIN_ID": peer.domain}
    with subprocess.Popen([sys.executable, str(EXAMPLES / "foreign_slave.py")], env=env) as drives:
        try:
            peer.start("slave", has_arm=False)
            text = run("crtk_client", tmp_path, **env)
            with RemoteControl(int(peer.domain), patience=30.0) as operator:
                assert operator.stop()[""].values["state"] == State.FAULT
        finally:
            drives.terminate()
    assert drives.returncode == 0
    assert "done" in text
    assert text.splitlines()[-1] == "back"
