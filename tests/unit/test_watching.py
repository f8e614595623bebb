"""Watching: loops that hang are told from those that work, and parents from those that are gone."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import psutil
import pytest
from numba import njit

from present import present
from teleop_core.kernels import IS_COMPILED
from teleop_core.kernels.progress import compiled_count, is_compiling
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.chances import Chances
from teleop_core.nodes.loop import Loop
from teleop_core.nodes.parent import VARIABLE, Parent


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Both ends of a line."""
    ours, theirs = socket.socketpair()
    yield ours, theirs
    ours.close()
    theirs.close()


def test_a_loop_that_never_comes_back_is_left_behind_and_says_where_it_is() -> None:
    is_inside, may_go = threading.Event(), threading.Event()

    def stand_still() -> None:
        is_inside.set()
        may_go.wait()

    loop = Loop(ROS, "deaf", stand_still, print)
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


def test_a_loop_that_works_stops_after_its_turn() -> None:
    count, ready = [], threading.Event()

    def turn() -> None:
        count.append(1)
        if len(count) == 10:
            ready.set()
            loop.stop()  # from within: ends after this turn

    loop = Loop(ROS, "short", turn, print, prepare=lambda: None)
    loop.start()
    assert ready.wait(10)
    assert loop.stop()
    assert loop.turns == len(count) == 10
    assert loop.is_ready


def test_the_end_of_the_parent_is_known_at_once(
    pair: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_a_process_that_was_started_by_hand_has_no_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert Parent.of_environment() is None


def test_a_parent_that_does_not_listen_holds_nobody_up(pair: tuple[socket.socket, socket.socket]) -> None:
    parent = Parent(pair[1])
    for _ in range(100_000):
        parent.tell("at work")
    assert not parent.has_gone()


@pytest.mark.skipif(not IS_COMPILED, reason="nothing is compiled")
def test_kernels_that_are_compiled_are_counted() -> None:
    before = compiled_count()

    @njit
    def inner(x: float) -> Any:
        return x + 1.0

    @njit
    def outer(x: float) -> Any:
        return inner(x) * 2.0

    assert not is_compiling()
    assert outer(1.0) == 4.0
    assert compiled_count() >= before + 2
    assert not is_compiling()


@pytest.fixture
def processor() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """One processor that processes of the test share; starts them, and ends them afterwards."""
    running, first = [], min(os.sched_getaffinity(0))

    def start(program: str, policy: int = os.SCHED_OTHER) -> Any:
        def settle() -> None:
            os.sched_setaffinity(0, {first})
            os.sched_setscheduler(0, policy, os.sched_param(0))

        command = [sys.executable, "-S", "-c", f"print(flush=True)\n{program}"]
        made = subprocess.Popen(command, preexec_fn=settle, stdout=subprocess.PIPE)  # noqa: PLW1509
        assert present(made.stdout).readline()
        running.append(made)
        return made

    yield start
    for process in running:
        process.kill()
        process.wait()
        present(process.stdout).close()


def share(chances: Chances, seconds: float = 2.0, period: float = 0.05) -> float:
    """Share of some time that a process could have worked."""
    begin, had = time.monotonic(), -chances.look()
    while time.monotonic() - begin < seconds:
        time.sleep(period)  # the period of looks, not a wait
        had += chances.look()
    return had / (time.monotonic() - begin)


ENDLESS, ASLEEP = "while True: pass", "import time; time.sleep(1000)"


def test_a_process_that_gets_no_processor_has_no_chance(processor: Callable[..., subprocess.Popen[str]]) -> None:
    starved = processor(ENDLESS, os.SCHED_IDLE)
    processor(ENDLESS)
    assert share(Chances(starved.pid)) < 0.3


@pytest.mark.parametrize("is_stopped", [False, True], ids=["asleep", "stopped"])
def test_a_process_that_does_nothing_could_have_worked(
    processor: Callable[..., subprocess.Popen[str]], is_stopped: bool
) -> None:
    idle = processor(ASLEEP)
    processor(ENDLESS)
    if is_stopped:
        idle.send_signal(signal.SIGSTOP)
        while psutil.Process(idle.pid).status() != psutil.STATUS_STOPPED:
            time.sleep(0.01)
    assert share(Chances(idle.pid)) > 0.7


def test_what_a_thread_runs_counts_though_it_waits_for_others_in_between(
    processor: Callable[..., subprocess.Popen[str]],
) -> None:
    busy = processor(ENDLESS)
    processor(ENDLESS)
    chances, process = Chances(busy.pid, worker=busy.pid), psutil.Process(busy.pid)
    chances.look()
    before, had = process.cpu_times().user, 0.0
    while (ran := process.cpu_times().user - before) < 0.5:
        time.sleep(0.05)  # the period of looks, not a wait
        had += chances.look()
    assert had > 0.7 * ran


def test_who_looks_late_counts_a_fifth_of_a_second_alone(processor: Callable[..., subprocess.Popen[str]]) -> None:
    chances = Chances(processor(ASLEEP).pid)
    chances.look()
    time.sleep(1.0)  # what is measured, not a wait
    assert chances.look() <= 0.2
