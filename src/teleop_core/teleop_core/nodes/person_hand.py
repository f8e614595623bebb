"""Hand: what a person wants of the stylus, as topics from outside of the graph."""

from dataclasses import replace
from typing import Any

import numpy as np

from teleop_core.chain.operators.remote import BUTTONS, RemoteHand
from teleop_core.graph.topics import OPERATOR_BUTTONS, OPERATOR_SERVO_CP, Topic
from teleop_core.nodes.streams import Input

_SELDOM = 4
"""Buttons are looked at in every so many ticks."""


class HandInput:
    """``operator/servo_cp`` and ``operator/buttons``, looked at in every tick: 2 µs, no executor.

    They stand among the ports of the node, which reports, forgets and closes them.

    Args:
        node: Node that owns them, configured.
        hand: Who gets what they say.
        has_poses: Whether poses are read; else the buttons alone.
    """

    def __init__(self, node: Any, hand: RemoteHand, *, has_poses: bool) -> None:
        self._node, self._hand, self._ticks = node, hand, 0
        self._pose, self._pressed = np.zeros(7), np.zeros(len(BUTTONS))
        self._poses = self._open(OPERATOR_SERVO_CP, self._pose) if has_poses else None
        self._buttons = self._open(OPERATOR_BUTTONS, self._pressed)

    def _open(self, topic: Topic, target: Any) -> Input:
        name, delay = self._node.options.feeds(topic.name)[0]
        of_arm = replace(topic, name=name).of_arm(self._node.arm)
        entry = Input(
            self._node, of_arm, name, (), target, delay, self._node.options.joy_buttons
        )  # fmt: skip
        self._node.ports.inputs[topic.name] = [entry]
        return entry

    def read(self) -> None:
        """Hand on what has come: the newest pose, and every press and release of a button."""
        if self._poses is not None and self._poses.newest():
            self._hand.want(self._pose)
        self._ticks += 1
        if self._ticks % _SELDOM:
            return
        while self._buttons.take():
            for name, number in zip(BUTTONS, self._pressed.tolist(), strict=True):
                self._hand.press(name, is_pressed=number > 0.0)

    def concerns(self) -> list[str]:
        """A stylus that nobody holds."""
        if self._poses is None or self._hand.is_held:
            return []
        return [f"waits for {OPERATOR_SERVO_CP.name}: nobody holds the stylus"]

    def values(self) -> dict[str, str]:
        """Whether somebody holds the stylus, and who sends the poses."""
        if self._poses is None:
            return {}
        found = self._node.get_publishers_info_by_topic(f"/{self._poses.topic.name}")
        names = sorted(f"{i.node_namespace.rstrip('/')}/{i.node_name}" for i in found)
        return {"hand": " ".join(names), "hand.is_held": str(int(self._hand.is_held))}
