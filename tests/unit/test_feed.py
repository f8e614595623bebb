"""Feed: nothing of a loop waits for the recorder, and what it does not take is counted."""

import os
import socket
from collections.abc import Callable, Iterator
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop_core.graph.graph import build_graph
from teleop_core.middleware.ros import ROS, RosPlatform
from teleop_core.nodes.crews import Processes, crews
from teleop_core.nodes.feed import MOST, Feed, FeedReader

NAMES = ("a", "b/c")
NUMBERS = count()


class Machine(RosPlatform):
    """A world in which one recorder alone is found."""

    def __init__(self) -> None:
        super().__init__()
        self.place = f"\0teleop_core.test.{os.getpid()}.{next(NUMBERS)}"

    def feed_place(self) -> str:
        return self.place


class Taker:
    """Whoever takes the messages of a topic."""

    def __init__(self) -> None:
        self.came: list[tuple[bytes, int]] = []
        self.joined: list[bool] = []
        self.lost = 0

    def take(self, data: bytes, sent_ns: int, lost: int) -> None:
        self.came.append((data, sent_ns))
        self.lost += lost

    def join(self, is_inside: bool, since_ns: int) -> None:
        assert since_ns > 0
        self.joined.append(is_inside)


Ends = tuple[Feed, FeedReader, dict[str, Taker]]


def made() -> Ends:
    platform = Machine()
    takers = {name: Taker() for name in NAMES}
    reader, feed = FeedReader(takers, platform), Feed(NAMES, platform)
    feed.flush()  # finds it
    for channel in feed.channels.values():
        channel.join(True)
    return feed, reader, takers


def all_of(feed: Feed, reader: FeedReader) -> None:
    """Write and read until nothing waits."""
    while feed.waiting:
        feed.flush()
        reader.drain()
    reader.drain()


@pytest.fixture
def ends() -> Iterator[Callable[[], Ends]]:
    opened: list[Ends] = []

    def make() -> Ends:
        opened.append(made())
        return opened[-1]

    yield make
    for feed, reader, _ in opened:
        feed.close()
        reader.close()


@given(st.lists(st.tuples(st.sampled_from(NAMES), st.binary(max_size=5000)), max_size=60))
def test_all_messages_arrive_whole_and_in_their_order(messages: list[tuple[str, bytes]]) -> None:
    feed, reader, takers = made()
    try:
        for time_ns, (name, data) in enumerate(messages):
            feed.channels[name].give(data, time_ns)
            if time_ns % 3 == 0:
                feed.flush()
            if time_ns % 7 == 0:
                reader.drain()
        all_of(feed, reader)
        for name, taker in takers.items():
            wanted = [(data, time) for time, (own, data) in enumerate(messages) if own == name]
            assert taker.came == wanted
            assert taker.lost == 0
    finally:
        feed.close()
        reader.close()


def test_a_recorder_that_takes_nothing_holds_nobody_up_and_what_is_lost_is_counted(ends: Callable[[], Ends]) -> None:
    feed, reader, takers = ends()
    data, sent = bytes(1 << 20), 40
    for _ in range(sent):
        feed.channels["a"].give(data, 0)
        feed.flush()  # never waits
    assert len(feed.waiting) < MOST + 2 * len(data)
    all_of(feed, reader)
    feed.channels["a"].give(b"last", 7)
    all_of(feed, reader)
    assert takers["a"].came[-1] == (b"last", 7)
    assert takers["a"].lost > 0
    assert len(takers["a"].came) + takers["a"].lost == sent + 1


def test_topics_whose_loop_ends_are_left_to_others(ends: Callable[[], Ends]) -> None:
    feed, reader, takers = ends()
    feed.channels["a"].join(True)  # it was before
    feed.channels["a"].join(False)
    all_of(feed, reader)
    assert takers["a"].joined[-2:] == [True, False]
    feed.channels["b/c"].give(b"x", 1)
    feed.close()
    reader.drain()
    assert takers["b/c"].came == [(b"x", 1)]
    assert takers["a"].joined[-1] is takers["b/c"].joined[-1] is False
    assert reader.cut == 0


def test_a_loop_that_ends_without_a_word_is_counted(ends: Callable[[], Ends]) -> None:
    feed, reader, takers = ends()
    feed.channels["a"].give(b"x", 1)
    feed.flush()
    line = feed._line
    assert line is not None
    line.close()  # as the system does for a process that was killed
    reader.drain()
    assert takers["a"].came == [(b"x", 1)]
    assert reader.cut == 1


def test_a_recorder_that_ends_costs_a_loop_nothing_and_the_next_one_is_found(
    ends: Callable[[], Ends], monkeypatch: pytest.MonkeyPatch
) -> None:
    feed, reader, takers = ends()
    all_of(feed, reader)
    reader.close()
    for _ in range(3):
        feed.channels["a"].give(b"x", 0)
        feed.flush()
    assert not feed.is_open
    assert not feed.waiting
    monkeypatch.setattr("teleop_core.nodes.feed._AGAIN_NS", -1)
    again = FeedReader(takers, feed.platform)
    feed.flush()
    feed.channels["a"].give(b"y", 5)
    all_of(feed, again)
    assert takers["a"].came[-1] == (b"y", 5)
    assert takers["a"].lost == 0  # what came before it was there is not its own
    assert takers["a"].joined[-1] is True
    again.close()


def test_a_second_recorder_of_a_machine_hears_no_loop_and_takes_none_away() -> None:
    platform, takers = Machine(), {name: Taker() for name in NAMES}
    first, second = FeedReader(takers, platform), FeedReader({}, platform)
    feed = Feed(NAMES, platform)
    feed.flush()
    feed.channels["a"].give(b"x", 1)
    feed.flush()
    second.drain()
    first.drain()
    assert takers["a"].came == [(b"x", 1)]
    for one in (feed, first, second):
        one.close()


@pytest.mark.parametrize("sent", [bytes(range(256)) * 100, bytes(100), b"\0\0\0\0\7\0\1\0" + bytes(12)])
def test_bytes_that_are_no_feed_end_with_their_line(ends: Callable[[], Ends], sent: bytes) -> None:
    feed, reader, takers = ends()
    with socket.socket(socket.AF_UNIX) as other:
        other.connect(feed.platform.feed_place())
        other.sendall(sent)
        reader.drain()
        assert other.recv(1) == b""  # it is heard no more
    feed.channels["a"].give(b"x", 1)
    all_of(feed, reader)
    assert takers["a"].came == [(b"x", 1)]


def test_each_ros_domain_has_a_place_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "41")
    one = ROS.feed_place()
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert ROS.feed_place() != one


def test_sides_meet_at_the_slave_and_two_arms_share_them() -> None:
    graph = build_graph(("right", "left"), ("network",))
    recorder, sides = crews(graph)
    assert list(recorder.values()) == [("recorder",)]
    assert list(sides) == ["hand_side", "slave_side"]
    assert set(sides["slave_side"]) == {"slave", "slave_sim", "left/slave", "left/slave_sim", "frames"}
    assert "left/network" in sides["hand_side"]
    assert len(crews(graph, Processes.NODES)[1]) == len(graph.members) + 1
    assert len(crews(graph, Processes.ONE, without=("slave_sim",))[1]) == 1
