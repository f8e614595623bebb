"""Span: the stretch of a recording that is scored, all of it unless something else is wanted.

Samples count that were recorded within the span. What they belong to may lie before it: the command
that was in force when the span began, and what teleop/state had said, hold on.
"""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from teleop_core.bags.reader import Bag
from teleop_core.errors import ParameterError
from teleop_core.evaluation.windows import Window


class Span(NamedTuple):
    """First and last log time that is scored, [ns]."""

    first_ns: int
    last_ns: int

    def cut(self, windows: Iterable[Window]) -> Iterator[Window]:
        """Windows with what lies outside of the span as context only; those beyond are left out."""
        for window in windows:
            if window.after_ns >= self.last_ns:
                return
            after_ns = max(window.after_ns, self.first_ns - 1)
            until_ns = min(window.until_ns, self.last_ns)
            if until_ns > after_ns:
                yield Window(after_ns, until_ns, window.series, window.history, window.lag)


Seconds = tuple[float, float]
"""Begin and end of a span [s] since the recording began."""


def span_of(bag: Bag, seconds: Seconds | None) -> Span | None:
    """Span of a recording; None for None: all of it.

    Args:
        bag: The recording.
        seconds: Begin and end [s] since its first message; an end beyond it is its last message.

    Raises:
        ParameterError: The span is empty, not finite, or begins after the end.
    """
    if seconds is None:
        return None
    begin, end = (float(value) for value in seconds)
    length = (bag.end_ns - bag.start_ns) * 1e-9
    if math.isnan(begin) or math.isnan(end) or not 0.0 <= begin < min(end, length):
        text = f"two times [s], 0 <= FROM < TO, FROM before the end at {length:.3f} s"
        raise ParameterError("span", (begin, end), text)
    last_ns = bag.end_ns if end >= length else bag.start_ns + round(end * 1e9)
    return Span(bag.start_ns + round(begin * 1e9), last_ns)
