"""Watching: loops that hang are told from those that work, and parents from those that are gone."""

import os
import socket
import threading

import pytest
from numba import njit

from teleop_core.kernels import IS_COMPILED
from teleop_core.kernels.progress import compiled_count, is_compiling
from teleop_core.nodes.loop import Loop
from teleop_core.nodes.parent import VARIABLE, Parent


@pytest.fixture
def pair():
    """Both ends of a line."""
    ours, theirs = socket.socketpair()
    yield ours, theirs
    ours.close()
    theirs.close()


def test_a_loop_that_never_comes_back_is_left_behind_and_says_where_it_is():
    is_inside, may_go = threading.Event(), threading.Event()

    def stand_still():
        is_inside.set()
        may_go.wait()

    loop = Loop("deaf", stand_still, print)
    loop.start()
    assert is_inside.wait(10)
    loop.is_hung = True
    assert not loop.stop()
    assert "stand_still" in loop.place()
    assert loop.turns == 0
    may_go.set()
    loop.is_hung = False
    assert loop.stop()
    assert not loop.is_alive


def test_a_loop_that_works_stops_after_its_turn():
    count, ready = [], threading.Event()

    def turn():
        count.append(1)
        if len(count) == 10:
            ready.set()
            loop.stop()  # from within: ends after this turn

    loop = Loop("short", turn, print, prepare=lambda: None)
    loop.start()
    assert ready.wait(10)
    assert loop.stop()
    assert loop.turns == len(count) == 10
    assert loop.is_ready


def test_the_end_of_the_parent_is_known_at_once(pair, monkeypatch):
    ours, theirs = pair
    monkeypatch.setenv(VARIABLE, str(theirs.detach()))
    parent = Parent.of_environment()
    assert parent is not None
    assert VARIABLE not in os.environ  # what the process starts itself has no such parent
    assert not os.get_inheritable(parent.fileno())
    assert not parent.has_gone()
    parent.tell("at work")
    assert ours.recv(100) == b"at work\n"
    ours.close()
    assert parent.has_gone()
    parent.tell("ending")  # to nobody, which is no error
    parent.close()


def test_a_process_that_was_started_by_hand_has_no_parent(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert Parent.of_environment() is None


def test_a_parent_that_does_not_listen_holds_nobody_up(pair):
    parent = Parent(pair[1])
    for _ in range(100_000):
        parent.tell("at work")
    assert not parent.has_gone()


@pytest.mark.skipif(not IS_COMPILED, reason="nothing is compiled")
def test_kernels_that_are_compiled_are_counted():
    before = compiled_count()

    @njit
    def inner(x):
        return x + 1.0

    @njit
    def outer(x):
        return inner(x) * 2.0

    assert not is_compiling()
    assert outer(1.0) == 4.0
    assert compiled_count() >= before + 2
    assert not is_compiling()
