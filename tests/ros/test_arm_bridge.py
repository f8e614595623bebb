"""Arm bridge: a real arm's controller, in plain rclpy, in the place of the simulated arm."""

import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray, String

from teleop_core.graph.topics import SLAVE_MEASURED_JS, SLAVE_SETPOINT_JS
from teleop_core.kernels.geometry import Array
from teleop_core.nodes.children import environment
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from ros.conftest import Peer

pytestmark = [pytest.mark.ros, pytest.mark.slow]

CONTROLLER = Path(__file__).resolve().parents[1] / "plain_controller.py"
KINDS = ("joint_state", "forward_command", "joint_trajectory", "crtk")
ROBOT = load_robot("rcrt1")
JOINTS = ("base", "shoulder", "slide", "roll", "pitch", "yaw")
STANDS = np.array([0.1, 1.9, 0.4, 0.0, 0.1, 0.0])
NAMED: dict[str, Any] = {
    "joints": [f"{ours}={theirs}" for ours, theirs in zip(ROBOT.joint_names, JOINTS, strict=True)],
    "signs": [1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
    "order": list(reversed(JOINTS)),
}


class RealArm:
    """A controller, its bridge and the server that leads it."""

    def __init__(self, peer: "Peer", kind: str) -> None:
        self.peer, self.kind = peer, kind
        self.measured, self.setpoint = map(peer.listen, (SLAVE_MEASURED_JS, SLAVE_SETPOINT_JS))
        self.witnessed = [math.nan, 0.0]
        peer.node.create_subscription(Float64MultiArray, "witness", self._see, 10)
        self._misbehave = peer.node.create_publisher(String, "misbehave", 10)

    def _see(self, message: Any) -> None:
        self.witnessed = list(message.data)

    def misbehave(self, how: str) -> None:
        self.peer.wait(self._misbehave.get_subscription_count, "the controller")
        self._misbehave.publish(String(data=how))

    def witness(self) -> list[float]:
        """First command's distance and largest step, in shares of a rated step of 2 ms."""
        self.peer.wait(lambda: self.peer.spin() or not math.isnan(self.witnessed[0]), "a witness")
        return self.witnessed

    def where(self) -> Array | None:
        """Joints as the server hears them, or None."""
        return self.measured.values[-1][:6] if self.measured.take() else None

    def is_at(self, goal: Array, tolerance: float = 1e-3) -> bool:
        where = self.where()
        return where is not None and np.abs(where - goal).max() < tolerance

    def goes_on(self) -> None:
        self.measured.forget()
        self.peer.wait(lambda: self.measured.take() > 10, "samples that are passed on")
        self.peer.wait(lambda: not self.says("not believed") and not self.says("nothing"), "news")

    def operation(self, text: str) -> bool:
        return text in self.peer.status("slave").values["operation"]

    def says(self, text: str) -> bool:
        status = self.peer.status("arm_bridge")
        return status is not None and text in status.message

    def holds(self, text: str) -> None:
        """Wait until the bridge says why, and the server that it holds."""
        self.peer.wait(lambda: self.says(text), f"the bridge to say {text!r}")
        self.peer.wait(self._server_holds, "a server that holds")

    def _server_holds(self) -> bool:
        message = self.peer.status("slave").message
        return "no slave/measured_js" in message


@contextmanager
def real_arm(peer: "Peer", kind: str = "joint_state", **parameters: Any) -> Iterator[RealArm]:
    """A real arm of a kind that stands off its home, led from there."""
    env = environment() | {"ROS_DOMAIN_ID": peer.domain}
    controller = subprocess.Popen([sys.executable, str(CONTROLLER), kind], env=env)
    try:
        arm = RealArm(peer, kind)
        peer.start("arm_bridge", kind=kind, **NAMED, **parameters)
        # A busy machine is no outage of the arm's.
        peer.start("slave", has_arm=False, operation__longest_outage=0.0)
        yield arm
    finally:
        controller.terminate()
        assert controller.wait(20) == 0


def is_led_home_without_a_jump(arm: RealArm) -> bool:
    peer = arm.peer
    peer.wait(lambda: arm.is_at(ROBOT.home), "an arm at home")
    first, largest = arm.witness()
    assert first <= 2.5  # 1.2 of a rated speed, over two periods at most
    assert largest <= 2.5
    assert np.abs(arm.measured.values[0][:6] - STANDS).max() < 0.05  # it stood there
    peer.wait(lambda: not arm.says("commands nothing"), "a bridge that leads")
    peer.wait(lambda: peer.status("arm_bridge").number("commands") > 100, "commands")
    return True


@pytest.mark.parametrize("kind", KINDS[1:])
def test_an_arm_of_each_kind_is_led_home_without_a_jump(peer: "Peer", kind: str) -> None:
    with real_arm(peer, kind) as arm:
        assert is_led_home_without_a_jump(arm)


# Five processes share two cores here, and an arm that stands still for a tenth of a second in the
# middle of a motion does not agree with its setpoint: CI tests the bridge and conformance apart.
@pytest.mark.soak
def test_conformance_passes_unchanged_through_the_bridge(peer: "Peer") -> None:
    pytest.importorskip("crtk_msgs")
    with real_arm(peer) as arm:
        peer.wait(lambda: arm.is_at(ROBOT.home), "an arm at home")
        command = [sys.executable, "-m", "teleop_core.cli", "conformance", "slave", "--yes"]
        done = subprocess.run(
            [*command, "--domain", peer.domain, "--wait", "30"],
            check=False, capture_output=True, text=True, timeout=300,
        )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.soak
def test_an_arm_that_jumps_is_told_nothing_more_and_begins_anew_after_the_fault(
    peer: "Peer",
) -> None:
    with real_arm(peer) as arm:
        peer.wait(lambda: arm.is_at(ROBOT.home), "an arm at home")
        arm.misbehave("jump")
        arm.holds("base jumped by")
        count, sent = arm.measured.take(), set()

        def is_at_fault() -> bool:
            if arm.says("jumped"):
                sent.add(peer.status("arm_bridge").number("commands"))
            return arm.operation("FAULT")

        peer.wait(is_at_fault, "the server's fault")  # after 2 s of silence
        assert len(sent) == 1  # the arm was told nothing more
        peer.wait(lambda: arm.measured.take() > count, "an arm that begins anew")


# What follows is done to one arm, so that no more processes run than it needs.


@pytest.fixture(scope="module")
def led_arm(common_peer: "Peer") -> Iterator[RealArm]:
    """An arm that is led home."""
    with real_arm(common_peer) as arm:
        yield arm


def test_an_arm_that_says_joint_states_is_led_home_without_a_jump_too(led_arm: RealArm) -> None:
    assert is_led_home_without_a_jump(led_arm)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("names", "says nothing of slide"),
        ("strange", "heard are left_finger"),
        ("stale", "s old, at most 0.1 s"),
        ("back", "its stamp does not rise"),
        ("mute", "no sound sample"),
    ],
)
def test_an_answer_that_cannot_be_believed_holds_the_arm_until_it_is_sound_again(
    led_arm: RealArm, how: str, words: str
) -> None:
    arm = led_arm
    arm.misbehave(how)
    arm.holds(words)
    count = arm.measured.take()
    arm.peer.spin()
    assert arm.measured.take() == count
    arm.misbehave("")
    arm.goes_on()


def test_another_order_of_names_changes_nothing(led_arm: RealArm) -> None:
    led_arm.misbehave("order")
    led_arm.measured.forget()
    led_arm.peer.wait(lambda: led_arm.measured.take() > 100, "samples in another order")
    assert np.abs(np.array(led_arm.measured.values)[:, :6] - ROBOT.home).max() < 1e-3
    assert not led_arm.peer.status("arm_bridge").message.count("not believed")
