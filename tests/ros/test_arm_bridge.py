"""A real arm's controller, in plain rclpy, behind a bridge: conformance passes through."""

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from teleop_core.graph.topics import SLAVE_MEASURED_JS
from teleop_core.nodes.children import environment
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]
CONTROLLER = Path(__file__).resolve().parents[1] / "support" / "plain_controller.py"
JOINTS = ("base", "shoulder", "slide", "roll", "pitch", "yaw")


# Five processes share two cores here, and an arm that stands still for a tenth of a second in the
# middle of a motion does not agree with its setpoint: CI tests the bridge and conformance apart.
@pytest.mark.soak
def test_conformance_passes_unchanged_through_the_bridge(peer: "Peer") -> None:
    pytest.importorskip("crtk_msgs")
    robot, measured = load_robot("rcrt1"), peer.listen(SLAVE_MEASURED_JS)
    env = environment() | {"ROS_DOMAIN_ID": peer.domain}
    controller = subprocess.Popen([sys.executable, str(CONTROLLER), "joint_state"], env=env)
    try:
        names = [f"{a}={b}" for a, b in zip(robot.joint_names, JOINTS, strict=True)]
        signs = [1.0, -1.0, 1.0, 1.0, 1.0, 1.0]
        peer.start("arm_bridge", kind="joint_state", joints=names, signs=signs)
        # A busy machine is no outage of the arm's.
        peer.start("slave", has_arm=False, operation__longest_outage=0.0)

        def is_home() -> bool:
            q = measured.values[-1][:6] if measured.take() else np.zeros(6)
            return bool(np.abs(q - robot.home).max() < 1e-3)

        peer.wait(is_home, "an arm at home")
        command = [sys.executable, "-m", "teleop_core.commands.cli", "conformance", "slave", "--yes"]
        done = subprocess.run(
            [*command, "--domain", peer.domain, "--wait", "30"],
            check=False,
            capture_output=True,
            text=True,
            timeout=300,
        )
    finally:
        controller.terminate()
        assert controller.wait(20) == 0
    assert done.returncode == 0, done.stdout + done.stderr
