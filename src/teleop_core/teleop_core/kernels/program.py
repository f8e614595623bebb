"""Program: a list of copies and calls that one compiled loop runs, whatever they copy and call.

The list consists of numbers: addresses of memory and of kernels. So another list compiles nothing.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from teleop_core import kernels
from teleop_core.kernels.addresses import addressed, call_address, copy_memory, word_at
from teleop_core.kernels.fields import Fields, Integers, record

_COPY, _CALL, _UNLESS = 0, 1, 2
_WIDTH = 6


class Clock(Fields):
    """Times of the ticks of a run, and their number."""

    first_ns: int
    tick_ns: int
    count: int
    now_ns: int


class Program:
    """A list of copies and calls, which :meth:`run` executes once per tick.

    Attributes:
        clock: Times of the ticks of the next run; its field ``now_ns`` can be copied like other memory.
        now_ns: Array of that field.
    """

    def __init__(self) -> None:
        self.clock = record(Clock)
        self.now_ns = np.asarray(self.clock)["now_ns"]
        self._steps: list[list[int]] = []
        self._sealed = 0
        self._held: list[object] = []
        self._run: Callable[[], object] | None = None

    def copy(self, source: Any, target: Any, *, from_rows: bool = False, to_rows: bool = False) -> None:
        """Copy an array to another array of the same size.

        Args:
            source: Contiguous array.
            target: Contiguous array.
            from_rows: Whether tick ``i`` of a run reads row ``i`` of the source, whose rows are contiguous.
            to_rows: Whether tick ``i`` of a run writes row ``i`` of the target.
        """
        size = (target[0] if to_rows else target).nbytes
        strides = [rows.strides[0] if is_rows else 0 for rows, is_rows in ((source, from_rows), (target, to_rows))]
        step = [_COPY, source.ctypes.data, strides[0], target.ctypes.data, strides[1], size]
        self._held += [source, target]
        if len(self._steps) > self._sealed and _continues(self._steps[-1], step):
            self._steps[-1][5] += size
        elif size:
            self._steps.append(step)

    def call(self, function: Callable[..., object], *arguments: object) -> None:
        """Call a kernel, or a plain Python function, whose exception ends the run.

        Raises:
            KernelError: The kernel cannot be compiled for these arguments.
        """
        made = addressed(function if kernels.is_kernel(function) else self._ending(function), *arguments)
        self._held.append(made)
        self._steps.append([_CALL, made.address, made.block_address])

    def _ending(self, function: Callable[..., object]) -> Callable[..., object]:
        """Plain function whose exception makes the present tick the last one."""

        def call(*arguments: object) -> None:
            try:
                function(*arguments)
            except BaseException:
                self.clock.count = 0
                raise

        return call

    @contextmanager
    def unless_equal(self, new: Any, known: Any) -> Iterator[None]:
        """Skip the steps that are added in this context if two integers are equal; otherwise copy ``new`` to ``known``.

        Args:
            new: Array of one int64.
            known: Array of one int64.
        """
        step = [_UNLESS, new.ctypes.data, known.ctypes.data, 0]
        self._held += [new, known]
        self._steps.append(step)
        self._sealed = begin = len(self._steps)
        yield
        self._sealed = len(self._steps)
        step[3] = self._sealed - begin

    def run(self) -> None:
        """Execute the list for each tick of the clock.

        The exceptions of plain Python functions are stored for :func:`~teleop_core.kernels.raise_pending`.
        """
        if self._run is None:
            table = np.array([step + [0] * (_WIDTH - len(step)) for step in self._steps], np.int64)
            self._run = kernels.bound(_execute, table.reshape(-1, _WIDTH), self.clock)
        self._run()


def _continues(before: list[int], step: list[int]) -> bool:
    """Whether a copy continues where the copy before it ends, so that both are one."""
    _, source, source_stride, target, target_stride, size = before if before[0] == _COPY else [0] * _WIDTH
    return size > 0 and step[:5] == [_COPY, source + size, source_stride, target + size, target_stride]


@kernels.kernel
def _execute(table: Integers, clock: Clock) -> None:
    """Execute the steps of a program for each tick."""
    i = 0
    while i < clock.count:
        clock.now_ns = clock.first_ns + i * clock.tick_ns
        at = 0
        while at < table.shape[0]:
            kind = table[at, 0]
            if kind == _COPY:
                source, target = table[at, 1] + i * table[at, 2], table[at, 3] + i * table[at, 4]
                copy_memory(source, target, table[at, 5])
            elif kind == _CALL:
                call_address(table[at, 1], table[at, 2])
            elif word_at(table[at, 1]) == word_at(table[at, 2]):
                at += table[at, 3]
            else:
                copy_memory(table[at, 1], table[at, 2], 8)
            at += 1
        i += 1
