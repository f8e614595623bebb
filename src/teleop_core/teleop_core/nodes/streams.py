"""Streams: transfer raw messages to and from the signals of a stage, without executor and conversion.

A message with exactly the layout of this package's nodes is decoded at fixed positions, by the kernels of
:mod:`teleop_core.nodes.wire`. Any other message of the type (another frame, other names, another order) is
deserialised and read by name. Both give the same values.
"""

from collections import Counter, deque
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from importlib import import_module
from typing import Any, Protocol, runtime_checkable

import numpy as np

from teleop_core.bags import messages
from teleop_core.base.errors import MessageTypeError
from teleop_core.graph.topics import Kind, Topic
from teleop_core.kernels import held, record_dtype, records
from teleop_core.kernels.fields import Cells, Integers, fields_of, record
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.memory import integers, octets
from teleop_core.middleware.platform import Owner, Platform, Publisher, Taken, Taker
from teleop_core.nodes import wire
from teleop_core.nodes.feed import Channel
from teleop_core.nodes.quality import NO_OVERRIDES, QualityOverrides
from teleop_core.nodes.quality import profile as profile  # noqa: PLC0414  for importers of both
from teleop_core.nodes.sender import Sender, halves

_WAITING = 20
"""Smallest queue length for a late reader [messages]. A longer queue is used if a late sender may catch up more ticks
than this in one wake-up."""
_SPARE = 64
"""A message of the known form may be longer by so many bytes of padding [bytes]."""
_PRESSES = 500
"""Queue length for buttons [messages]: a press is not lost even if the reader reads nothing for half a second."""


def message_type(ros_type: str) -> Any:
    """Class of a message, from a name like ``sensor_msgs/msg/JointState``.

    Raises:
        MessageTypeError: The package of the message is not installed.
        AttributeError: The package has no such message.
    """
    package, _, name = ros_type.split("/")
    try:
        module = import_module(f"{package}.msg")
    except ModuleNotFoundError as error:
        raise MessageTypeError(ros_type, package) from error
    return getattr(module, name)


class Subscription:
    """Subscription to a topic of the graph whose messages are read without an executor.

    Args:
        owner: Node that owns it.
        topic: Topic of the subscription.
        name: Name of the topic for the middleware.
        depth: Length of the queue; None for the topic's own.

    Attributes:
        topic: As given.
        type: Class of its messages.
    """

    def __init__(self, owner: Owner, topic: Topic, name: str, depth: int | None = None) -> None:
        self.topic, self._owner = topic, owner
        overrides: QualityOverrides = getattr(owner, "overrides", NO_OVERRIDES)
        wanted = profile(topic, depth, "subscription")
        wanted = overrides.apply(owner.ros.resolve_topic_name(name), "subscription", wanted)
        self.type = message_type(topic.ros_type)
        own = owner.ros.create_taker(self.type, name, wanted)
        self.take: Callable[[], Taken | None] = own.take
        """Return the oldest queued message; None if the queue is empty."""
        self.places: tuple[int, int, int] | None = getattr(own, "places", None)
        """Addresses for kernels that take messages themselves; see :class:`RosTaker`; None in other worlds."""
        self.wait: Callable[[float], None] = own.wait
        """Wait for a message, at most for some time [s]."""
        self.close: Callable[[], None] = own.close
        """Stop listening."""


READING, WRITING = (record_dtype(fields_of(kind)) for kind in (wire.Reading, wire.Writing))
"""Types of the records of an input and of an output."""


def describe(cells: Cells, form: messages.Layout) -> None:
    """Write the form of a stream's messages into the record of an input or output."""
    cells["has_form"], cells["is_pose"] = 1, form.kind is Kind.POSE
    cells["is_whole"], cells["width"], cells["size"] = form.kind is Kind.BUTTONS, form.width, form.size
    cells["template_at"], cells["mask_at"] = form.template.ctypes.data, form.mask.ctypes.data
    cells["places_at"] = form.places.ctypes.data


