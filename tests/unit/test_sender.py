"""Sender: one owner per topic; losses, told by numbers; floods; stamps that say nothing."""

from typing import Any

import pytest

from teleop_core.bags.messages import Refusal
from teleop_core.nodes.sender import Sender

MS, SECOND = 1_000_000, 1_000_000_000
BEGIN = 77 * SECOND


def feed(
    sender: Sender, numbers: list[int] | range, begin: int = BEGIN, name: bytes = b"first"
) -> list[Refusal | None]:
    """What is answered to messages of a publisher, a millisecond apart."""
    return [sender.admit(name, n, begin + i * MS) for i, n in enumerate(numbers)]


def feed_in_turn(
    sender: Sender, first: list[int] | range, second: list[int] | range
) -> tuple[list[None], list[Refusal]]:
    """What is answered to two publishers that send in turn: to the first, to the second."""
    answers: Any
    answers = [], []
    for i, pair in enumerate(zip(first, second, strict=True)):
        for name, number, known in zip((b"first", b"second"), pair, answers, strict=True):
            known.append(sender.admit(name, number, BEGIN + i * MS))
    return answers


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        (range(40, 240), 0),
        ([1, 2, 5, 6, 16], 2 + 9),
        ([1, 2, 3, 2003], 1999),  # in a stall
        ([1, 2, 4, 3, 5], 1),  # one was overtaken on the way, and is counted once
        ([0] * 50, 0),  # of a middleware without numbers
    ],
)
def test_what_is_missing_from_the_owners_numbers_is_counted_and_all_that_came_is_admitted(
    numbers: list[int] | range, lost: int
) -> None:
    sender = Sender()
    assert feed(sender, numbers) == [None] * len(numbers)
    assert (sender.gaps, sender.owners, sender.conflict) == (lost, 1, False)


@pytest.mark.parametrize("begin", [1, 41, 5000, 90_000])
def test_a_second_publisher_is_refused_whatever_its_numbers_and_the_first_one_goes_on(begin: int) -> None:
    sender = Sender()
    first, second = feed_in_turn(sender, range(40, 140), range(begin, begin + 100))
    assert first == [None] * 100
    assert second == [Refusal.SECOND_PUBLISHER] * 100
    assert (sender.owners, sender.gaps, sender.conflict) == (1, 0, True)


def test_a_topic_goes_to_another_once_its_owner_is_silent() -> None:
    sender = Sender(silence=0.5)
    feed(sender, range(1000, 1010))
    later = BEGIN + 9 * MS
    assert sender.admit(b"second", 1, later + 500 * MS) is Refusal.SECOND_PUBLISHER
    assert sender.admit(b"second", 2, later + 501 * MS) is None
    assert feed(sender, [3, 4, 5], later + 502 * MS, b"second") == [None] * 3
    assert (sender.owners, sender.gaps, sender.conflict) == (2, 0, False)
    assert feed(sender, [1010], later + 504 * MS) == [Refusal.SECOND_PUBLISHER]


def test_a_topic_goes_to_another_at_once_if_the_publisher_of_its_owner_is_gone() -> None:
    sender = Sender()
    feed(sender, [1000, 1001])
    assert feed(sender, [1], name=b"second") == [Refusal.SECOND_PUBLISHER]
    sender.release()
    assert feed(sender, [2, 3], BEGIN + 3 * MS, b"second") == [None, None]
    assert not sender.conflict


def test_a_conflict_stays_until_it_is_forgotten() -> None:
    sender = Sender()
    feed_in_turn(sender, [1000, 1001], [1, 2])
    assert sender.conflict
    feed(sender, range(1002, 1010), BEGIN + SECOND)
    assert sender.conflict
    assert feed(sender, [3, 4], BEGIN + 3 * SECOND, b"second") == [None, None]
    assert (sender.owners, sender.conflict) == (2, True)
    sender.forget()
    assert not sender.conflict
    assert feed(sender, [7, 8], BEGIN + 4 * SECOND, b"third") == [None, None]


def test_a_flood_is_refused_beyond_its_rate_second_by_second() -> None:
    sender = Sender(limit=100)
    answers = feed(sender, range(1, 1001))
    assert answers[:100] == [None] * 100
    assert answers[100:] == [Refusal.FLOOD] * 900
    again = feed(sender, range(1001, 1011), BEGIN + SECOND)
    assert again == [None] * 10


def test_stamps_of_a_clock_that_is_ahead_are_told_as_such() -> None:
    sender = Sender()
    sender.note_stamp(BEGIN + 1300 * MS, BEGIN)
    (told,) = sender.concerns("master/measured_cp")
    assert "master/measured_cp: stamps are 1.3 s ahead of this clock" in told
    sender.note_stamp(BEGIN, BEGIN + 2 * MS)
    assert sender.concerns("master/measured_cp") == []


def test_stamps_that_are_zero_or_stand_still_or_go_back_are_told_with_what_to_do() -> None:
    sender = Sender()
    told = {}
    for name, stamp, last in (("zero", 0, 0), ("frozen", 5, 5), ("back", 4, 5)):
        sender.note_old(stamp, last)
        (told[name],) = sender.concerns("x")
    assert told["zero"] == "x: its stamps are 0: stamp each message with the time of its sample"
    assert "do not move" in told["frozen"]
    assert "go back" in told["back"]
    assert (sender.repeats, sender.reordered) == (2, 1)


def test_ages_begin_anew_after_a_step_of_the_clock() -> None:
    sender = Sender()
    sender.note_stamp(BEGIN, BEGIN - 3 * SECOND)
    sender.clear_ages()
    assert sender.ages.summary() == (0.0, 0.0, 0.0)
    assert sender.concerns("x") == []
    sender.note_stamp(BEGIN, BEGIN + 2 * MS)
    assert sender.ages.summary()[2] == 2 * MS
