"""Arm bridge: a real arm's controller in the place of the simulated arm."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray, String

from simulated_arms import controller
from teleop_core.graph.topics import SLAVE_MEASURED_JS
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.platform import Qos
from teleop_core.robots import load_robot
from teleop_core.slave.operation import Fault
from teleop_drill import chosen
from teleop_drill.simulation.drill import simulated_drill
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.stand_ins import run_node

if TYPE_CHECKING:
    from peers import AnyPeer as Peer

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

    def __init__(self, peer: "Peer") -> None:
        self.peer, self.measured = peer, peer.listen(SLAVE_MEASURED_JS)
        self.witnessed = [math.nan, 0.0]
        peer.ros.create_subscription(Float64MultiArray, "/witness", self._see, Qos())
        self._misbehave = peer.ros.create_publisher(String, "/misbehave", Qos())

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
        self.peer.wait(lambda: not self.says("are refused") and not self.says("no commands"), "news")

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


def real_arm(peer: Any, kind: str = "joint_state") -> RealArm:
    """A real arm of a kind that stands off its home, led from there."""
    peer.foreign("controller", controller(kind))
    arm = RealArm(peer)
    peer.start("arm_bridge", kind=kind, **NAMED)
    peer.start("slave", has_arm=False, operation__longest_outage=0.0)
    return arm


@pytest.mark.parametrize("kind", KINDS)
def test_an_arm_of_each_kind_is_led_home_without_a_jump(peer: "Peer", kind: str) -> None:
    arm = real_arm(peer, kind)
    peer.wait(lambda: arm.is_at(ROBOT.home), "an arm at home")
    first, largest = arm.witness()
    assert first <= 2.5  # 1.2 of a rated speed, over two periods at most
    assert largest <= 2.5
    assert np.abs(arm.measured.values[0][:6] - STANDS).max() < 0.05  # it stood there
    peer.wait(lambda: not arm.says("sends no commands"), "a bridge that leads")
    peer.wait(lambda: peer.status("arm_bridge").number("commands") > 100, "commands")


def test_an_arm_that_jumps_is_told_nothing_more_and_begins_anew_after_the_fault(peer: "Peer") -> None:
    arm = real_arm(peer)
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


@pytest.fixture(scope="module")
def led_arm(common_peer: "Peer") -> RealArm:
    """An arm that is led home, to which the tests that follow do something."""
    arm = real_arm(common_peer)
    common_peer.wait(lambda: arm.is_at(ROBOT.home), "an arm at home")
    return arm


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("names", "it lacks slide"),
        ("strange", "contain only left_finger"),
        ("stale", "differ from our clock by at most 0.1 s"),
        ("back", "stamps must rise"),
        ("mute", "no valid sample"),
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
    assert not led_arm.peer.status("arm_bridge").message.count("are refused")


URDF = Path(__file__).resolve().parents[2] / "examples/ur5e.urdf"
UR5E: dict[str, Any] = {"robot": str(URDF), "geometry": ("tip=tool0",)}


@pytest.mark.slow
def test_the_drill_finds_an_arm_from_a_urdf_lost(tmp_path: Path) -> None:
    def bridge(platform: SimulatedPlatform) -> int:
        return run_node(platform, "arm_bridge", kind="forward_command", rate=500, **UR5E)

    settings = (f"robot={URDF}", "geometry=[tip=tool0]", "start=[0.0,-1.57,1.57,-1.57,-1.57,0.0]")
    rows = chosen(("kill_slave_sim",), is_composed=False)
    (lost,) = simulated_drill(
        rows, tmp_path, print, drives=bridge, arm=controller("forward_command", "ur5e"), texts=settings
    )
    assert lost.failures() == []
    assert lost.fault is Fault.FEEDBACK
