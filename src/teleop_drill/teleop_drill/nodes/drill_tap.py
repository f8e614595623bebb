"""Tap of a drill: one thread that publishes the drill's hand and receives the messages of the slave."""

import struct
from array import array
from collections.abc import Callable

import numpy as np

from teleop_core.bags.messages import SECOND_NS, Layout, Refusal, Values, layout, read_any, read_numbers
from teleop_core.graph.layers import RealTimeParameters
from teleop_core.graph.topics import (
    MASTER_BUTTONS,
    MASTER_MEASURED_CP,
    NO_COMMAND_NS,
    SLAVE_MEASURED_CP,
    SLAVE_MEASURED_JS,
    SLAVE_OPERATION,
    SLAVE_SETPOINT_JS,
    SLAVE_TRUE_CP,
    TELEOP_STATE,
    Topic,
)
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.platform import Owner
from teleop_core.nodes.streams import Subscription, message_type, profile
from teleop_drill.drill import hand
from teleop_drill.drill.hand import Distortion, Sample
from teleop_drill.drill.measure import Trace
from teleop_drill.drill.numbers import Scheduling
from teleop_drill.drill.recordings import Counted

STREAMS_HEARD = (SLAVE_SETPOINT_JS, SLAVE_MEASURED_JS, SLAVE_MEASURED_CP, SLAVE_TRUE_CP)
"""Streams that the tap receives and that are compared with the recording."""
_HEARD = (*STREAMS_HEARD, SLAVE_OPERATION, TELEOP_STATE)
_STAMP = struct.Struct("<iI")
_DAY_NS = 86_400 * SECOND_NS
_STAMP_AT = 4  # position of the stamp in a message, after the encapsulation [bytes]
_QUEUE = 4000
_BUTTONS_EVERY = 5
_FAR_BEHIND = 0.1
Heard = list[tuple[int, int, bytes]]


class Tap:
    """Receives the messages of the slave, and moves the hand if the tap is the master; runs until :meth:`close`.

    Args:
        owner: Node that owns the tap's topics; no executor serves this node.
        joint_names: Joint names of the slave.
        real_time: Priority and other settings of the tap's thread.
        has_hand: Whether the tap is the master.

    Attributes:
        distortion: Distortion of the hand's samples.
        is_mute: Whether the tap sends no buttons.
    """

    def __init__(
        self, owner: Owner, joint_names: tuple[str, ...], real_time: RealTimeParameters, *, has_hand: bool
    ) -> None:
        self._real_time, self._platform = real_time, owner.platform
        self.distortion: Distortion = hand.faithful
        self.is_mute, self._joint_names = False, joint_names
        self._heard: dict[str, Heard] = {topic.name: [] for topic in _HEARD}
        self._counted = {topic.name: (array("q"), array("q")) for topic in STREAMS_HEARD}
        self._late: list[tuple[int, float]] = []
        self._listened_ns = 0  # time at which the tap last began to take waiting messages
        self._subscriptions = [Subscription(owner, t, f"/{t.name}", _QUEUE) for t in _HEARD]
        self._hand = _Hand(owner, self) if has_hand else None
        self._is_running, self._lock = True, self._platform.lock()
        self._thread = self._platform.thread("tap", self._run)
        self._thread.start()

    def close(self) -> None:
        """Stop the thread, and close all topics."""
        self._is_running = False
        self._thread.join()
        for subscription in self._subscriptions:
            subscription.close()

    def clear(self) -> None:
        """Delete all stored messages, except the last message of topics that are published only at changes."""
        with self._lock:
            self._late.clear()
            for topic in _HEARD:
                keep = -1 if topic in {SLAVE_OPERATION, TELEOP_STATE} else -400
                self._heard[topic.name] = self._heard[topic.name][keep:]

    def traces(self, *topics: Topic) -> list[Trace]:
        """Messages of all streams, all up to the same moment.

        On a busy machine, decoding thousands of messages takes a tenth of a second. Without a common end, the stream
        that is decoded first would seem to be silent.
        """
        with self._lock:
            heard = [list(self._heard[topic.name]) for topic in topics]
            until_ns = self._listened_ns
        return [self._trace(*both, until_ns) for both in zip(topics, heard, strict=True)]

    def _trace(self, topic: Topic, heard: Heard, until_ns: int) -> Trace:
        form = layout(topic, self._joint_names)
        heard = [one for one in heard if one[0] < until_ns]
        found = [(sent, number, self._read(topic, form, data)) for sent, number, data in heard]
        sound = [(s, number, one) for s, number, one in found if not isinstance(one, Refusal)]
        rows = [values for *_, (_, values) in sound]
        return Trace(
            np.array([sent for sent, *_ in sound], np.int64),
            np.array([number for _, number, _ in sound], np.int64),
            np.array(rows) if rows else np.empty((0, form.width)),
            np.array([stamp for *_, (stamp, _) in sound], np.int64),
        )

    def counted(self) -> Counted:
        """Sending time and stamp of each message since the start [ns], by stream."""
        with self._lock:
            both = {n: [np.array(a, np.int64) for a in two] for n, two in self._counted.items()}
        return {name: (sent, stamps) for name, (sent, stamps) in both.items()}

    def scheduling(self, since_ns: int) -> Scheduling:
        """Wake-up delays of the tap's thread since a time [ns]."""
        with self._lock:
            late = [seconds for at_ns, seconds in self._late if at_ns >= since_ns]
        return Scheduling(float(np.median(late)), max(late)) if late else Scheduling()

    def recent(self, topic: Topic, count: int) -> Array:
        """Values of the newest messages of a stream, shape (at most count, width)."""
        with self._lock:
            heard = self._heard[topic.name][-count:]
        form = layout(topic, self._joint_names)
        found = [self._read(topic, form, data) for *_, data in heard]
        rows = [one[1] for one in found if not isinstance(one, Refusal)]
        return np.array(rows) if rows else np.empty((0, form.width))

    def _read(self, topic: Topic, form: Layout, data: bytes) -> tuple[int, Values] | Refusal:
        """Stamp and values of a message; the publisher may be foreign."""
        return form.decode_one(data) or read_any(topic.kind, data, self._joint_names)

    def age(self, topic: Topic) -> float:
        """Time since the newest message of a topic was sent [s]; infinite before the first message."""
        with self._lock:
            heard = self._heard[topic.name]
            return 1e-9 * (self._platform.time_ns() - heard[-1][0]) if heard else float("inf")

    def is_commanded(self) -> bool:
        """Whether the newest setpoint was computed from a command; if not, the arm moves without a command."""
        with self._lock:
            _, stamps = self._counted[SLAVE_SETPOINT_JS.name]
            return bool(stamps) and stamps[-1] != NO_COMMAND_NS

    def reports(self, topic: Topic) -> list[tuple[int, dict[str, float]]]:
        """Reports of a topic, each with the time at which it was sent [ns]."""
        with self._lock:
            heard = list(self._heard[topic.name])
        found = [(sent, read_numbers(data, topic.columns)) for sent, _, data in heard]
        return [
            (sent, dict(zip(topic.columns, one[1].tolist(), strict=True)))
            for sent, one in found
            if isinstance(one, tuple)
        ]

    def _now(self) -> float:
        return 1e-9 * self._platform.monotonic_ns()

    def _run(self) -> None:
        self._platform.take_real_time(self._real_time)
        due = self._now()
        while self._is_running:
            if self._hand is not None:
                self._hand.move()
            self._listen()
            due += hand.PERIOD
            now = self._now()
            if due <= now:  # the tap's own work took longer than a period, so its delay does not show the load of the
                # machine
                due = now if due < now - _FAR_BEHIND else due
                continue
            self._platform.sleep(due - now)
            self._late.append((self._platform.time_ns(), max(0.0, self._now() - due)))

    def _listen(self) -> None:
        with self._lock:
            self._listened_ns = self._platform.time_ns()
            for subscription in self._subscriptions:
                heard = self._heard[subscription.topic.name]
                while (taken := subscription.take()) is not None:
                    if self._count(subscription.topic.name, taken.sent_ns, taken.data):
                        heard.append((taken.sent_ns, taken.number, taken.data))

    def _count(self, name: str, sent_ns: int, data: bytes) -> bool:
        """Count a message of a stream; return False for a message that the drill itself has forged."""
        if name not in self._counted:
            return True
        if len(data) < _STAMP_AT + _STAMP.size:
            return False
        seconds, nanoseconds = _STAMP.unpack_from(data, _STAMP_AT)
        stamp_ns = seconds * SECOND_NS + nanoseconds
        if stamp_ns != NO_COMMAND_NS and abs(stamp_ns - sent_ns) >= _DAY_NS:
            return False
        sent, stamps = self._counted[name]
        sent.append(sent_ns)
        stamps.append(stamp_ns)
        return True


