"""Breaks: times in which the recording has no messages, and times in which the arm was stopped.

Both explain other figures, so a verdict names them first.
"""

from contextlib import suppress

import numpy as np

from teleop_core.evaluation import TRACKED, Context, Key, Metric, Window
from teleop_core.evaluation.metric import figure
from teleop_core.graph.operation import State
from teleop_core.graph.topics import SLAVE_OPERATION

_SHORTEST_NS = 100_000_000  # a shorter silence is no gap [ns]
_PERIODS = 20.0  # a gap is longer than this many periods of the messages


class GapMetric(Metric):
    """Longest time without a message of the slave's poses, setpoints and commands."""

    name, topics = "gap", TRACKED
    longest_s = figure("s", "longest time without any message of the slave; null without such a gap")
    at_s = figure("s", "begin of the longest gap, since the first message")
    _last_ns, _longest_ns = 0, 0

    def __init__(self, context: Context) -> None:
        self._start_ns = context.bag.start_ns

    def add(self, window: Window) -> None:
        """Process one window."""
        times = np.unique(np.concatenate([window.samples(topic).log_ns for topic in TRACKED]))
        if not len(times):
            return
        steps = np.diff(times, prepend=self._last_ns or times[0])
        at, self._last_ns = int(steps.argmax()), int(times[-1])
        if steps[at] > max(_SHORTEST_NS, _PERIODS * float(np.median(steps)), self._longest_ns):
            self._longest_ns = int(steps[at])
            self.longest_s = 1e-9 * self._longest_ns
            self.at_s = 1e-9 * (int(times[at]) - self._longest_ns - self._start_ns)


class HaltMetric(Metric):
    """Time for which a fault or a stop kept the arm from following, from ``slave/operation``."""

    name = "halt"
    keys = (
        Key("halt.share", "1", "share of the recording in which a fault or a stop kept the arm from following"),
        Key("halt.at_s", "s", "begin of the first such time, since the first message; null if there is none"),
        Key("halt.reason", "1", "state and fault then; null if there is none"),
    )

    def __init__(self, context: Context) -> None:
        bag, self._found = context.bag, dict[str, float | str | None](share=0.0, at_s=None, reason=None)
        info = bag.topics.get(SLAVE_OPERATION.name)
        is_report = info is not None and info.count > 0 and info.type == SLAVE_OPERATION.kind.ros_type
        reports = bag.reports(SLAVE_OPERATION) if is_report else []
        ends = [*(report.stamp_ns for report in reports[1:]), bag.end_ns][: len(reports)]
        total = 0.0
        for report, end_ns in zip(reports, ends, strict=True):
            state, fault = (_number(report.values.get(name)) for name in ("state", "fault"))
            if state in (None, State.ENABLED) or not fault:  # no numbers: a report of another writer
                continue
            begin_ns = max(report.stamp_ns, bag.start_ns)
            total += max(0.0, 1e-9 * (end_ns - begin_ns))
            if self._found["reason"] is None:
                self._found |= {"at_s": 1e-9 * (begin_ns - bag.start_ns), "reason": report.message}
        self._found["share"] = min(1.0, total / max(1e-9 * (bag.end_ns - bag.start_ns), 1e-9))

    def add(self, window: Window) -> None:
        """Do nothing: reports are not streams."""

    def values(self) -> dict[str, float | str | None]:
        """Values named by ``keys``."""
        return self._found


def _number(text: str | None) -> float | None:
    """Number that a report states; None without one."""
    with suppress(ValueError):
        return None if text is None else float(text)
    return None
