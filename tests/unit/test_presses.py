"""Presses: what the messages of stop buttons say when some are lost, late or doubled."""

from hypothesis import given
from hypothesis import strategies as st

from teleop_core.slave.operation.presses import Presses


def told(presses: Presses, *messages: tuple[int, bool], sender: bytes = b"a") -> list[bool]:
    """States that messages (number, is_pressed) of a sender add, in order."""
    return [said for number, is_pressed in messages for said in presses.take(sender, number, 0, is_pressed=is_pressed)]


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 2)), max_size=50))
def test_every_message_is_said_once_and_missing_ones_before_it_count_as_a_press(sent: list[tuple[bool, int]]) -> None:
    """Each with how often it arrives."""
    presses, expected, last = Presses(), list[bool](), 0
    for number, (is_pressed, times) in enumerate(sent, 1):
        if times:
            expected += [True] * (number > last + 1) + [is_pressed]
            last = number
    arriving = [(number, is_pressed) for number, (is_pressed, times) in enumerate(sent, 1) for _ in range(times)]
    assert told(presses, *arriving) == expected
    assert presses.lost == last - len({number for number, _ in arriving})


def test_a_message_that_arrives_through_two_readers_counts_once_in_whatever_order() -> None:
    presses = Presses()
    assert told(presses, (1, True), (2, False), (1, True), (2, False)) == [True, False]


def test_what_a_button_said_before_it_is_heard_is_nothing_to_an_idle_listener() -> None:
    presses = Presses()
    assert presses.take(b"a", 5000, 0, is_pressed=False, is_idle=True) == (False,)
    assert presses.take(b"a", 5001, 0, is_pressed=False) == (False,)
    assert presses.lost == 0


def test_a_button_that_says_nothing_holds_the_stop_until_it_is_released_or_overridden() -> None:
    presses = Presses()
    assert presses.doubt(b"a") == (True,)
    assert presses.doubt(b"a") == ()
    assert presses.holders == (b"a",)
    assert told(presses, (1, False)) == [False]
    assert presses.doubt(b"b") == (True,)
    presses.release()
    assert not presses.holders
    assert presses.doubt(b"a") == presses.doubt(b"b") == ()


def test_only_the_button_that_presses_releases() -> None:
    presses = Presses()
    assert told(presses, (1, True)) == [True]
    assert told(presses, (1, False), (2, True), (3, False), sender=b"b") == [True, True, True]
    assert presses.holders == (b"a",)
    assert told(presses, (2, False)) == [False]
    assert not presses.holders


def test_a_best_effort_button_is_released_by_itself_alone() -> None:
    presses = Presses()
    assert presses.overhear(b"a", 0, is_pressed=True) == (True,)
    assert told(presses, (1, False), sender=b"b") == [True]
    assert presses.overhear(b"b", 0, is_pressed=True) == ()  # heard by another reader already
    assert presses.overhear(b"a", 0, is_pressed=False) == (False,)


def test_a_release_of_all_overrides_every_button_and_misses_none_that_it_overrode() -> None:
    presses = Presses()
    presses.take(b"a", 1, 10, is_pressed=True)
    presses.take(b"b", 1, 20, is_pressed=False)
    assert (presses.heard_ns, presses.silent(20)) == (10, (b"a",))
    presses.release()
    assert (presses.holders, presses.heard_ns) == ((), None)
    assert presses.take(b"b", 2, 30, is_pressed=False) == (False,)
    assert presses.take(b"a", 2, 40, is_pressed=True) == (True,)


def test_every_button_that_was_heard_has_its_own_deadline() -> None:
    presses = Presses()
    for time in range(0, 100, 10):
        presses.take(b"a", time // 10 + 1, time, is_pressed=False)
        if time < 30:
            presses.take(b"b", time // 10 + 1, time, is_pressed=False)
    assert (presses.heard_ns, presses.silent(50)) == (20, (b"b",))


def test_a_message_that_was_lost_before_the_first_of_its_sender_counts_as_a_press() -> None:
    presses = Presses()
    assert presses.lose(0) == ()
    assert presses.lose(3) == (True, False)
    assert (presses.lose(3), presses.lose(4), presses.lost) == ((), (True, False), 4)


def test_what_numbers_tell_of_one_sender_hides_no_loss_that_the_middleware_alone_knows() -> None:
    presses = Presses()
    told(presses, (1, False), (9, False))
    assert (presses.lose(2), presses.lose(2), presses.lost) == ((True, False), (), 7)


def test_senders_do_not_fill_the_gaps_of_each_other() -> None:
    presses = Presses()
    told(presses, (1, False))
    assert told(presses, (1, False), (2, False), sender=b"b") == [False, False]
    assert told(presses, (3, False)) == [True, False]


def test_messages_without_numbers_are_all_taken() -> None:
    presses = Presses()
    assert told(presses, (0, True), (0, False), (0, True)) == [True, False, True]
