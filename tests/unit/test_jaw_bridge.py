"""Jaw bridge without ROS: a gripper that is led keeps its grip, and starts without a jump."""

from typing import Any

import numpy as np
import pytest

from teleop_core.graph.operation import State
from teleop_core.graph.topics import NO_COMMAND_NS, OPERATION
from teleop_core.kernels.geometry import Array
from teleop_core.slave.bridges import hearing, jaw_bridge

MS = 1_000_000
PERIOD = 2 * MS
SPEED = jaw_bridge.JawBridgeParameters().speed_limit


class Gripper:
    """A gripper that goes at once where it is told, as far as what it holds lets it."""

    def __init__(self, holds: float = 0.0, **parameters: Any) -> None:
        self.bridge = jaw_bridge.JawBridge(jaw_bridge.JawBridgeParameters(joint="finger", **parameters))
        self.row, self.holds = self.bridge.signals, holds
        self.row["slave_operation"][OPERATION.index("state")] = float(State.ENABLED)
        self.sent: list[Any]
        self.now_ns, self.position, self.sent, self.setpoint_age = 0, 0.8, [], 0.0

    def lead(self, setpoint: float, ticks: int = 200, *, stamp_ns: int = MS, speaks: bool = True) -> None:
        """Commands of some periods while the server asks for an angle."""
        self.row["slave_jaw_setpoint_js"], self.row["slave_jaw_setpoint_js_ns"] = setpoint, stamp_ns
        for _ in range(ticks):
            self.now_ns += PERIOD
            if speaks:
                told = hearing.Sample(("a", "finger"), (0.0, self.position), (), (), self.now_ns)
                self.bridge.hear(told, self.now_ns)
            command = self.bridge.command(self.now_ns, self.setpoint_age, True)
            if command is not None:
                assert command.names == ("finger",)
                self.sent.append(float(command.position[0]))
                self.position = max(self.sent[-1], self.holds)

    @property
    def told(self) -> Array:
        return self.row["slave_jaw_measured_js"].copy()


def test_a_gripper_is_commanded_nothing_before_a_command_of_the_hand_is_in_force() -> None:
    gripper = Gripper()
    gripper.lead(0.0, stamp_ns=NO_COMMAND_NS)
    assert gripper.sent == []
    assert "waits for the hand" in gripper.bridge.trouble()
    assert gripper.told[0] == 0.8  # the server hears where it is
    gripper.lead(0.3)
    assert gripper.sent[-1] == 0.3
    assert gripper.bridge.trouble() == ""


def test_commands_begin_where_the_gripper_is_and_are_at_most_a_fifth_faster_than_rated() -> None:
    gripper = Gripper()
    gripper.lead(0.0)
    steps = np.diff([0.8, *gripper.sent])
    assert np.abs(steps).max() <= 1.2 * SPEED * PERIOD * 1e-9 * (1.0 + 1e-9)
    assert gripper.sent[-1] == 0.0


@pytest.mark.parametrize("how", ["brakes", "silence", "server"])
def test_no_outage_loosens_a_grip(how: str) -> None:
    gripper = Gripper(holds=0.1)
    gripper.lead(0.0)
    assert gripper.told[0] == 0.1
    before = len(gripper.sent)
    gripper.row["slave_operation"][OPERATION.index("is_braked")] = float(how == "brakes")
    gripper.setpoint_age = 1.0 if how == "server" else 0.0
    gripper.lead(0.0, speaks=how != "silence")
    gripper.setpoint_age = 0.0
    gripper.lead(0.0)
    assert len(gripper.sent) > before
    assert max(gripper.sent[before:]) == 0.0


def test_a_gripper_that_is_led_elsewhere_after_an_outage_starts_where_it_is() -> None:
    gripper = Gripper()
    gripper.lead(0.0)
    gripper.lead(0.0, speaks=False)
    gripper.position, before = 0.6, len(gripper.sent)
    gripper.lead(0.6)
    assert min(gripper.sent[before + 150 :]) == 0.6  # commands went on for 0.3 s of silence


def test_a_sliding_gripper_is_read_and_led_in_its_own_units() -> None:
    gripper = Gripper(scale=-20.0, offset=0.8)  # 0 m is open, 40 mm closed
    gripper.position = 0.0
    gripper.lead(0.0, stamp_ns=NO_COMMAND_NS, ticks=1)
    assert gripper.told[0] == pytest.approx(0.8)
    gripper.lead(0.2)
    assert gripper.sent[-1] == pytest.approx(0.03)
    assert gripper.told[0] == pytest.approx(0.2)


def test_effort_of_a_sliding_gripper_does_the_same_work_as_ours() -> None:
    gripper = Gripper(scale=-20.0, offset=0.8)
    gripper.bridge.hear(hearing.Sample(("finger",), (0.01,), (0.05,), (8.0,), MS), MS)
    _, velocity, effort = gripper.told
    assert velocity * effort == pytest.approx(0.05 * 8.0)
