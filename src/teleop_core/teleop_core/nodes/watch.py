"""Watch: the thread that ends a process, whatever its other threads are doing.

It waits for signals and for the end of the parent, reports to the parent what the process is doing, and detects loops
that hang. It asks the main thread to end the process in order. If the main thread does not react, this thread closes
the recording and ends the process.
"""

import os
import select
import signal
import threading
import time
from dataclasses import dataclass
from typing import Protocol

from teleop_core.kernels.progress import in_work
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.chances import Chances
from teleop_core.nodes.loop import Loop
from teleop_core.nodes.parent import Parent

ENDS = tuple(number for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT))
"""Signals that ask for an orderly end: Ctrl-C, a supervisor, a closed terminal, Ctrl-\\."""
_PERIOD = 0.1  # time between two checks [s]
_END_PATIENCE = 4.0  # longest time until the main thread begins the end [s]
_LEAVE_PATIENCE = 5.0  # longest time until the middleware is closed [s]
_FLUSH_PATIENCE = 20.0  # longest time until the recording is closed; a slow disk needs time [s]


class Crew(Protocol):
    """Nodes of one process: one node, or several nodes that are started in this order."""

    @property
    def nodes(self) -> tuple[CoreNode, ...]:
        """Nodes of the process, in the order in which they are started."""
        ...

    def watched(self) -> list[tuple[Loop, int]]:
        """The running loops, each with a number that grows as long as the loop makes progress."""
        ...

    def halt(self) -> None:
        """Stop the loop that several nodes share."""
        ...


def signal_pipe() -> int:
    """Pipe to which the signals of :data:`ENDS` are written.

    A pipe interrupts no work halfway, and the middleware still exists for an orderly end. A handler in Python would
    not run while the main thread waits in C code. Signals that are ignored from the start stay ignored, such as SIGHUP
    under ``nohup``.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing)
    for number in ENDS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: None)
    return reading


@dataclass
class _Stillness:
    """Time without progress of a loop.

    ``number`` is the last count of its progress; ``time`` is the processor time that it could have used since then
    [s].
    """

    chances: Chances
    number: int
    time: float = 0.0


class Watch:
    """Watching thread of a process; runs from its construction to the end of the process.

    Args:
        crew: Nodes to watch.
        signals: Pipe of :func:`signal_pipe`.
        parent: Connection to the parent, if there is one.

    Attributes:
        word: Activity of the process: starting, at work, ending, leaving.
    """

    def __init__(self, crew: Crew, signals: int, parent: Parent | None) -> None:
        self.word = "starting"
        self._crew, self._signals, self._parent = crew, signals, parent
        self._first = crew.nodes[0]
        self._still: dict[Loop, _Stillness] = {}
        self._asked: float | None = None
        self._leaving = 0
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        files: list[int | Parent] = [self._signals]
        if self._parent is not None:
            files.append(self._parent)
        while True:
            ready = select.select(files, (), (), _PERIOD)[0]
            if self._signals in ready:
                os.read(self._signals, 64)
                self._ask(0)
            if self._parent in ready and self._parent is not None and self._parent.has_gone():
                files.remove(self._parent)
                self._first.ros.get_logger().error(
                    "the session that started this process has ended; this process ends too"
                )
                self._ask(0)
            if not ready:
                self._look()

    def _look(self) -> None:
        """Do the periodic checks, ten times a second."""
        if self._parent is not None:
            self._parent.tell(self._doing())
        if self._asked is None and self._first.ended.done():  # the loop of a node failed
            self._asked = time.monotonic()
        if in_work():
            self._still.clear()
        elif self._asked is None:
            self._find_hung()
        if self.word == "leaving":
            self._await_leave()
        elif self._asked is not None:
            patience = _FLUSH_PATIENCE if self.word == "ending" else _END_PATIENCE
            if time.monotonic() - self._asked > patience:
                self._leave()

    def _await_leave(self) -> None:
        """Exit with success if the middleware blocks the end, because all important work is already done."""
        self._leaving += 1
        if self._leaving * _PERIOD > _LEAVE_PATIENCE:
            os._exit(0)

    def _doing(self) -> str:
        return in_work() or self.word

    def _find_hung(self) -> None:
        """Find loops that made no progress although they had processor time."""
        still: dict[Loop, _Stillness] = {}
        own = threading.get_native_id()  # the thread runs now, whatever its account shows
        threads = {t.native_id or own for t in threading.enumerate()} - {own}
        for loop, number in self._crew.watched():
            one = self._still.get(loop) or _Stillness(Chances(os.getpid(), loop.thread), number)
            chance = one.chances.look(threads)
            one.time = one.time + chance if number == one.number else 0.0
            one.number, still[loop] = number, one
            if 0.0 < loop.patience <= one.time and loop.is_alive:
                self._give_up(loop)
        self._still = still

    def _give_up(self, loop: Loop) -> None:
        loop.is_hung = True
        text = f"{loop.name} hangs: it made no progress for {loop.patience:g} s in which it could "
        text += "work; it is here:"
        self._first.ros.get_logger().fatal(f"{text}\n{loop.place()}")
        self._ask(1)

    def _ask(self, exit_code: int) -> None:
        """Ask the main thread to end the process."""
        self._asked = self._asked or time.monotonic()
        self._first.end(exit_code)

    def _leave(self) -> None:
        """End the process without the main thread, which hangs or compiles."""
        code = max(node.exit_code for node in self._crew.nodes)
        self._first.ros.get_logger().error(f"cannot shut down in order ({self._doing()}): the process ends at once")
        is_starting = self.word == "starting"
        try:
            for node in self._crew.nodes:
                node.abandon()
        finally:
            os._exit(code if is_starting else max(code, 1))
