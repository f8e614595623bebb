"""Feed: nothing of a loop waits for the recorder, and what it does not take is counted."""

import json
import os
import select
from collections.abc import Callable, Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop_core.graph.graph import build_graph
from teleop_core.nodes.crews import Processes, crews
from teleop_core.nodes.feed import (
    MOST,
    READS,
    Feed,
    FeedReader,
    Pipe,
    fed_topics,
    pipes_of_environment,
    variable,
)

NAMES = ("a", "b/c")


class Taker:
    """Whoever takes the messages of a topic."""

    def __init__(self) -> None:
        self.came: list[tuple[int, bytes, int]] = []
        self.joined: list[bool] = []

    def take(self, number: int, data: bytes, sent_ns: int) -> None:
        self.came.append((number, data, sent_ns))

    def join(self, is_inside: bool) -> None:
        self.joined.append(is_inside)


Ends = tuple[Feed, FeedReader, dict[str, Taker]]


def made() -> Ends:
    read, write = os.pipe()
    for end in (read, write):
        os.set_blocking(end, False)
    takers = {name: Taker() for name in NAMES}
    return Feed(Pipe(write, NAMES)), FeedReader(Pipe(read, NAMES), takers), takers


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
def test_all_messages_arrive_whole_numbered_and_in_their_order(
    messages: list[tuple[str, bytes]],
) -> None:
    feed, reader, takers = made()
    try:
        for time_ns, (name, data) in enumerate(messages):
            feed.channels[name].give(data, time_ns)
            if time_ns % 3 == 0:
                feed.flush()
            if time_ns % 7 == 0:
                reader.drain()
        while feed.waiting:
            feed.flush()
            reader.drain()
        reader.drain()
        for name, taker in takers.items():
            wanted = [(data, time) for time, (own, data) in enumerate(messages) if own == name]
            assert [(data, time) for _, data, time in taker.came] == wanted
            assert [number for number, _, _ in taker.came] == list(range(1, len(wanted) + 1))
    finally:
        feed.close()
        reader.close()


def test_a_recorder_that_takes_nothing_holds_nobody_up_and_what_is_lost_shows_in_the_numbers(
    ends: Callable[[], Ends],
) -> None:
    feed, reader, takers = ends()
    data, count = bytes(1 << 20), 40
    for _ in range(count):
        feed.channels["a"].give(data, 0)
        feed.flush()  # never waits
    assert len(feed.waiting) < MOST + 2 * len(data)
    while feed.waiting:
        feed.flush()
        reader.drain()
    feed.channels["a"].give(b"last", 7)
    feed.flush()
    reader.drain()
    numbers = [number for number, _, _ in takers["a"].came]
    assert numbers[-1] == count + 1
    assert len(numbers) < count + 1
    assert numbers[:-1] == list(range(1, len(numbers)))


def test_topics_whose_process_ends_are_left_to_others(ends: Callable[[], Ends]) -> None:
    feed, reader, takers = ends()
    feed.channels["a"].join(True)  # it was before
    feed.channels["a"].join(False)
    feed.channels["a"].join(True)
    feed.flush()
    reader.drain()
    assert takers["a"].joined == [False, True]
    feed.channels["b/c"].give(b"x", 1)
    feed.close()
    reader.drain()
    assert takers["b/c"].came == [(1, b"x", 1)]
    assert takers["a"].joined[-1] is takers["b/c"].joined[-1] is False


def test_a_recorder_that_ends_costs_the_loop_nothing(ends: Callable[[], Ends]) -> None:
    feed, reader, _ = ends()
    reader.close()
    for _ in range(3):
        feed.channels["a"].give(b"x", 0)
        feed.flush()
        assert not feed.waiting


def test_ends_that_are_left_open_for_a_process_are_not_left_to_what_it_starts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    read, write = os.pipe()
    os.set_inheritable(read, True)
    monkeypatch.setenv(READS, variable(Pipe("<x>", NAMES)).replace("<x>", str(read)))
    (pipe,) = pipes_of_environment(READS)
    assert pipe == Pipe(read, list(NAMES))
    assert READS not in os.environ
    assert not os.get_inheritable(read)
    assert not select.select([read], (), (), 0)[0]
    os.close(read)
    os.close(write)
    assert pipes_of_environment(READS) == []
    assert json.loads(variable()) == []


def test_sides_meet_at_the_slave_share_two_processes_and_feed_every_stream_once() -> None:
    graph = build_graph(("right", "left"), ("network",))
    recorder, sides = crews(graph)
    assert list(recorder.values()) == [("recorder",)]
    assert list(sides) == ["hand_side", "slave_side"]
    assert set(sides["slave_side"]) == {"slave", "slave_sim", "left/slave", "left/slave_sim"}
    assert "left/network" in sides["hand_side"]
    fed = [name for nodes in sides.values() for name in fed_topics(graph, nodes)]
    assert len(fed) == len(set(fed))
    assert {"left/slave/true_cp", "master/measured_cp"} <= set(fed)
    assert "slave/operation" not in fed
    assert len(crews(graph, Processes.NODES)[1]) == len(graph.members)
    assert len(crews(graph, Processes.ONE, without=("slave_sim",))[1]) == 1
