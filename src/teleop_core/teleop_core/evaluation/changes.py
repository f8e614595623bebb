"""Changes: how much the columns of a stream rise, and when they rise or begin to fall."""

import numpy as np

from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import Topic


class Changes:
    """Accumulates changes of columns of a stream, relative to its first sample.

    Args:
        topic: The stream.
        names: Columns whose stamps of changes are stored.
    """

    def __init__(self, topic: Topic, *names: str) -> None:
        self._columns = topic.columns
        self._topic, self._first, self._peak = topic, np.empty(0), np.empty(0)
        self._last = np.empty((0, 0))  # the last two samples, which give the sign of the last change
        self._rises, self._falls = ({name: list[int]() for name in names} for _ in range(2))

    def add(self, window: Window) -> bool:
        """Process one window. Return whether any window so far contained a sample."""
        found = window.samples(self._topic)
        if len(found):
            if not len(self._first):
                self._first = self._peak = found.values[0]
                self._last = np.stack((self._first, self._first))
            signs = np.sign(np.diff(np.concatenate((self._last, found.values)), axis=0))
            for name in self._rises:
                now, before = signs[1:, self._at(name)], signs[:-1, self._at(name)]
                self._rises[name] += found.stamp_ns[now > 0.0].tolist()
                self._falls[name] += found.stamp_ns[(now < 0.0) & (before >= 0.0)].tolist()
            self._peak = np.maximum(self._peak, found.values.max(axis=0))
            self._last = np.concatenate((self._last, found.values[-2:]))[-2:]
        return len(self._first) > 0

    def _at(self, name: str) -> int:
        return self._columns.index(name)

    def risen(self, *names: str) -> list[int]:
        """Increase of each named counter column since the first sample."""
        return [int(self._last[-1, self._at(name)] - self._first[self._at(name)]) for name in names]

    def peak(self, name: str) -> float:
        """Largest value of a column."""
        return float(self._peak[self._at(name)])

    def rises(self, name: str) -> list[int]:
        """Stamps of the samples at which a column rises [ns]."""
        return self._rises[name]

    def falls(self, name: str) -> list[int]:
        """Stamps of the samples at which a column begins to fall [ns]."""
        return self._falls[name]
