"""Stamps: steps between the stamps of every stream, for what counts and what measures time."""

import numpy as np
from numpy.typing import NDArray

from teleop_core.evaluation.accumulators import Distribution, Integers
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import NO_COMMAND_NS, Topic


class StampTally:
    """Accumulator of the steps between the stamps of one topic.

    Args:
        topic: The topic.
        source: Topic whose stamps it passes on; None where it has stamps of its own.
        is_played: Whether its messages are those of a file that was replayed.
    """

    def __init__(self, topic: Topic, source: Topic | None = None, *, is_played: bool) -> None:
        self.topic, self._source, self._is_played = topic, source, is_played
        self._steps, self._holes = Distribution(), Distribution()
        self._repeats = 0

    def add(self, window: Window) -> None:
        """Take the topic's samples of a window."""
        own = window.own(self.topic)
        if own.stop > own.start:
            stamps = window.series[self.topic.name].stamp_ns[max(0, own.start - 1) : own.stop]
            # Before the first command a slave holds its pose under this stamp; 0 in old recordings.
            is_known = stamps[:-1] > NO_COMMAND_NS
            steps, is_own = np.diff(stamps)[is_known], self._is_own(window, stamps)[is_known]
            if self.topic.stamp.of:
                self._repeats += int((steps == 0).sum())
            self._steps.add(steps[steps > 0])
            self._holes.add(steps[(steps > 0) & is_own])

    def _is_own(self, window: Window, stamps: Integers) -> NDArray[np.bool_]:
        """Whether samples between two stamps were lost here, and not already in the topic that is passed on."""
        if self._source is None or not len(source := window.around(self._source)):
            return np.full(len(stamps) - 1, not self._is_played)
        known = np.sort(source.stamp_ns)
        before = np.searchsorted(known, stamps[:-1], side="right")
        between: NDArray[np.bool_] = np.searchsorted(known, stamps[1:], side="left") > before
        return between

    @property
    def period_us(self) -> int | None:
        """Nominal period: the median step, [µs]; None with fewer than two samples."""
        return self._steps.quantile_us(0.5)

    def gaps(self) -> int:
        """Samples that are missing at the nominal period.

        Holes that are passed on are those of the source, and holes of a file are its own.

        A stamp that is another topic's makes up for one that was passed over when it comes again:
        the slave holds a command when none came, and takes the newest when several did. A time of
        sampling that comes again is the same sample twice.
        """
        period = self.period_us
        if not period:
            return 0
        lost = np.maximum(np.round(self._holes.values_us / period) - 1, 0)
        return max(0, int((lost * self._holes.counts).sum()) - self._repeats)


class StampTallies:
    """Accumulator of the steps of all streams of a recording.

    Attributes:
        of: Tally per topic name; only of streams that were recorded.
    """

    def __init__(self, context: Context) -> None:
        streams = context.origin.streams
        context.read(streams)
        recorded, origin = context.bag.topics, context.origin
        sources, played = origin.sources, origin.played
        self.of = {
            t.name: StampTally(t, sources.get(t.name), is_played=t.name in played)
            for t in streams
            if t.name in recorded
        }

    def add(self, window: Window) -> None:
        """Take one window."""
        for tally in self.of.values():
            tally.add(window)
