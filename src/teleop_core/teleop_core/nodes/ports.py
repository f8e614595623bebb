"""Ports: connect the topics that a node reads and writes to the fields of its stage's signals."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from teleop_core.bags.layouts import layout
from teleop_core.bags.messages import BUTTONS
from teleop_core.base.parameters import NoParameters
from teleop_core.graph.graph import BUILT_IN
from teleop_core.graph.signals import make_signals
from teleop_core.graph.stage import Stage
from teleop_core.graph.topics import BY_NAME, PORTS_BETWEEN_ARMS, Kind, Quality, Topic
from teleop_core.kernels import held, records
from teleop_core.kernels.fields import Cells, record
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.platform import Platform, Publisher
from teleop_core.nodes import wire
from teleop_core.nodes.feed import NO_BLOCK, Feed
from teleop_core.nodes.streams import READING, WRITING, Input, Output, Tap, calls_of, load

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
        self._platform: Platform | None = owner.platform if owner is not None else None
        self._must_check = stage.name not in BUILT_IN
        self.refused = 0
        """Number of steps whose outputs were not sent because they contained NaN or infinity."""
        self.waits = False
        """Whether messages stay in their buffers until :meth:`publish`; a session publishes after all its stages."""
        self.inputs: dict[str, list[Input]] = {}
        self.outputs: dict[Topic, Output] = {}
        self._summed: list[tuple[str, list[Array]]] = []
        self._base = np.asarray(signals).ctypes.data, signals.dtype.fields
        self._make_inputs(owner, signals, feeds, joint_names, buttons)
        self._make_outputs(owner, signals, publisher, joint_names)
        self._calls = calls_of(self._platform) if self._platform is not None else None
        self._feed: Feed | None = None
        # First input to read, and the port to leave out; first output to write, and the stamp of samples [ns].
        self._reading, self._writing = np.array((0, -1)), np.zeros(2, np.int64)
        self._times = np.zeros(2, np.int64)
        self._has_clock = self._calls is not None and bool(self._calls["clock"])
        self._send_all: Callable[[], object] = _nothing
        if self._calls is not None:
            self._bind(self._calls)

    def _make_inputs(
        self, owner: Any, signals: Any, feeds: Feeds, joint_names: tuple[str, ...], buttons: tuple[int, ...]
    ) -> None:
        given = {port: feeds(port.name) for port in self._stage.reads}
        self._read_records = records(READING, max(1, sum(map(len, given.values()))))
        self._entries: list[Input] = []
        for number, (port, found) in enumerate(given.items()):
            own, heard = signals[port.field], _heard if port == self._stage.trigger else _seen
            targets = [own] if len(found) == 1 else [own.copy() for _ in found]
            for (name, delay), target in zip(found, targets, strict=True):
                into = self._read_records[len(self._entries)]
                topic, full_name = heard(port, name, self._arm), _name_for(owner, name)
                self._entries.append(Input(owner, topic, full_name, joint_names, target, delay, buttons, into))
                into["port"] = number
                self._entries[-1].is_trigger = port == self._stage.trigger
            own_entries = self.inputs[port.name] = self._entries[-len(found) :]
            own_entries[0].own["stamp_at"] = self._place(f"{port.field}_ns")
            if len(targets) > 1:
                self._summed.append((port.field, targets))
        self._read_records = self._read_records[: len(self._entries)]
        self._numbers = {port.name: number for number, port in enumerate(given)}

    def _make_outputs(
        self, owner: Any, signals: Any, publisher: Callable[[Topic], Publisher], joint_names: tuple[str, ...]
    ) -> None:
        written = [topic for topic in self._stage.writes if topic.kind is not Kind.REPORT]
        self._write_records = records(WRITING, len(written))
        for topic, into in zip(written, self._write_records, strict=True):
            form = layout(topic.of_arm(self._arm), joint_names)
            self.outputs[topic.of_arm(self._arm)] = Output(
                owner, publisher(topic), form, signals[topic.field], topic.name, into
            )
            field = self._stamp_field(topic)
            into["stamp_at"] = self._place(field) if field else 0
            into["passes_on"] = bool(topic.stamp.of) and not topic.stamp.is_in_force
            into["is_seldom"], into["is_latched"] = topic.is_seldom, topic.quality is not Quality.STREAM
        self._sent = list(self.outputs.values())

    def _place(self, field: str) -> int:
        """Address of a field of the signals."""
        base, fields = self._base
        return int(base + fields[field][1])

    def _bind(self, calls: Any) -> None:
        """Bind the kernels to their records."""
        block = self._feed.block if self._feed is not None else NO_BLOCK
        self._read_all = held(wire.read_all, self._read_records, calls, self._reading)
        self._write_all = held(wire.write_all, self._write_records, calls, self._writing, self._times)
        self._are_sound = held(wire.are_sound, self._write_records, self._writing)
        self._send_all = held(wire.send_all, self._write_records, calls, block, self._writing)

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
        place, count = self._reading, len(self._entries)
        place[0], place[1] = 0, -1 if trigger is None else self._numbers[trigger.name]
        self._read_all()
        while (index := place.item(0)) < count:
            self._entries[index].finish()
            place[0] = index + 1
            self._read_all()
        self.add_up()

    def add_up(self) -> None:
        """Update the signals of ports that several topics feed."""
        for name, parts in self._summed:
            self.row[name] = np.sum(parts, axis=0)

    def send(self, now_ns: int) -> None:
        """Send the stage's outputs, each with the stamp that its topic declares.

        An output whose stamp was already sent is not a new answer and is not sent. Values of a user's stage that are
        not finite are not sent either.
        """
        place, count = self._writing, len(self._sent)
        if self._must_check:
            self._are_sound()
            if not place[0]:
                self.refused += 1
                return
        self._read_clocks()
        place[0], place[1] = 0, now_ns
        self._write_all()
        while (index := place.item(0)) < count:
            self.publish()  # a message of the same tick is still in the buffer
            place[0] = index
            self._write_all()
        if not self.waits:
            self.publish()

    def send_one(self, output: Output, stamp_ns: int) -> None:
        """Send the current values of one output with a stamp [ns], if :meth:`send` would."""
        if output.is_due(stamp_ns):
            self.send_now(output, stamp_ns)

    def send_now(self, output: Output, stamp_ns: int) -> None:
        """Send the current values of one output with a stamp [ns]."""
        assert self._platform is not None
        if output.is_pending:
            self.publish()
        output.write(stamp_ns, self._platform.monotonic_ns(), self._platform.time_ns())
        if not self.waits:
            self.publish()

    def publish(self) -> None:
        """Publish and record what is written."""
        place, count = self._writing, len(self._sent)
        place[0] = 0
        self._send_all()
        while (index := place.item(0)) < count:
            if self._sent[index].is_direct:
                assert self._feed is not None
                self._feed.spill()  # the recorder's block is full
            else:
                self._sent[index].publish()
            place[0] = index
            self._send_all()

    def _read_clocks(self) -> None:
        """Read the clocks for kernels that cannot read them."""
        if not self._has_clock and self._platform is not None:
            self._times[:] = self._platform.monotonic_ns(), self._platform.time_ns()

    def connect(self, taps: Mapping[str, Tap], feed: Feed | None) -> None:
        """Give the bytes of all messages to the recorder.

        Args:
            taps: Receivers of the messages, by the name of the topic; topics without one are only published.
            feed: Feed of the loop to the recorder, to which its channels in ``taps`` belong.
        """
        self._feed = feed
        for topic, output in self.outputs.items():
            output.connect(taps.get(topic.name))
        if self._calls is not None:
            self._bind(self._calls)

    def mute(self) -> None:
        """Send nothing from now on, because another node publishes these topics."""
        for output in self.outputs.values():
            output.close()
        self.outputs, self._sent = {}, []
        self._write_records = self._write_records[:0]
        if self._calls is not None:
            self._bind(self._calls)

    def concerns(self) -> list[str]:
        """Texts about problems of the stage's outputs."""
        lost = f"{self.refused} steps wrote NaN or infinity; their outputs are not sent"
        return [lost] if self.refused else []

    def close(self) -> None:
        """Close all inputs and outputs."""
        for entry in self.all_inputs():
            entry.close()
        for output in self.outputs.values():
            output.close()


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


def load_all() -> None:
    """Load all kernels that take, read, write and send the messages of nodes; they serve every graph."""
    load()
    own, written, calls = records(READING, 1), records(WRITING, 1), record(wire.Calls)
    words, given = np.zeros(2, np.int64), np.zeros(6, np.int64)
    held(wire.take_raw, np.zeros((1, 1), np.int64), calls, words)
    for kernel in (wire.answer_take, wire.answer_newest):
        held(kernel, own[0], calls)
    for judge in (wire.look, wire.answer_accept):
        held(judge, own[0], given)
    held(wire.read_all, own, calls, words)
    held(wire.write_all, written, calls, words, words)
    held(wire.are_sound, written, words)
    held(wire.send_all, written, calls, NO_BLOCK, words)
