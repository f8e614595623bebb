"""Node ``operator``: the hand on the stylus, of a simulated person or of a person at a device."""

from dataclasses import replace
from typing import Any

import numpy as np

from teleop_core.base.errors import PartError
from teleop_core.graph import topics
from teleop_core.hand.input_device import UNHELD
from teleop_core.hand.operators import OPERATORS
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.follower import MOST
from teleop_core.hand.operators.remote import BUTTONS, RemoteHand
from teleop_core.nodes.device_hand import DeviceHand
from teleop_core.nodes.streams import Input
from teleop_core.nodes.ticking import TickingNode

_SELDOM = 4
"""Number of ticks between two readings of the buttons."""


class HandInput:
    """Inputs ``operator/servo_cp``, ``buttons`` and ``jaw``, read in every tick, in 2 µs and without executor.

    The inputs are added to the ports of the node, which reports, resets and closes them.

    Args:
        node: Configured node that owns the inputs.
        hand: Hand that receives the values.
        has_poses: Whether poses are read; if False, only the buttons.
    """

    def __init__(self, node: Any, hand: RemoteHand, *, has_poses: bool) -> None:
        self._node, self._hand, self._ticks = node, hand, 0
        self._pose, self._pressed, self._closing = np.zeros(7), np.zeros(len(BUTTONS)), np.zeros(1)
        self._poses = self._open(topics.OPERATOR_SERVO_CP, self._pose) if has_poses else None
        self._buttons = self._open(topics.OPERATOR_BUTTONS, self._pressed)
        self._jaw = self._open(topics.OPERATOR_JAW, self._closing)

    def _open(self, topic: topics.Topic, target: Any) -> Input:
        name, delay = self._node.options.feeds(topic.name)[0]
        of_arm = replace(topic, name=name).of_arm(self._node.arm)
        entry = Input(self._node, of_arm, name, (), target, delay, self._node.options.joy_buttons)
        self._node.ports.inputs[topic.name] = [entry]
        return entry

    def read(self) -> None:
        """Pass on the received values: the newest pose, every press and release of a button, and the jaw."""
        if self._poses is not None and self._poses.newest():
            self._hand.want(self._pose)
        self._ticks += 1
        if self._ticks % _SELDOM:
            return
        while self._buttons.take():
            for name, number in zip(BUTTONS, self._pressed.tolist(), strict=True):
                self._hand.press(name, is_pressed=number > 0.0)
        while self._jaw.take():
            self._hand.close(float(self._closing[0]))

    def concerns(self) -> list[str]:
        """Text about a stylus that no hand holds."""
        if self._poses is None or self._hand.is_held:
            return []
        return [f"waits for {topics.OPERATOR_SERVO_CP.name}: {UNHELD}"]

    def values(self) -> dict[str, str]:
        """Whether a hand holds the stylus, and the sender of the poses."""
        if self._poses is None:
            return {}
        found = self._node.ros.publishers(f"/{self._poses.topic.name}")
        names = sorted(end.node for end in found)
        return {"hand": " ".join(names), "hand.is_held": str(int(self._hand.is_held))}


_FULL = 3.3
"""Force at which a device rumbles at full strength [N]; a larger force feels the same."""
_LOOK = 10
"""Ticks between two readings of the state, for operators that do not react to measurements."""


class OperatorNode(TickingNode):
    """Publishes the wanted pose of the hand, once per millisecond."""

    _hand: HandInput | None = None
    _device: DeviceHand | None = None

    def setup(self, parameters: OperatorParameters) -> None:
        """Make the operator and open its topics, and its device."""
        super().setup(parameters)
        self._force = self.stage.signals[topics.MASTER_MEASURED_CF.field]
        self._hand, self._device = None, None
        self._sees = self.stage.ahead <= MOST
        if not self._sees:  # an operator that plans so far ahead does not react to measurements
            for port in (topics.SLAVE_MEASURED_CP, topics.MASTER_MEASURED_CP, topics.MASTER_MEASURED_CF):
                self.input(port).close()
        kind, hand = parameters.kind, self.stage.hand
        operator = OPERATORS.find(kind.kind)
        if not operator.is_here:
            self.leave_topics()
        if hand is None:
            if operator.opens is not None:
                text = "one whose make gives a RemoteHand, for it opens a device"
                raise PartError("operator", kind.kind, text)
            return
        if operator.opens is not None:
            self._device = DeviceHand(self, hand, operator.opens, kind.parameters, self._share)
        self._hand = HandInput(self, hand, has_poses=operator.opens is None)

    def _share(self) -> float:
        """Force that the person should feel, as a share of the largest force."""
        return min(float(np.linalg.norm(self._force[:3])) / _FULL, 1.0)

    def stop(self) -> None:
        """Release the stylus, so that the next activation starts without a hand."""
        if self.stage.hand is not None:
            self.stage.hand.let_go()

    def teardown(self) -> None:
        """Close what :meth:`setup` opened."""
        if self._device is not None:
            self._device.close()
        super().teardown()

    def read_ports(self, trigger: topics.Topic | None = None) -> None:
        """Update the signals, and read the pose that a person or program commands."""
        super().read_ports(trigger)
        if self._hand is not None:
            self._hand.read()

    def concerns(self) -> list[str]:
        """Texts about an operator that waits for the slave or for a person."""
        found = []
        if not self.stage.has_begun:
            found.append("waits until teleop/state says that the slave follows")
        people = (self._hand, self._device)
        return found + [text for one in people if one is not None for text in one.concerns()]

    def values(self) -> dict[str, str]:
        """Whether the operator already moves, and the device or sender that moves the hand."""
        begun = {"has_begun": str(int(self.stage.has_begun))}
        people = (self._hand, self._device)
        return begun | {k: v for one in people if one is not None for k, v in one.values().items()}