@cache
def load() -> None:
    """Load the kernels that Python calls one by one, which takes ms at their first call."""
    reading, writing = (records(kind)[0] for kind in (READING, WRITING))
    sender, row = Sender(into=reading), np.zeros(1)
    for cells in map(Cells, (reading, writing)):
        for name in ("template_at", "mask_at", "places_at"):
            cells[name] = row.ctypes.data
    for name in ("target_at", "row_at"):
        reading[name] = row.ctypes.data
    for name in ("source_at", "kept_at", "readers_at"):
        writing[name] = row.ctypes.data
    sender.note_old(0, 0)
    wire.is_due(writing, 0)
    buffer = np.zeros(16, np.uint8)
    writing["buffer_at"], writing["size"] = buffer.ctypes.data, len(buffer)
    wire.write_one(writing, 0, 0, 0)


def calls_of(platform: Platform) -> wire.Calls:
    """C functions of a platform for the kernels of its nodes."""
    own = record(wire.Calls)
    for name, address in platform.functions().items():
        own[name] = address
    return own


class RareTakers:
    """Subscriptions that seldom have a message, so that a look at all of them must cost little.

    Args:
        platform: Platform of the subscriptions.
        own: The subscriptions.
    """

    def __init__(self, platform: Platform, own: Sequence[Taker]) -> None:
        self._own, self._count = own, np.zeros(1, np.int64)
        found = [getattr(taker, "places", None) for taker in own]
        self._look: Callable[[], None] | None = None
        if all(places is not None for places in found):
            self._look = held(wire.take_raw, np.array(found, np.int64), calls_of(platform), self._count)

    def next(self, count: int) -> tuple[int, Taken] | None:
        """Index of one of the first ``count`` subscriptions, and its oldest message; None if none has a message."""
        if self._look is None:
            for index, taker in enumerate(self._own[:count]):
                if (taken := taker.take()) is not None:
                    return index, taken
            return None
        self._count[0] = count
        self._look()
        index = self._count.item()
        if index == count:
            return None
        own: Any = self._own[index]
        return index, own.taken()


