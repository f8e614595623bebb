"""Streams: transfer raw messages to and from the signals of a stage, without executor and conversion.

A message with exactly the layout of this package's nodes is decoded at fixed positions. Any other message of the type
(another frame, other names, another order) is deserialised and read by name. Both give the same values.
"""

from collections import Counter, deque
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from teleop_core.bags import messages
from teleop_core.base.errors import MessageTypeError
from teleop_core.graph.topics import NO_COMMAND_NS, Kind, Topic
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.world import Owner, Publisher, Taken
from teleop_core.nodes.quality import NO_OVERRIDES, QualityOverrides
from teleop_core.nodes.quality import profile as profile  # noqa: PLC0414  for importers of both
from teleop_core.nodes.sender import Sender

SILENCE_NS = 2_000_000_000
"""After this time without a valid message, a sender may restart with any stamp [ns]."""
_WAITING = 20
"""Smallest queue length for a late reader [messages]. A longer queue is used if a late sender may catch up more ticks
than this in one wake-up."""
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
        self.wait: Callable[[float], None] = own.wait
        """Wait for a message, at most for some time [s]."""
        self.close: Callable[[], None] = own.close
        """Stop listening."""


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

    Attributes:
        stamp_ns: Stamp of the newest valid message; None before the first.
        arrival_ns: Monotonic time at which that message was read [ns].
        received: Number of messages read, valid or not.
        refused: Number of invalid messages, by reason.
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
    ) -> None:
        self.topic, self._owner, self._name = topic, owner, name
        self._world, options = owner.world, getattr(owner, "options", None)
        burst = options.max_catch_up if options is not None else 0
        self._waiting = max(_PRESSES if topic.kind is Kind.BUTTONS else _WAITING, burst)
        self.subscription: Subscription | None = Subscription(owner, topic, name, self._waiting)
        self._is_new = False
        self._joint_names, self._target = topic.names(joint_names), target
        is_report = topic.kind is Kind.REPORT
        self._layout = None if is_report else messages.layout(topic, joint_names)
        self._buttons = buttons
        self._has_own_order = topic.kind is not Kind.BUTTONS or buttons == messages.BUTTONS
        messages.read_reports(messages.report(0, "", 0, "", {}))  # loads the message types, which takes 60 ms
        self._delay_ns = round(delay * 1e9)
        self._held: deque[tuple[int, int, messages.Values]] = deque()
        self.received, self.refused = 0, Counter[messages.Refusal]()
        self.sender = options.sender() if options is not None else Sender()
        self._is_fault = options is not None and options.second_publisher == "fault"
        self.stamp_ns: int | None = None
        self.arrival_ns = 0

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
        if self._delay_ns:
            return self._take_held()
        if self.subscription is None:
            is_new, self._is_new = self._is_new, False
            return is_new
        while (found := self._next()) is not None:
            if self._accept(*found):
                return True
        return False

    def newest(self) -> bool:
        """Write the newest valid message into the signals; return whether there was one.

        For buttons, the first message that presses or releases a button is written, so that no press is missed.
        """
        has_buttons = self.topic.kind is Kind.BUTTONS
        before = self._target.tobytes() if has_buttons else b""
        is_new = self.take()
        if is_new and (self.subscription is not None or self._delay_ns):
            while not (has_buttons and self._target.tobytes() != before) and self.take():
                pass
        return is_new

    def _next(self) -> tuple[int, messages.Values] | None:
        """Next message of the subscription that can be read."""
        while self.subscription is not None and (taken := self.subscription.take()) is not None:
            self.received += 1
            if reason := self.sender.admit(taken.sender, taken.number, self._world.monotonic_ns()):
                self.refused[reason] += 1
                continue
            known = None
            if self._layout is not None and self._has_own_order:
                known = self._layout.decode_one(taken.data)
            found = known or self._read(taken.data)
            if not isinstance(found, messages.Refusal):
                return found
            self.refused[found] += 1
        return None

    def _take_held(self) -> bool:
        """Write the next valid delayed message that is due into the signals; return whether there was one."""
        while (found := self._next()) is not None:
            self._held.append((self._world.monotonic_ns() + self._delay_ns, *found))
        now_ns = self._world.monotonic_ns()
        while self._held and self._held[0][0] <= now_ns:
            _, stamp_ns, values = self._held.popleft()
            if self._accept(stamp_ns, values):
                return True
        return False

    def _accept(self, stamp_ns: int, values: messages.Values) -> bool:
        now_ns, last_ns = self._world.monotonic_ns(), self.stamp_ns
        may_repeat = self.topic.stamp.is_in_force or self._layout is None
        if now_ns - self.arrival_ns > SILENCE_NS or (may_repeat and stamp_ns <= NO_COMMAND_NS):
            last_ns = None
        elif may_repeat and last_ns is not None:
            last_ns -= 1
        reason = messages.check(self.topic.kind, stamp_ns, values, last_ns)
        if reason is not None:
            self.refused[reason] += 1
            if reason is messages.Refusal.NOT_NEWER and last_ns is not None:
                self.sender.note_old(stamp_ns, last_ns)
            return False
        if may_repeat:
            self.sender.fault = None
        else:
            self.sender.note_stamp(stamp_ns, self._world.time_ns())
        self._target[:] = values
        self.stamp_ns, self.arrival_ns = stamp_ns, now_ns
        return True

    def _read(self, data: bytes) -> tuple[int, messages.Values] | messages.Refusal:
        """Stamp and values of a message with another layout than this package's, or of a report."""
        if self._layout is None:
            return messages.read_numbers(data, self.topic.columns)
        return messages.read_any(self.topic.kind, data, self._joint_names, self._buttons)

    def age(self) -> float:
        """Time since the last valid message was read [s]; infinite before the first."""
        if self.stamp_ns is None:
            return float("inf")
        return (self._world.monotonic_ns() - self.arrival_ns) * 1e-9

    def forget(self) -> None:
        """Discard the queue and restart: the next message may have any stamp."""
        while self.subscription is not None and self.subscription.take() is not None:
            pass
        self._held.clear()
        self.sender.forget()
        self._is_new = False
        self.stamp_ns = None
        self.arrival_ns = 0

    def zero(self) -> None:
        """Overwrite the newest values with zeros, for example for a force that ended."""
        self._target[:] = 0.0

    def publishers(self) -> int:
        """Current number of publishers of the topic."""
        return self._owner.ros.count_publishers(self._name)

    # -- within a process that holds the sender too ----------------------------------------------

    def join(self, is_inside: bool) -> None:
        """Receive values only from :meth:`give` if ``is_inside``, otherwise only from the topic."""
        if is_inside and self.subscription is not None:
            self.close()
        elif not is_inside and self.subscription is None:
            self.subscription = Subscription(self._owner, self.topic, self._name, self._waiting)

    def give(self, stamp_ns: int, values: messages.Values) -> None:
        """Receive a valid sample from a sender in this process."""
        self.received += 1
        if self._delay_ns:
            self._held.append((self._world.monotonic_ns() + self._delay_ns, stamp_ns, values.copy()))
            return
        self._target[:] = values
        self.stamp_ns, self.arrival_ns = stamp_ns, self._world.monotonic_ns()
        self._is_new = True

    def close(self) -> None:
        """Stop listening to the topic."""
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

    Attributes:
        sent: Number of sent messages.
        inputs: Readers of the topic in this process, which get the values directly.
        tap: Function that is called with the bytes of every message and the time of sending [ns]; it replaces a
            subscription in this process.
        pending: Queue of messages that the session will :meth:`publish`; None to publish at once.
    """

    def __init__(
        self, owner: Owner, publisher: Publisher, form: messages.Layout, source: Array, name: str = ""
    ) -> None:
        self.name, self._time_ns, self._send = name, owner.world.time_ns, publisher.send
        self._encode, self._source = form.encode_one, source
        self.sent = 0
        self.inputs: list[Input] = []
        self.tap: Callable[[bytes, int], None] | None = None
        self.pending: list[tuple[Output, bytes, int]] | None = None

    def send(self, stamp_ns: int) -> None:
        """Send the current values with a stamp [ns], first to the readers in this process."""
        for entry in self.inputs:
            entry.give(stamp_ns, self._source)
        data = self._encode(stamp_ns, self._source)  # the next sample may be of the same tick
        if self.pending is None:
            self.publish(data, 0 if self.tap is None else self._time_ns())
        else:
            self.pending.append((self, data, self._time_ns()))

    def publish(self, data: bytes, sent_ns: int) -> None:
        """Publish a message that was already sent within the process at ``sent_ns`` [ns]."""
        self._send(data)
        if self.tap is not None:
            self.tap(data, sent_ns)
        self.sent += 1

    def bits(self) -> bytes:
        """The current values as bytes, for comparison."""
        return self._source.tobytes()

    def is_sound(self) -> bool:
        """Whether the current values are finite."""
        return bool(np.isfinite(self._source).all())
