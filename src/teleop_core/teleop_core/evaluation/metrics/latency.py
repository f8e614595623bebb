"""Latency: the delay that each stage of the chain adds between the hand's sample and the slave."""

from itertools import cycle

import numpy as np

from teleop_core.evaluation import MISSING, Context, Key, Metric, TableRow, Window, fixed, number, same_stamp
from teleop_core.evaluation.accumulators import DelaySpread, Distribution, Integers
from teleop_core.evaluation.figure import DARK, FIRST, SECOND, THIRD, Figure, line
from teleop_core.evaluation.pairing import NONE
from teleop_core.graph.topics import NETWORK_SERVO_CP, Topic

_NEVER = 2**62
_BINS = 150
_COLORS = (FIRST, "#e69f00", SECOND, THIRD, DARK)
TOTAL = "total"
"""Name of the delay of the whole chain."""
ASKED = "asked"
"""Name of the configured part of the whole chain's delay."""


class LatencyMetric(Metric):
    """Delay of each stage of the chain.

    The delay of a stage is the time from the first arrival of its input at the recorder to the first arrival of its
    output with the same stamp. The delay of the first stage is measured from the stamp itself, so it includes the
    transport to the recorder.
    """

    name = "latency_ms"
    keys = (
        Key(
            "latency_ms.<stage>.median|p99|max",
            "ms",
            "delay of each stage between hand and slave: time from its input to its output, both at "
            "their arrival at the recorder. First stage: time from the stamp of the hand's sample to "
            f"the arrival of that sample; {TOTAL}: to the arrival of the last output; {ASKED}: delay "
            "that a simulated network and teleop.delays add",
        ),
    )

    def __init__(self, context: Context) -> None:
        self._chain = context.origin.chain
        self._command = self._chain[:2][-1][1]  # the first topic that is computed from the hand's sample
        self._delays = {stage: Distribution() for stage, _ in self._chain}
        self._delays[TOTAL] = Distribution()
        self._asked_ms = 1e3 * context.origin.chain_delay
        self._network = next((s for s, topic in self._chain if topic == NETWORK_SERVO_CP), "")
        context.read(topic for _, topic in self._chain)

    def add(self, window: Window) -> None:
        """Process one window."""
        before: Topic | None = None
        for stage, topic in self._chain:
            stamps, logs = _first_arrivals(window, topic)
            arrivals = logs - (stamps if before is None else _arrivals(window, before, stamps))
            self._delays[stage].add(arrivals[arrivals > -_NEVER // 2])
            before = topic
        # At the start, the last stage sends a pose that no command asked for. Only commands are counted.
        is_command = same_stamp(stamps, window.around(self._command).stamp_ns) != NONE
        self._delays[TOTAL].add((logs - stamps)[is_command])

    def values(self) -> dict[str, DelaySpread]:
        """Delay of each stage, and the configured delay if there is one."""
        found = {stage: distribution.delay() for stage, distribution in self._delays.items()}
        own = found.get(self._network, DelaySpread(0.0, 0.0, 0.0))
        parts = (own.median, own.p99, own.max)
        if any(parts) or self._asked_ms:
            found[ASKED] = DelaySpread(*(None if p is None else p + self._asked_ms for p in parts))
        return found

    def rows(self) -> list[TableRow]:
        """One row per stage: median, 99th percentile and maximum of the stage's delay."""
        rows = []
        for stage, delay in self.values().items():
            known = (delay.median, delay.p99, delay.max)
            text = MISSING if delay.max is None else "/".join(map(_short, known))
            rows.append(TableRow("latency: median/p99/max", stage.replace("_", " "), "ms", text))
        return rows

    def figures(self) -> list[Figure]:
        """Plot of the distribution of each stage's delay; a line of text if all delays are zero."""
        known = {stage: delay for stage, delay in self._delays.items() if delay.count}
        if len(known) == len(self._delays) and not any(d.values_us.any() for d in known.values()):
            return [Figure("Latency", "none, as in virtual time.", [])]
        if not any(delay.values_us.any() for delay in known.values()):
            return []
        width_us = _bin_width(list(known.values()))
        traces = []
        for (stage, delay), color in zip(self._delays.items(), cycle(_COLORS), strict=False):
            if stage in known:
                middles, shares = delay.histogram(width_us)
                trace = line(middles, shares, stage.replace("_", " "), color, 1.8, "%")
                traces.append({**trace, "line": {**trace["line"], "shape": "hvh"}})
        layout = {
            "xaxis": {"title": {"text": "delay [ms]"}},
            "yaxis": {"title": {"text": f"share per {width_us * 1e-3:g} ms [%]"}},
        }
        return [Figure("Latency per stage", _sentence(self.values()[TOTAL]), traces, layout, 340)]


def _first_arrivals(window: Window, topic: Topic) -> tuple[Integers, Integers]:
    """Stamps and log times [ns] of the window's samples, each stamp once."""
    series, own = window.around(topic), window.own(topic)
    if not len(series):
        return series.stamp_ns, series.log_ns
    is_first = np.diff(series.stamp_ns, prepend=series.stamp_ns[0] - 1)[own] != 0
    return series.stamp_ns[own][is_first], series.log_ns[own][is_first]


def _arrivals(window: Window, topic: Topic, stamps: Integers) -> Integers:
    """Log times [ns] of a topic's samples with the given stamps; far in the future for a missing sample."""
    series = window.around(topic)
    if not len(series):
        return np.full(len(stamps), _NEVER)
    partner = same_stamp(stamps, series.stamp_ns)
    return np.where(partner == NONE, _NEVER, series.log_ns[partner])


def _short(value: float | None) -> str:
    """Text of a few milliseconds."""
    if not value:
        return "0"
    return fixed(value, 2 if abs(value) < 10.0 else 1)


def _bin_width(delays: list[Distribution]) -> int:
    """Common width of bins [µs] for all stages, so that the heights of bins are comparable."""
    spans = [(delay.quantile_us(0.99) or 0) - int(delay.values_us[0]) for delay in delays]
    return max(1, -(-max(spans) // _BINS))


def _sentence(total: DelaySpread) -> str:
    return (
        f"From the sample of the hand to the slave's setpoint: {number(total.median)} ms median, "
        f"{number(total.p99)} ms for 99 of 100. Other lines: what each stage adds. "
        "The last step of a line holds all that took longer."
    )