class Input:
    """Newest valid message of one topic, for a port of a stage.

    Args:
        owner: Node that owns it.
        topic: Topic of the input, in its namespace.
        name: Name of the topic for the middleware, below the node's namespace.
        joint_names: Order of the joints in the signals.
        target: Array into which the values are written, shape (width,).
        delay: Time for which each message is delayed, as on a slow link [s].
        buttons: Indices of clutch, fixture and mode among a message's buttons; -1 if the message lacks a button.
        into: Record of :class:`~teleop_core.nodes.wire.Reading` for the input; None for a record of its own.

    Attributes:
        own: The record.
        sender: Data about the sender of the messages.
    """

    def __init__(
        self,
        owner: Owner,
        topic: Topic,
        name: str,
        joint_names: tuple[str, ...],
        target: Array,
        delay: float = 0.0,
        buttons: tuple[int, ...] = messages.BUTTONS,
        into: Any = None,
    ) -> None:
        self.topic, self._owner, self._name = topic, owner, name
        self._platform, options = owner.platform, getattr(owner, "options", None)
        burst = options.max_catch_up if options is not None else 0
        self._waiting = max(_PRESSES if topic.kind is Kind.BUTTONS else _WAITING, burst)
        self._joint_names, self._target, self._row = topic.names(joint_names), target, np.zeros(len(target))
        is_report = topic.kind is Kind.REPORT
        self._layout = None if is_report else messages.layout(topic, joint_names)
        self._buttons = buttons
        messages.read_reports(messages.report(0, "", 0, "", {}))  # loads the message types, which takes 60 ms
        self._delay_ns = round(delay * 1e9)
        self._held: deque[tuple[int, int, messages.Values]] = deque()
        own = records(READING)[0] if into is None else into
        self.sender = options.sender(own) if options is not None else Sender(into=own)
        self._is_fault = options is not None and options.second_publisher == "fault"
        self.own, self._cells = own, Cells(own)
        load()
        self._describe()
        self._bytes = bytearray(self._cells["size"] + _SPARE)
        self._bytes_at = np.frombuffer(self._bytes, np.uint8).ctypes.data
        calls = calls_of(self._platform)
        kernels = wire.answer_take, wire.answer_newest
        self._take, self._newest = (held(kernel, own, calls) for kernel in kernels)
        given = np.zeros(6, np.int64)
        self._given = given.data  # faster to set than the array
        self._look, self._judge = (held(kernel, own, given) for kernel in (wire.look, wire.answer_accept))
        self._needs_python, self._answer = self._cells.number("needs_python"), self._cells.number("answer")
        self._has_stamp, self._stamp_ns = self._cells.number("has_stamp"), self._cells.number("stamp_ns")
        self.is_trigger = False
        """Whether each message of the topic is a step of the stage."""
        self.subscription: Subscription | None = None
        self._is_inside = False
        self._listen()

    def _describe(self) -> None:
        cells, topic = self._cells, self.topic
        if self._layout is not None and (topic.kind is not Kind.BUTTONS or self._buttons == messages.BUTTONS):
            describe(cells, self._layout)
        cells["width"], cells["is_pose"] = len(self._row), topic.kind is Kind.POSE
        cells["target_at"], cells["row_at"] = self._target.ctypes.data, self._row.ctypes.data
        cells["is_buttons"] = self._is_buttons = topic.kind is Kind.BUTTONS
        cells["may_repeat"] = topic.stamp.is_in_force or self._layout is None

    def _listen(self) -> None:
        """Open the subscription."""
        self.subscription = Subscription(self._owner, self.topic, self._name, self._waiting)
        places = self.subscription.places
        if places is not None:
            self._cells["reader"], self._cells["message_at"], self._cells["info_at"] = places
        self._cells["needs_python"] = places is None or bool(self._delay_ns)

    @property
    def stamp_ns(self) -> int | None:
        """Stamp of the newest valid message; None before the first."""
        return int(self._stamp_ns[0]) if self._has_stamp[0] else None

    @property
    def received(self) -> int:
        """Number of messages read, valid or not."""
        return int(self._cells["received"])

    @property
    def refused(self) -> Counter[messages.Refusal]:
        """Number of invalid messages, by reason."""
        counts = self._cells["refused"].tolist()
        return Counter({reason: count for reason, count in zip(wire.REASONS, counts, strict=False) if count})

    @property
    def conflict(self) -> bool:
        """Whether a second publisher sent a message although this is a fault; reset by :meth:`forget`."""
        return self._is_fault and self.sender.conflict

    @property
    def delay(self) -> float:
        """Time for which each message is delayed [s]."""
        return self._delay_ns * 1e-9

    def take(self) -> bool:
        """Write the next valid message in the queue into the signals; return whether there was one."""
        if self._needs_python[0]:
            return self._take_held() if self._delay_ns else self._take_in_python()
        self._take()
        while (answer := self._answer[0]) == wire.FOREIGN:
            if self._take_foreign():
                return True
            self._take()
        return bool(answer == wire.NEW)

    def newest(self) -> bool:
        """Write the newest valid message into the signals; return whether there was one.

        For buttons, the first message that presses or releases a button is written, so that no press is missed.
        """
        before = self._pressed() if self._is_buttons else b""
        if self._needs_python[0]:
            return self.take() and self._newest_after(True, before)
        self._newest()
        answer = self._cells["answer"]
        return self._newest_after_foreign() if answer == wire.FOREIGN else bool(answer == wire.NEW)

    def finish(self) -> None:
        """Read the newest message for :func:`~teleop_core.nodes.wire.read_all`, which needs Python for it."""
        if self._needs_python[0]:
            self.newest()
        else:
            self._newest_after_foreign()
        if self._has_stamp[0] and len(self._stamp):
            self._stamp[0] = self._stamp_ns[0]

    @cached_property
    def _stamp(self) -> Integers:
        """Stamp in the signals of a stage; empty if they have none."""
        at = self._cells["stamp_at"]
        return integers(at, 1) if at else np.zeros(0, np.int64)

    def _newest_after_foreign(self) -> bool:
        """As :meth:`newest`, after a kernel has found a message of another form."""
        before, has_found = self._pressed(), bool(self._cells["has_found"])
        return self._newest_after(self._take_foreign() or self.take(), before) or has_found

    def _newest_after(self, is_new: bool, before: bytes) -> bool:
        """Write the newest message into the signals, after the first one was written if ``is_new``."""
        if is_new and (self.subscription is not None or self._delay_ns):
            while self._pressed() == before and self.take():
                pass
        return is_new

    def _pressed(self) -> bytes:
        """State of the buttons; empty for an input without buttons."""
        return self._target.tobytes() if self._is_buttons else b""

    # -- in Python: what is rare, and everything on a platform whose middleware kernels cannot reach -----

    def _take_in_python(self) -> bool:
        assert self.subscription is not None
        while (taken := self.subscription.take()) is not None:
            if (found := self._admitted(taken)) is not None and self._accept(*found):
                return True
        return False

    def _take_foreign(self) -> bool:
        """Accept the message of another form that a kernel has taken."""
        at, length = integers(self._cells["message_at"], 2).tolist()
        found = self._read(octets(at, length).tobytes())
        if isinstance(found, messages.Refusal):
            self._refuse(found)
            return False
        return self._accept(*found)

    def _admitted(self, taken: Taken) -> tuple[int, messages.Values] | None:
        """Stamp and values of a message; None if it was refused."""
        data, sender, number, _, _ = taken
        given, size = self._given, len(data)
        if size > len(self._bytes):
            size = 0  # another form
        self._bytes[:size] = data[:size]
        given[0], given[1] = halves(sender)
        given[2], given[3], given[4], given[5] = number, self._platform.monotonic_ns(), self._bytes_at, size
        self._look()
        answer = self._answer[0]
        if answer != wire.FOREIGN:
            return (given[0], self._row) if answer == wire.NEW else None
        found = self._read(data)
        if isinstance(found, messages.Refusal):
            self._refuse(found)
            return None
        return found

    def _take_held(self) -> bool:
        """Write the next valid delayed message that is due into the signals; return whether there was one."""
        while self.subscription is not None and (taken := self.subscription.take()) is not None:
            if (found := self._admitted(taken)) is not None:
                self._held.append((self._platform.monotonic_ns() + self._delay_ns, found[0], found[1].copy()))
        now_ns = self._platform.monotonic_ns()
        while self._held and self._held[0][0] <= now_ns:
            _, stamp_ns, values = self._held.popleft()
            if self._accept(stamp_ns, values):
                return True
        return False

    def _accept(self, stamp_ns: int, values: messages.Values) -> bool:
        if values is not self._row:
            self._row[:] = values
        given, platform = self._given, self._platform
        given[0], given[1], given[2] = stamp_ns, platform.monotonic_ns(), platform.time_ns()
        self._judge()
        return bool(self._answer[0])

    def _refuse(self, reason: messages.Refusal) -> None:
        self._cells["refused"][wire.REASONS.index(reason)] += 1

    def _read(self, data: bytes) -> tuple[int, messages.Values] | messages.Refusal:
        """Stamp and values of a message with another layout than this package's, or of a report."""
        if self._layout is None:
            return messages.read_numbers(data, self.topic.columns)
        return messages.read_any(self.topic.kind, data, self._joint_names, self._buttons)

    def age(self) -> float:
        """Time since the last valid message was read [s]; infinite before the first."""
        if not self._has_stamp[0]:
            return float("inf")
        return float((self._platform.monotonic_ns() - self._cells["arrival_ns"]) * 1e-9)

    def forget(self) -> None:
        """Discard the queue and restart: the next message may have any stamp."""
        while self.subscription is not None and self.subscription.take() is not None:
            pass
        self._held.clear()
        self.sender.forget()
        for name in ("is_new", "has_stamp", "stamp_ns", "arrival_ns"):
            self._cells[name] = 0

    def zero(self) -> None:
        """Overwrite the newest values with zeros, for example for a force that ended."""
        self._target[:] = 0.0

    def publishers(self) -> int:
        """Current number of publishers of the topic."""
        return self._owner.ros.count_publishers(self._name)

    # -- within a process that holds the sender too ----------------------------------------------

    def join(self, is_inside: bool) -> None:
        """Receive values only from a sender in this process if ``is_inside``, otherwise only from the topic."""
        if is_inside and self.subscription is not None:
            self.close()
            self._is_inside = True
        elif not is_inside and self._is_inside:
            self._listen()
            self._is_inside = False

    @property
    def place(self) -> tuple[int, int, int]:
        """Addresses at which a sender in this process writes.

        Of the values, of five fields from ``received``, and of the stamp in the signals of a stage that has its own
        clock; 0 for the trigger of a stage, whose stamp changes with each answer.
        """
        received: Any = np.asarray(self.own)["received"]
        return self._target.ctypes.data, received.ctypes.data, 0 if self.is_trigger else self._cells["stamp_at"]

    def hold(self, stamp_ns: int, values: messages.Values) -> None:
        """Receive a sample of a sender in this process, on a link with a delay."""
        self._cells["received"] += 1
        self._held.append((self._platform.monotonic_ns() + self._delay_ns, stamp_ns, values.copy()))

    def close(self) -> None:
        """Stop listening to the topic."""
        self._cells["reader"], self._cells["needs_python"] = 0, bool(self._delay_ns)
        if self.subscription is not None:
            self.subscription.close()
            self.subscription = None


