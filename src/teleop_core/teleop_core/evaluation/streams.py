"""Stream scores: messages per topic, gaps in their stamps, and what each stage's delay is."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation.accumulators import Delay, Distribution, Integers
from teleop_core.evaluation.pairing import NONE, same_stamp
from teleop_core.evaluation.windows import Window
from teleop_core.topics import (
    MASTER_MEASURED_CP,
    SLAVE_SERVO_CP,
    SLAVE_SERVO_JP,
    SLAVE_SETPOINT_JS,
    Topic,
)

CHAIN = (
    ("haptic_master", MASTER_MEASURED_CP),
    ("motion_scaling", SLAVE_SERVO_CP),
    ("inverse_kinematics", SLAVE_SERVO_JP),
    ("slave_sim", SLAVE_SETPOINT_JS),
)
"""Stages and what each sends, in the order of the data."""
TOTAL = "total"
STAGES = (*(stage for stage, _ in CHAIN), TOTAL)
"""Names of delays: those of the nodes and the whole chain."""


@dataclass(frozen=True)
class TopicScore:
    """Messages of a topic, and how many are missing by their stamps (None if not a stream)."""

    count: int
    gaps: int | None


class StampTally:
    """Accumulator of the steps between the stamps of one topic."""

    def __init__(self) -> None:
        self._steps = Distribution()
        self._repeats = 0

    def add(self, window: Window, topic: Topic) -> None:
        """Take the topic's samples of a window."""
        own = window.own(topic)
        if own.stop > own.start:
            stamps = window.series[topic.name].stamp_ns[max(0, own.start - 1) : own.stop]
            # A slave without any command yet holds its pose under the stamp 0.
            steps = np.diff(stamps)[stamps[:-1] > 0]
            self._repeats += int((steps == 0).sum())
            self._steps.add(steps[steps > 0])

    @property
    def period_us(self) -> int | None:
        """Nominal period: the median step, [µs]; None with fewer than two samples."""
        return self._steps.quantile_us(0.5)

    def gaps(self) -> int:
        """Samples that are missing at the nominal period.

        A stamp that came again makes up for one that was passed over: the slave holds a command
        when none came, and takes the newest when several did.
        """
        period = self.period_us
        if not period:
            return 0
        lost = np.maximum(np.round(self._steps.values_us / period) - 1, 0)
        return max(0, int((lost * self._steps.counts).sum()) - self._repeats)


class DelayTally:
    """Accumulator of the delays of every stage.

    A stage's own delay is the time between the first arrivals, at the recorder, of what it
    answers and of its answer; both carry the same stamp. Transport to the recorder is in
    ``haptic_master``, the only stage that is measured against the stamp itself.
    """

    def __init__(self) -> None:
        self.stages = {stage: Distribution() for stage in STAGES}

    def add(self, window: Window) -> None:
        """Take the samples of a window."""
        before: Topic | None = None
        for stage, topic in CHAIN:
            stamps, logs = _first_arrivals(window, topic)
            arrivals = logs - (stamps if before is None else _arrivals(window, before, stamps))
            self.stages[stage].add(arrivals[arrivals > -_NEVER // 2])
            before = topic
        # The last stage holds what nobody sent when it starts: only commands count.
        is_command = same_stamp(stamps, _stamps(window, SLAVE_SERVO_CP)) != NONE
        self.stages[TOTAL].add((logs - stamps)[is_command])

    def delays(self) -> dict[str, Delay]:
        """Delay of each stage."""
        return {stage: distribution.delay() for stage, distribution in self.stages.items()}


_NEVER = 2**62


def _stamps(window: Window, topic: Topic) -> Integers:
    series = window.series.get(topic.name)
    return np.empty(0, np.int64) if series is None else series.stamp_ns


def _first_arrivals(window: Window, topic: Topic) -> tuple[Integers, Integers]:
    """Stamps and log times [ns] of the window's samples, each stamp once."""
    series, own = window.series.get(topic.name), window.own(topic)
    if series is None:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    is_first = np.diff(series.stamp_ns, prepend=series.stamp_ns[0] - 1)[own] != 0
    return series.stamp_ns[own][is_first], series.log_ns[own][is_first]


def _arrivals(window: Window, topic: Topic, stamps: Integers) -> Integers:
    """Log times [ns] of another topic's samples with these stamps; never is far in the future."""
    partner = same_stamp(stamps, _stamps(window, topic))
    series = window.series.get(topic.name)
    if series is None:
        return np.full(len(stamps), _NEVER)
    return np.where(partner == NONE, _NEVER, series.log_ns[partner])
