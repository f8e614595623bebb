"""Stamps: steps between the stamps of every stream, for what counts and what measures time."""

import numpy as np

from teleop_core.evaluation.accumulators import Distribution
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import NO_COMMAND_NS, Topic


class StampTally:
    """Accumulator of the steps between the stamps of one topic.

    Attributes:
        topic: The topic.
    """

    def __init__(self, topic: Topic) -> None:
        self.topic, self._steps = topic, Distribution()
        self._repeats = 0

    def add(self, window: Window) -> None:
        """Take the topic's samples of a window."""
        own = window.own(self.topic)
        if own.stop > own.start:
            stamps = window.series[self.topic.name].stamp_ns[max(0, own.start - 1) : own.stop]
            # Before the first command a slave holds its pose under this stamp; 0 in old recordings.
            steps = np.diff(stamps)[stamps[:-1] > NO_COMMAND_NS]
            if self.topic.stamp.of:
                self._repeats += int((steps == 0).sum())
            self._steps.add(steps[steps > 0])

    @property
    def period_us(self) -> int | None:
        """Nominal period: the median step, [µs]; None with fewer than two samples."""
        return self._steps.quantile_us(0.5)

    def gaps(self) -> int:
        """Samples that are missing at the nominal period.

        A stamp that is another topic's makes up for one that was passed over when it comes again:
        the slave holds a command when none came, and takes the newest when several did. A time of
        sampling that comes again is the same sample twice.
        """
        period = self.period_us
        if not period:
            return 0
        lost = np.maximum(np.round(self._steps.values_us / period) - 1, 0)
        return max(0, int((lost * self._steps.counts).sum()) - self._repeats)


class StampTallies:
    """Accumulator of the steps of all streams of a recording.

    Attributes:
        of: Tally per topic name; only of streams that were recorded.
    """

    def __init__(self, context: Context) -> None:
        streams = context.origin.streams
        context.read(streams)
        recorded = context.bag.topics
        self.of = {topic.name: StampTally(topic) for topic in streams if topic.name in recorded}

    def add(self, window: Window) -> None:
        """Take one window."""
        for tally in self.of.values():
            tally.add(window)
