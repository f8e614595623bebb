"""Wire: what kernels read, write, take and send, beside the layouts and beside the same messages taken in Python."""

import ctypes
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from teleop_core.bags.layouts import layout
from teleop_core.bags.messages import Refusal, read_values
from teleop_core.bags.ros_types import deserialise
from teleop_core.graph import topics
from teleop_core.kernels import records
from teleop_core.kernels.fields import Cells
from teleop_core.kernels.memory import integers
from teleop_core.middleware.platform import Taken
from teleop_core.nodes import wire
from teleop_core.nodes.streams import READING, WRITING, Input, Output, calls_of, describe

JOINTS = ("a", "shoulder", "b2")
STREAMS = (
    topics.MASTER_MEASURED_CP, topics.MASTER_MEASURED_CV, topics.SLAVE_MEASURED_CF, topics.MASTER_BUTTONS,
    topics.SLAVE_SERVO_JP, topics.SLAVE_MEASURED_JS, topics.SLAVE_REACH, topics.SLAVE_JAW_MEASURED_JS,
)  # fmt: skip
NOW_NS = 1_800_000_000_123_456_789


def values_of(topic: topics.Topic, random: np.random.Generator) -> Any:
    """Values of a valid message."""
    if topic.kind is topics.Kind.BUTTONS:
        return random.integers(0, 2, 3).astype(float)
    values = random.standard_normal(topic.width(len(JOINTS)))
    if topic.kind is topics.Kind.POSE:
        values[3:] /= np.linalg.norm(values[3:])
    return values


class Queue:
    """Middleware in C: a queue of messages, what was published, a clock; or the same queue for Python.

    Args:
        is_reached: Whether kernels reach it.
    """

    def __init__(self, is_reached: bool) -> None:
        self.waiting: deque[Taken] = deque()
        self.published: list[bytes] = []
        self.readers, self.now_ns, self._is_reached = 1, 5_000_000_000, is_reached
        self._message, self._info = np.zeros(8, np.int64), np.zeros(8, np.int64)
        self._buffer = np.zeros(2000, np.uint8)
        words = [ctypes.c_size_t] * 4
        kind = ctypes.CFUNCTYPE(ctypes.c_int32, *words)
        self._own = {
            "take": kind(self._take),
            "forget_error": kind(lambda *_: 0),
            "publish": kind(self._publish),
            "matched": kind(self._matched),
            "clock": kind(self._clock),
        }
        self.type, self.platform, self.ros = None, self, self
        if is_reached:
            self.places = (1, self._message.ctypes.data, self._info.ctypes.data)

    def functions(self) -> dict[str, int]:
        if not self._is_reached:
            return {}
        return {name: ctypes.cast(own, ctypes.c_void_p).value or 0 for name, own in self._own.items()}

    def _take(self, *_: int) -> int:
        if not self.waiting:
            return 401
        taken = self.waiting.popleft()
        self._buffer[: len(taken.data)] = np.frombuffer(taken.data, np.uint8)
        self._message[:3] = self._buffer.ctypes.data, len(taken.data), 2000
        self._info[2] = taken.number
        self._info[5:7] = np.frombuffer(taken.sender.ljust(16, b"\0"), np.int64)
        return 0

    def _publish(self, _writer: int, message: int, *_: int) -> int:
        at, length = (ctypes.c_int64 * 2).from_address(message)
        self.published.append(ctypes.string_at(at, length))
        return 0

    def _matched(self, _writer: int, count: int, *_: int) -> int:
        ctypes.c_int64.from_address(count).value = self.readers
        return 0

    def _clock(self, kind: int, at: int, *_: int) -> int:
        time_ns = self.monotonic_ns() if kind else self.time_ns()
        integers(at, 2)[:] = divmod(time_ns, 10**9)
        return 0

    def monotonic_ns(self) -> int:
        return self.now_ns

    def time_ns(self) -> int:
        return NOW_NS + self.now_ns

    def create_taker(self, *_: object) -> "Queue":
        return self

    def resolve_topic_name(self, name: str) -> str:
        return name

    def take(self) -> Taken | None:
        return self.waiting.popleft() if self.waiting else None

    def wait(self, seconds: float) -> None:
        """Return at once: messages are there or never come."""

    def close(self) -> None:
        """Keep the queue for the test."""


@pytest.mark.parametrize("topic", STREAMS, ids=lambda topic: topic.name)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_kernels_read_a_message_as_its_layout_does_and_refuse_to_read_any_other(topic: Any, data: Any) -> None:
    form = layout(topic, JOINTS)
    random = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    values, stamp_ns = values_of(topic, random), data.draw(st.integers(0, 2**31 * 10**9 - 1))
    own, row = records(READING)[0], np.zeros(form.width)
    describe(Cells(own), form)
    own["row_at"] = row.ctypes.data
    message = bytearray(form.encode_one(stamp_ns, values) + bytes(data.draw(st.integers(0, 3))))
    if data.draw(st.booleans()):
        message[data.draw(st.integers(0, len(message) - 1))] ^= data.draw(st.integers(1, 255))
    buffer = np.frombuffer(bytes(message), np.uint8)
    found = wire.read(own, buffer.ctypes.data, len(buffer))
    expected = form.decode_one(bytes(message))
    if expected is None or expected[0] < 0:
        assert found < 0
    else:
        assert found == expected[0]
        np.testing.assert_array_equal(row, expected[1])


