"""Network: age of the received packets at their reader, and share of lost packets.

The slave's samples have stamps of the slave's clock. They are converted to the master's clock with the clock offset in
``network/state``. The error of this conversion is at most drift times delay.
"""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation import Context, Envelope, Metric, TableRow, Window, keys_of, latest, number, row
from teleop_core.evaluation.accumulators import Distribution, Integers
from teleop_core.evaluation.figure import FIRST, SECOND, Figure, line, time_axis
from teleop_core.evaluation.metric import figure
from teleop_core.graph.signals import TICK_NS
from teleop_core.graph.topics import NETWORK_MEASURED_CP, NETWORK_SERVO_CP, NETWORK_STATE, NO_COMMAND_NS

GROUP = "network"
_WAYS = (("to the slave", NETWORK_SERVO_CP), ("from the slave", NETWORK_MEASURED_CP))
_ROUND_NS = 100_000
"""Ages are rounded down to multiples of this time [ns], because in a live session an age can have any value."""


@dataclass(frozen=True)
class WayScore:
    """Ages of packets at their reader, and losses, in one direction; values are None if nothing was recorded."""

    age_mean_ms: float | None = figure("ms", "mean age of the newest packet that has arrived")
    age_p99_ms: float | None = figure("ms", "age of the newest arrived packet that is exceeded for 1 % of the time")
    lost_share: float | None = figure("1", "share of the packets that were lost")
    packet_rate_hz: float | None = figure("Hz", "number of packets sent per second")


@dataclass(frozen=True)
class NetworkScore:
    """Scores of both directions of the network."""

    there: WayScore
    back: WayScore


class _Ages:
    """Ages of the newest message of one topic, sampled at every tick."""

    def __init__(self) -> None:
        self.ages, self.sum_ns, self.count = Distribution(), 0, 0

    def add(self, logs: Integers, stamps: Integers, after_ns: int, until_ns: int) -> Integers:
        """Process arrivals, and return the age (N,) [ns] right after each arrival.

        Args:
            logs: Times of arrival [ns]. Only the first of these times may be before ``after_ns``.
            stamps: Times of sending [ns].
            after_ns: Begin of the counted time [ns].
            until_ns: End of the counted time [ns].
        """
        begins = np.maximum(logs, after_ns)
        lengths = np.diff(np.append(begins, max(until_ns, int(begins[-1]) + TICK_NS)))
        looks = -(-lengths // TICK_NS)
        first = np.repeat(begins - stamps, looks)
        within = np.arange(len(first)) - np.repeat(np.cumsum(looks) - looks, looks)
        ages = first + within * TICK_NS
        self.ages.add(ages // _ROUND_NS * _ROUND_NS)
        self.sum_ns, self.count = self.sum_ns + int(ages.sum()), self.count + len(ages)
        found: Integers = begins - stamps
        return found

    def score(self, lost: float | None, rate: float | None) -> WayScore:
        """Mean and 99th percentile, with losses and rate of packets."""
        if not self.count:
            return WayScore(None, None, lost, rate)
        return WayScore(1e-6 * self.sum_ns / self.count, self.ages.delay().p99, lost, rate)


def _clock_ahead_ns(window: Window, logs: Integers) -> Integers:
    """Offset of the slave's clock at the given times (N,) [ns]; positive if the clock was ahead, 0 if unknown."""
    told, column = window.around(NETWORK_STATE), NETWORK_STATE.columns.index("clock_ahead")
    if not len(told) or told.values.shape[1] <= column:
        return np.zeros_like(logs)
    at = np.maximum(latest(logs, told.log_ns), 0)
    ahead: Integers = np.round(1e9 * told.values[at, column]).astype(np.int64)
    return ahead


class NetworkMetric(Metric):
    """Ages and losses of the network between both sides."""

    name = "network"
    keys = (*keys_of("network.there", WayScore), *keys_of("network.back", WayScore))
    topics = (NETWORK_SERVO_CP, NETWORK_MEASURED_CP, NETWORK_STATE)

    def __init__(self, context: Context) -> None:
        bag = context.bag
        self._end_ns = bag.end_ns
        self._ways = tuple(_Ages() for _ in _WAYS)
        self._traces = tuple(Envelope(bag.start_ns, bag.end_ns, columns=1) for _ in _WAYS)
        self._first: list[float] | None = None
        self._last: list[float] = []

    def add(self, window: Window) -> None:
        """Process one window."""
        for ages, trace, (_, topic) in zip(self._ways, self._traces, _WAYS, strict=True):
            around, own = window.around(topic), window.own(topic)
            known = slice(max(own.start - 1, 0), own.stop)
            logs, stamps = around.log_ns[known], around.stamp_ns[known]
            has_come = stamps > NO_COMMAND_NS
            logs, stamps = logs[has_come], stamps[has_come]
            if not len(logs):
                continue
            if topic is NETWORK_MEASURED_CP:
                stamps = stamps - _clock_ahead_ns(window, logs)
            until_ns = min(window.until_ns, self._end_ns)
            found = ages.add(logs, stamps, max(window.after_ns, int(logs[0])), until_ns)
            shown = (1e-6 * found[:, np.newaxis]).astype(np.float64)
            trace.add(np.maximum(logs, window.after_ns), shown)
        told = window.samples(NETWORK_STATE).values
        if len(told):
            stamps = window.samples(NETWORK_STATE).stamp_ns
            self._first = self._first or [int(stamps[0]), *told[0].tolist()]
            self._last = [int(stamps[-1]), *told[-1].tolist()]

    def _packets(self, k: int) -> tuple[float | None, float | None]:
        """Share of lost packets, and packets sent per second; None if unknown."""
        if self._first is None:
            return None, None
        ns = self._last[0] - self._first[0]
        sent, lost = (self._last[3 * k + i] - self._first[3 * k + i] for i in (1, 2))
        return lost / sent if sent else None, 1e9 * sent / ns if ns else None

    def values(self) -> NetworkScore:
        """Score of everything so far."""
        there, back = (ages.score(*self._packets(k)) for k, ages in enumerate(self._ways))
        return NetworkScore(there, back)

    def rows(self) -> list[TableRow]:
        """Ages and losses of both directions; empty without a network."""
        found, score = [], self.values()
        for (name, _), way in zip(_WAYS, (score.there, score.back), strict=True):
            if way.lost_share is None:
                continue
            found += [
                row(GROUP, f"age {name}, mean", "ms", way.age_mean_ms),
                row(GROUP, f"age {name}, 99 %", "ms", way.age_p99_ms),
                row(GROUP, f"lost {name}", "%", 100.0 * way.lost_share),
                row(GROUP, f"packets {name}", "Hz", way.packet_rate_hz),
            ]
        return found

    def figures(self) -> list[Figure]:
        """Plot of the ages against time; no plot without a network."""
        score, traces = self.values(), []
        for (name, _), trace, color in zip(_WAYS, self._traces, (FIRST, SECOND), strict=True):
            times, values = trace.line()
            if len(times):
                traces.append(line(times, values[:, 0], name, color, 1.2, "ms"))
        if not traces:
            return []
        layout = {"xaxis": time_axis(), "yaxis": {"title": {"text": "age [ms]"}}, "hovermode": "x unified"}
        text = (
            f"What its reader has is {number(score.there.age_mean_ms)} ms old on average on the "
            f"way to the slave, {number(score.back.age_mean_ms)} ms on the way back."
        )
        return [Figure("Age of what arrives", text, traces, layout, 300)]