class _Hand:
    """Publishers of the hand."""

    def __init__(self, owner: Owner, tap: Tap) -> None:
        self._tap, self._platform, self._count = tap, owner.platform, 0
        self._begin_ns = self._platform.monotonic_ns()
        self._pose = sender(owner, MASTER_MEASURED_CP, ())
        self._buttons = sender(owner, MASTER_BUTTONS, ())

    def move(self) -> None:
        """Send all samples that are due."""
        stamp_ns = self._platform.time_ns()
        pose = hand.circle(1e-9 * (self._platform.monotonic_ns() - self._begin_ns))
        if self._count % _BUTTONS_EVERY == 0 and not self._tap.is_mute:
            self._buttons(stamp_ns, np.zeros(3))
        for sample in self._tap.distortion(Sample(stamp_ns, pose)):
            self._pose(sample.stamp_ns, sample.pose)
        self._count += 1


def sender(owner: Owner, topic: Topic, joint_names: tuple[str, ...]) -> Callable[[int, Array], None]:
    """Sender of stamps [ns] and values as a message of a topic."""
    publisher = owner.ros.create_publisher(message_type(topic.kind.ros_type), f"/{topic.name}", profile(topic))
    form = layout(topic, joint_names)
    return lambda stamp_ns, values: publisher.publish(form.encode_one(stamp_ns, values))


def stand_by() -> None:
    """Subscribe to all streams as a foreign process, and report this; runs until it is killed."""
    from teleop_core.graph.topics import STREAMS
    from teleop_core.middleware.ros import ROS

    ROS.init([])
    node, executor = ROS.node("drill_bystander"), ROS.executor()
    executor.add_node(node)
    heard = [0]

    def hear(_: object) -> None:
        heard[0] += 1
        if heard[0] == 100:
            print("listens", flush=True)

    for topic in STREAMS:
        kind = message_type(topic.kind.ros_type)
        node.create_subscription(kind, f"/{topic.name}", hear, profile(topic, 10))
    while True:
        executor.spin_once()
