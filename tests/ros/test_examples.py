"""Examples that need real nodes beside them; the others are in tests/scenario."""

import subprocess
import sys
from pathlib import Path

import pytest

from example_runs import EXAMPLES, numbers, run
from teleop_core.nodes.children import environment, free_domain
from teleop_core.nodes.remote_control import RemoteControl
from teleop_core.slave.operation import State

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def led_by_a_plain_node(folder: Path) -> float:
    """How wide the slave goes that `ros_device.py` leads by 20 mm [mm]."""
    env = environment() | {"ROS_DOMAIN_ID": free_domain()}
    nodes = [
        subprocess.Popen([sys.executable, "-m", "teleop_core.nodes", name], env=env)
        for name in ("motion_scaling", "inverse_kinematics", "slave", "slave_sim")
    ]
    try:
        text = run("ros_device", folder, **env)
    finally:
        for node in nodes:
            node.terminate()
        codes = [node.wait(60) for node in nodes]
    assert codes == [0, 0, 0, 0]
    forces, samples = (numbers(pattern, text)[0] for pattern in (r"(\d+) forces", r"(\d+) samples"))
    assert samples == 2000
    assert forces > 0.5 * samples
    return numbers(r"slave: ([\d.]+) mm", text)[0]


def test_plain_ros_node_leads_the_slave_in_place_of_the_simulated_master(tmp_path: Path) -> None:
    assert led_by_a_plain_node(tmp_path) > 18.0


@pytest.mark.soak
def test_a_plain_node_on_time_leads_the_slave_no_farther_than_it_goes(tmp_path: Path) -> None:
    assert led_by_a_plain_node(tmp_path) < 20.5


def test_a_session_is_broken_in_a_way_of_ones_own(tmp_path: Path) -> None:
    text = run("own_exercise", tmp_path)
    assert "\u2713 shaken: ENABLED" in text
    assert numbers(r"went (\d+) mm", text)[0] > 50.0


def test_a_crtk_client_moves_the_tip_and_comes_back_with_drives_of_others(tmp_path: Path) -> None:
    pytest.importorskip("crtk_msgs")
    env = environment() | {"ROS_DOMAIN_ID": free_domain()}
    commands = (["-m", "teleop_core.nodes", "slave"], [str(EXAMPLES / "foreign_slave.py")])
    nodes = [subprocess.Popen([sys.executable, *command], env=env) for command in commands]
    try:
        text = run("crtk_client", tmp_path, **env)
        with RemoteControl(int(env["ROS_DOMAIN_ID"]), patience=30.0) as operator:
            assert operator.stop()[""].values["state"] == State.FAULT
    finally:
        for node in nodes:
            node.terminate()
        codes = [node.wait(60) for node in nodes]
    assert codes == [0, 0]
    assert "done" in text
    assert text.splitlines()[-1] == "back"