@pytest.mark.parametrize("topic", STREAMS, ids=lambda topic: topic.name)
def test_what_kernels_publish_is_what_another_reader_deserialises(topic: Any) -> None:
    queue, random = Queue(True), np.random.default_rng(3)
    source = values_of(topic, random)
    output = Output(queue, Publisher(queue), layout(topic, JOINTS), source, topic.name)  # type: ignore[arg-type]
    place, calls = np.zeros(2, np.int64), calls_of(queue)  # type: ignore[arg-type]
    outputs = np.asarray(output.own).reshape(1).view(output.own.dtype)
    block = records([("is_open", "i8"), ("at", "i8"), ("room", "i8"), ("fill", "i8")])[0]
    output.write(NOW_NS, 0, 0)
    wire.send_all(outputs, calls, block, place)
    assert (place[0], output.sent, len(queue.published)) == (1, 1, 1)
    found = read_values(topic.kind, deserialise(queue.published[0], topic.ros_type), topic.names(JOINTS))
    assert not isinstance(found, Refusal)
    assert found[0] == NOW_NS
    np.testing.assert_array_equal(found[1], source)
    assert deserialise(queue.published[0], topic.ros_type).header.frame_id == topic.frame_id
    queue.readers = 0
    output.write(NOW_NS + 1, 0, 0)
    place[0] = 0
    wire.send_all(outputs, calls, block, place)
    assert (output.sent, len(queue.published)) == (2, 1), "nobody reads it, so it is not published"


def test_what_the_middleware_answers_is_written_into_the_record_that_the_kernel_holds() -> None:
    queue = Queue(True)
    calls: Any = calls_of(queue)  # type: ignore[arg-type]
    queue.now_ns = 7 * wire.SECOND_NS + 5
    place, times = np.zeros(2, np.int64), np.zeros(2, np.int64)
    wire.write_all(records(WRITING, 0), calls, place, times)
    assert times.tolist() == [queue.monotonic_ns(), queue.time_ns()]
    whole = np.asarray(calls)
    assert calls["time"].tolist() == list(divmod(queue.time_ns(), wire.SECOND_NS))
    assert whole.ctypes.data <= calls["time"].ctypes.data < whole.ctypes.data + whole.nbytes


class Publisher:
    """Publisher of a queue, which kernels reach."""

    pointer = 1

    def __init__(self, queue: Queue) -> None:
        self.send = queue.published.append

    def hold(self) -> None:
        """Keep the queue, which the test keeps anyway."""

    def release(self) -> None:
        """Keep the queue."""


def messages_of(topic: topics.Topic, random: np.random.Generator, count: int) -> list[Taken]:
    """Messages of two publishers: sound, old, not finite, of another frame, and no messages at all."""
    found, numbers, stamp_ns = [], {b"first": 0, b"second-publisher": 0}, NOW_NS
    for _ in range(count):
        sender = b"first" if random.random() < 0.9 else b"second-publisher"
        numbers[sender] += 1 + (random.random() < 0.1)
        stamp_ns += int(random.integers(-1, 4)) * 500_000
        values = values_of(topic, random)
        if random.random() < 0.1:
            values[random.integers(len(values))] = random.choice([np.nan, np.inf, 5.0])
        frame = topic.frame_id if random.random() < 0.8 else "elsewhere"
        if topic.kind is topics.Kind.BUTTONS:
            values = np.nan_to_num(values, posinf=1.0)
        data = layout(topic, JOINTS, frame).encode_one(stamp_ns, values)
        if random.random() < 0.05:
            data = data[: random.integers(len(data))]
        found.append(Taken(data, sender, numbers[sender], 0, 0))
    return found


@pytest.mark.parametrize("topic", STREAMS, ids=lambda topic: topic.name)
@pytest.mark.parametrize("way", ["take", "newest"])
def test_kernels_that_take_by_themselves_accept_and_refuse_what_python_does(topic: Any, way: str) -> None:
    random = np.random.default_rng(7)
    queues, entries = [Queue(True), Queue(False)], []
    for queue in queues:
        target = np.zeros(topic.width(len(JOINTS)))
        entries.append((Input(queue, topic, topic.name, JOINTS, target), target))  # type: ignore[arg-type]
    for _ in range(150):
        batch = messages_of(topic, random, int(random.integers(0, 5)))
        states = []
        for queue, (entry, target) in zip(queues, entries, strict=True):
            queue.waiting += batch
            queue.now_ns += 1_000_000
            answers = drained(getattr(entry, way), queue.waiting)
            sender = entry.sender
            states.append((
                answers, target.tolist(), entry.stamp_ns, entry.received, dict(entry.refused), sender.gaps,
                sender.repeats, sender.reordered, sender.owners, sender.conflict, sender.fault, sender.newest_age_ns,
            ))  # fmt: skip
        assert states[0] == states[1]
    assert entries[0][0].refused.total() > 20
    assert entries[0][0].stamp_ns is not None


def drained(take: Callable[[], bool], waiting: Sequence[object]) -> list[bool]:
    """Answers until nothing waits."""
    found = [take()]
    while waiting:
        found.append(take())
    return found


def test_a_message_in_the_order_of_another_writer_is_read_by_name_in_both_ways() -> None:
    topic = topics.SLAVE_SERVO_JP
    data = layout(topic, ("b2", *JOINTS[:2])).encode_one(NOW_NS, np.array([3.0, 1.0, 2.0]))
    for is_reached in (True, False):
        queue, target = Queue(is_reached), np.zeros(3)
        entry = Input(queue, topic, topic.name, JOINTS, target)  # type: ignore[arg-type]
        queue.waiting.append(Taken(data, b"x", 1, 0, 0))
        assert entry.take()
        assert target.tolist() == [1.0, 2.0, 3.0]
