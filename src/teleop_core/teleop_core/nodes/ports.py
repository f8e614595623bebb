"""Ports: connect the topics that a node reads and writes to the fields of its stage's signals."""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any

import numpy as np

from teleop_core.bags.layouts import layout
from teleop_core.bags.messages import BUTTONS
from teleop_core.base.parameters import NoParameters
from teleop_core.graph.graph import BUILT_IN
from teleop_core.graph.signals import make_signals
from teleop_core.graph.stage import Stage
from teleop_core.graph.topics import BY_NAME, PORTS_BETWEEN_ARMS, SELDOM_NS, Kind, Topic
from teleop_core.kernels.fields import Cells
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.world import Publisher
from teleop_core.nodes.streams import Input, Output

Feeds = Callable[[str], list[tuple[str, float]]]
"""Function from a port to the topics that feed it, each with its delay [s]."""


class Ports:
    """Inputs and outputs of one stage.

    Args:
        owner: Node that owns the ports.
        arm: Namespace of the node, without leading slash.
        stage: Stage to which the ports belong.
        signals: Record of the stage.
        joint_names: Order of the joints.
        feeds: Returns the topics that feed a port.
        publisher: Opens the publisher of a topic.
        buttons: Indices of clutch, fixture and mode among a message's buttons; -1 if the message lacks a button.

    Attributes:
        inputs: Inputs of each port, by its name; values of several inputs are added.
        outputs: Outputs, by the topic in its namespace.
        row: The signals, by the names of their fields.
    """

    def __init__(
        self,
        owner: Any,
        arm: str,
        stage: Stage,
        signals: Any,
        joint_names: tuple[str, ...],
        feeds: Feeds,
        publisher: Callable[[Topic], Publisher],
        buttons: tuple[int, ...] = BUTTONS,
    ) -> None:
        self._arm, self._stage, self.row = arm, stage, Cells(signals)
        self._must_check = stage.name not in BUILT_IN
        self.refused = 0
        """Number of steps whose outputs were not sent because they contained NaN or infinity."""
        self.inputs: dict[str, list[Input]] = {}
        self.outputs: dict[Topic, Output] = {}
        self._summed: list[tuple[str, list[Array]]] = []
        for port in stage.reads:
            given = feeds(port.name)
            own, heard = signals[port.field], _heard if port == stage.trigger else _seen
            targets = [own] if len(given) == 1 else [own.copy() for _ in given]
            self.inputs[port.name] = [
                Input(owner, heard(port, name, arm), _name_for(owner, name), joint_names, target, delay, buttons)
                for (name, delay), target in zip(given, targets, strict=True)
            ]
            if len(targets) > 1:
                self._summed.append((port.field, targets))
        # Built once, because every tick uses them, a thousand times a second.
        self._ports = [(p.name, f"{p.field}_ns", self.inputs[p.name]) for p in stage.reads]
        self._stamped: list[tuple[Output, str]] = []
        self._passed_on: dict[Output, int] = {}  # last sent stamp of each output
        self._seldom: dict[Output, tuple[bytes, int]] = {}  # last sent values of each output, and their stamp
        for topic in stage.writes:
            if topic.kind is not Kind.REPORT:
                form = layout(topic.of_arm(arm), joint_names)
                output = Output(owner, publisher(topic), form, signals[topic.field], topic.name)
                self.outputs[topic.of_arm(arm)] = output
                self._stamped.append((output, self._stamp_field(topic)))
                if topic.stamp.of and not topic.stamp.is_in_force:
                    self._passed_on[output] = 0
                if topic.is_seldom:
                    self._seldom[output] = b"", 0

    def _stamp_field(self, written: Topic) -> str:
        """Field of the stamp that an output passes on; empty for the time of sampling."""
        if written.stamp.is_in_force:
            return f"{written.field}_ns"
        ports = [port for port in self._stage.reads if port.name == written.stamp.of]
        return f"{ports[0].field}_ns" if ports else ""

    def input(self, port: Topic) -> Input:
        """Input of a port. If the values of several topics are added, the input of the first topic."""
        return self.inputs[port.name][0]

    def output(self, topic: Topic) -> Output:
        """Output of a topic of the stage."""
        return self.outputs[topic.of_arm(self._arm)]

    def all_inputs(self) -> list[Input]:
        """Inputs of all ports."""
        return [entry for entries in self.inputs.values() for entry in entries]

    def read(self, trigger: Topic | None = None) -> None:
        """Update the signals of all ports except the trigger's port."""
        own = trigger.name if trigger is not None else ""
        for name, stamp_field, entries in self._ports:
            if name != own:
                for entry in entries:
                    entry.newest()
                stamp_ns = entries[0].stamp_ns
                if stamp_ns is not None:
                    self.row[stamp_field] = stamp_ns
        for name, parts in self._summed:
            self.row[name] = np.sum(parts, axis=0)

    def send(self, now_ns: int, silent: Collection[str] = ()) -> None:
        """Send the stage's outputs, except the topics in ``silent``.

        Each output gets the stamp that its topic declares.

        An output whose stamp was already sent is not a new answer and is not sent. Values of a user's stage that are
        not finite are not sent either.
        """
        row = self.row
        if self._must_check and not all(output.is_sound() for output, _ in self._stamped):
            self.refused += 1
            return
        for output, stamp_field in self._stamped:
            if output.name in silent:
                continue
            self.send_one(output, row[stamp_field] if stamp_field else now_ns)

    def send_one(self, output: Output, stamp_ns: int) -> None:
        """Send the current values of one output with a stamp [ns], as :meth:`send` does."""
        if output in self._passed_on:
            if self._passed_on[output] == stamp_ns:
                return
            self._passed_on[output] = stamp_ns
        if output in self._seldom:
            values, (before, last_ns) = output.bits(), self._seldom[output]
            if values == before and stamp_ns - last_ns < SELDOM_NS:
                return
            self._seldom[output] = values, stamp_ns
        output.send(stamp_ns)

    def mute(self) -> None:
        """Send nothing from now on, because another node publishes these topics."""
        self._stamped, self.outputs = [], {}

    def concerns(self) -> list[str]:
        """Texts about problems of the stage's outputs."""
        lost = f"{self.refused} steps wrote NaN or infinity; their outputs are not sent"
        return [lost] if self.refused else []

    def close(self) -> None:
        """Close all inputs."""
        for entry in self.all_inputs():
            entry.close()


