"""Stamps: steps between the stamps of every stream, for metrics that count messages or measure time."""

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
        source: Topic from which the stamps are copied; None if the topic has its own stamps.
        is_played: Whether the topic's messages come from a replayed file.
    """

    def __init__(self, topic: Topic, source: Topic | None = None, *, is_played: bool) -> None:
        self.topic, self._source, self._is_played = topic, source, is_played
        self._steps, self._holes = Distribution(), Distribution()
        self._repeats = 0

    def add(self, window: Window) -> None:
        """Add the topic's samples of a window."""
        own = window.own(self.topic)
        if own.stop > own.start:
            stamps = window.series[self.topic.name].stamp_ns[max(0, own.start - 1) : own.stop]
            # Before the first command, a slave publishes its pose with this stamp; old recordings contain 0 instead.
            is_known = stamps[:-1] > NO_COMMAND_NS
            steps, is_own = np.diff(stamps)[is_known], self._is_own(window, stamps)[is_known]
            if self.topic.stamp.of:
                self._repeats += int((steps == 0).sum())
            self._steps.add(steps[steps > 0])
            self._holes.add(steps[(steps > 0) & is_own])

    def _is_own(self, window: Window, stamps: Integers) -> NDArray[np.bool_]:
        """Mask of steps in which samples were lost in this topic, and not already in its source topic."""
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
        """Number of samples that are missing at the nominal period.

        A gap that was copied from the source topic is counted at the source topic only. Gaps of a replayed file are
        not counted.

        If the stamps are copied from another topic, each repeated stamp compensates one skipped stamp: the slave
        repeats a command when no command came, and uses only the newest when several came. If the stamps are times of
        sampling, a repeated stamp is the same sample twice.
        """
        period = self.period_us
        if not period:
            return 0
        lost = np.maximum(np.round(self._holes.values_us / period) - 1, 0)
        return max(0, int((lost * self._holes.counts).sum()) - self._repeats)


class StampTallies:
    """Accumulator of the steps of all streams of a recording.

    Attributes:
        of: Tally by topic name, for recorded streams only.
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
        """Process one window."""
        for tally in self.of.values():
            tally.add(window)