class Output:
    """Publisher of one topic from the signals of a stage.

    Args:
        owner: Node that owns it.
        publisher: Publisher of the bytes.
        form: Layout of the messages.
        source: Array with the values, shape (width,).
        name: Name of the topic, below the node's namespace.
        into: Record of :class:`~teleop_core.nodes.wire.Writing` for the output; None for a record of its own.

    Attributes:
        own: The record.
        name: As given.
    """

    def __init__(
        self, owner: Owner, publisher: Publisher, form: messages.Layout, source: Array, name: str = "", into: Any = None
    ) -> None:
        self.name, self._publisher, self._source = name, publisher, source
        self.own = records(WRITING)[0] if into is None else into
        self._cells, self._held = Cells(self.own), list[Input]()
        describe(self._cells, form)
        self._buffer, self._kept = np.array(form.template), np.zeros(form.width)
        self._message = np.zeros(8, np.int64)  # rcutils_uint8_array_t: buffer, length, capacity, allocator
        self._message[:3] = self._buffer.ctypes.data, form.size, form.size
        self._readers = np.zeros(1, np.int64)
        self._cells["source_at"], self._cells["buffer_at"] = source.ctypes.data, self._buffer.ctypes.data
        self._cells["kept_at"], self._cells["message_at"] = self._kept.ctypes.data, self._message.ctypes.data
        self._cells["readers_at"] = self._readers.ctypes.data
        self._pending, self._pending_ns = self._cells.number("is_pending"), self._cells.number("pending_ns")
        self._sent, self._writer = self._cells.number("sent"), self._cells.number("writer")
        self._tap: Tap | None = None
        self._is_kept = isinstance(publisher, Kept)
        if isinstance(publisher, Kept):
            publisher.hold()
        self.connect(None)

    @property
    def sent(self) -> int:
        """Number of sent messages."""
        return int(self._cells["sent"])

    @property
    def data(self) -> bytes:
        """Bytes of the newest message, without padding."""
        return self._buffer.tobytes()

    @property
    def is_pending(self) -> bool:
        """Whether a written message is still to be sent."""
        return bool(self._pending[0])

    @property
    def is_direct(self) -> bool:
        """Whether kernels send the messages."""
        return bool(self._writer[0])

    @property
    def is_silent(self) -> bool:
        """Whether nothing is written; can be set."""
        return bool(self._cells["is_silent"])

    @is_silent.setter
    def is_silent(self, value: bool) -> None:
        self._cells["is_silent"] = value

    def is_due(self, stamp_ns: int) -> bool:
        """Whether values with a stamp [ns] are to be sent; see :func:`~teleop_core.nodes.wire.write_all`."""
        return bool(wire.is_due(self.own, stamp_ns))

    def write(self, stamp_ns: int, now_ns: int, time_ns: int) -> None:
        """Write the present values into the buffer, as :func:`~teleop_core.nodes.wire.write_one`."""
        wire.write_one(self.own, stamp_ns, now_ns, time_ns)

    def serve(self, inputs: Sequence[Input]) -> None:
        """Pass the values of each message to readers in this process."""
        self._held = [entry for entry in inputs if entry.delay]
        places = [entry.place for entry in inputs if not entry.delay]
        self._readers = np.array(places or [(0, 0, 0)], np.int64).ravel()
        self._cells["readers_at"], self._cells["readers"] = self._readers.ctypes.data, len(places)

    def connect(self, tap: "Tap | None") -> None:
        """Give the bytes of each message to the recorder, or to nobody; this replaces a subscription in this process.

        Kernels publish and feed by themselves if they can reach both the middleware and the recorder's block.
        """
        if isinstance(self._tap, Channel) and self._cells["writer"]:
            self._tap.number = self._cells["fed"]
        self._tap, is_fed = tap, isinstance(tap, Channel)
        is_reached = isinstance(self._publisher, Kept) and not self._held and (tap is None or is_fed)
        self._cells["writer"] = self._publisher.pointer if is_reached and isinstance(self._publisher, Kept) else 0
        self._cells["is_fed"] = is_fed
        if isinstance(tap, Channel):
            self._cells["fed_index"], self._cells["fed"] = tap.index, tap.number

    def close(self) -> None:
        """Send nothing from now on."""
        self._cells["is_silent"], self._cells["writer"], self._cells["is_pending"] = 1, 0, 0
        if self._is_kept and isinstance(self._publisher, Kept):
            self._publisher.release()
        self._is_kept = False

    def publish(self) -> None:
        """Send the message in the buffer in Python, if it is still to be sent."""
        if not self._pending[0]:
            return
        for entry in self._held:
            stamp = self._buffer[4:12].view(np.uint32).tolist()
            entry.hold(stamp[0] * wire.SECOND_NS + stamp[1], self._source)
        data, sent_ns = self._buffer.tobytes(), self._pending_ns[0]
        self._publisher.send(data)
        if self._tap is not None:
            self._tap.give(data, sent_ns)
        self._pending[0] = 0
        self._sent[0] += 1


@runtime_checkable
class Kept(Protocol):
    """Publisher that kernels can reach."""

    @property
    def pointer(self) -> int:
        """Address of the publisher; 0 while it sends nothing."""

    def hold(self) -> None:
        """Keep the publisher in memory until :meth:`release`."""

    def release(self) -> None:
        """Let the publisher be destroyed."""


class Tap(Protocol):
    """Receiver of the bytes of all messages of a topic in this process."""

    def give(self, data: bytes, sent_ns: int) -> None:
        """Receive a message that was sent at a time [ns]."""