def _heard(port: Topic, name: str, arm: str) -> Topic:
    """Topic that feeds a port, in the namespace of its own arm."""
    way, _, plain = port.name.partition("/")
    if port not in PORTS_BETWEEN_ARMS or not name.endswith(plain) or name.startswith(way):
        return replace(port, name=name).of_arm(arm)
    return replace(port, name=plain).of_arm(name.removesuffix(plain).strip("./"))


def _seen(port: Topic, name: str, arm: str) -> Topic:
    """As :func:`_heard`, with the rule of the feeding topic's stamps: a display shows the same frame several times.

    The trigger of a stage keeps its own rule, because a repeated stamp must not trigger a step.
    """
    found, feeding = _heard(port, name, arm), BY_NAME.get(name)
    return found if feeding is None else replace(found, stamp=feeding.stamp)


def _name_for(owner: Any, name: str) -> str:
    """Name of a topic for the middleware; ``../`` leaves the node's namespace."""
    if not name.startswith("../"):
        return name
    parent = owner.ros.resolve_topic_name("x").rpartition("/")[0].rpartition("/")[0]
    return f"{parent}/{name.removeprefix('../')}"


def _nothing(*_: object) -> Any:
    """Placeholder for feeds and publishers that are never used."""


NO_PORTS = Ports(None, "", Stage("none", NoParameters, (), ()), make_signals((), 0)[0], (), _nothing, _nothing)
"""Ports of a node that is not configured."""
