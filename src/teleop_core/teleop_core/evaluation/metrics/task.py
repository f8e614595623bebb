"""Task: what an operator made of a task: attempts, errors, times, throughput."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation import Context, Metric, Row, Window, keys_of
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import DISPLAY_MEASURED_CP, NO_COMMAND_NS, TASK_STATE

_ATTEMPTS, _SUCCESSES, _WAY, _OFF, _TIME, _MISS = (
    TASK_STATE.columns.index(name) for name in ("attempts", "successes", "way", "off", "time", "miss")
)
_KINDS = ("beside", "late", "forced", "dropped", "wrong")  # of Miss, from 1 on
EFFECTIVE = 4.133
"""Effective width in standard deviations of the end points: 96 % of a normal distribution."""


@dataclass(frozen=True)
class TaskScore:
    """What came of a task; None without one, or where too little was tried."""

    attempts: int | None = figure("1", "attempts at a goal", "attempts")
    successes: int | None = figure("1", "attempts that ended within the goal's width", "successes")
    error_share: float | None = figure("1", "share of the attempts that ended outside of it", "errors")
    time_s: float | None = figure(
        "s",
        "mean time of an attempt, from when its goal was set; of four or more, without the first, "
        "which begins while the arm is led in",
        "time of an attempt, mean",
    )
    throughput: float | None = figure(
        "bit/s", "log2(mean way / effective width + 1) over the mean time, without the first attempt", "throughput"
    )
    effective_width_mm: float | None = figure(
        "mm", "4.133 standard deviations of the end points along their ways", "effective width"
    )
    beside: int | None = figure("1", "errors: it ended beside the goal", "errors: beside")
    late: int | None = figure("1", "errors: it took too long", "errors: late")
    forced: int | None = figure("1", "errors: it pressed too hard", "errors: forced")
    dropped: int | None = figure("1", "errors: what was carried came to rest beside its goal", "errors: dropped")
    wrong: int | None = figure("1", "errors: what was carried came to rest on another one's goal", "errors: wrong")


class TaskMetric(Metric):
    """Counts and times of the attempts that ``task/state`` tells.

    Source:
        ISO/TS 9241-411 2012, annex B, for throughput and effective width.
    """

    name = "task"
    keys = keys_of("task", TaskScore)
    topics = (TASK_STATE,)

    def __init__(self, _: Context) -> None:
        self._tried: list[np.ndarray] = []
        self._count = np.nan  # of the attempts in the last sample
        self._before = 0.0  # successes before the first sample

    def add(self, window: Window) -> None:
        """Take one window."""
        told = window.samples(TASK_STATE).values
        if len(told):
            if np.isnan(self._count):
                self._before = told[0, _SUCCESSES]
            counts = np.append(self._count, told[:, _ATTEMPTS])
            self._tried += list(told[np.diff(counts) > 0.0])
            self._count = counts[-1]

    def values(self) -> TaskScore:
        """Score of everything so far."""
        if np.isnan(self._count):
            return TaskScore(*[None] * 11)
        if not self._tried:
            return TaskScore(0, 0, *[None] * 4, *[0] * len(_KINDS))
        tried = np.array(self._tried)
        count = len(tried)
        later = tried[1:] if count >= 4 else tried
        time = float(later[:, _TIME].mean())
        successes = int(tried[-1, _SUCCESSES] - self._before)
        errors = 1.0 - successes / count
        kinds = [int((tried[:, _MISS] == kind + 1.0).sum()) for kind in range(len(_KINDS))]
        if count < 4:
            return TaskScore(count, successes, errors, time, None, None, *kinds)
        width = EFFECTIVE * float(later[:, _OFF].std(ddof=1))
        way = float(later[:, _WAY].mean())
        bits = float(np.log2(way / width + 1.0)) if width > 0.0 else None
        rate = None if bits is None else bits / time
        return TaskScore(count, successes, errors, time, rate, 1e3 * width, *kinds)

    def rows(self) -> list[Row]:
        """All but the kinds of error that did not occur."""
        return [one for one in super().rows() if not one.label.startswith("errors: ") or one.value != "0"]


@dataclass(frozen=True)
class DisplayScore:
    """How late the operator saw the slave; None without a display."""

    age_mean_ms: float | None = figure(
        "ms", "mean age of the newest frame that was on the screen", "age of what is seen, mean"
    )
    rate_hz: float | None = figure("Hz", "frames with another pose that were shown in a second", "frames")


class DisplayMetric(Metric):
    """Age of what the operator saw, from when the slave was there to the end of each frame."""

    name = "display"
    keys = keys_of("display", DisplayScore)
    topics = (DISPLAY_MEASURED_CP,)

    def __init__(self, _: Context) -> None:
        self._log_ns = self._stamp_ns = NO_COMMAND_NS  # of the newest frame
        self._frames, self._span_s, self._seen = 0, 0.0, 0.0

    def add(self, window: Window) -> None:
        """Take one window."""
        shown = window.samples(DISPLAY_MEASURED_CP)
        # A stamp that is none is of a screen that is dark yet.
        is_new = np.diff(shown.stamp_ns, prepend=self._stamp_ns) > 0
        if not is_new.any():
            return
        logs = np.append(self._log_ns, shown.log_ns[is_new])
        stamps = np.append(self._stamp_ns, shown.stamp_ns[is_new])
        first = int(self._frames == 0)  # nothing was shown before it
        until = 1e-9 * np.diff(logs)[first:]
        # An age grows from the frame's arrival to that of the next one.
        ages = 1e-9 * (logs[:-1] - stamps[:-1])[first:] + 0.5 * until
        self._seen += float((ages * until).sum())
        self._span_s += float(until.sum())
        self._frames += int(is_new.sum())
        self._log_ns, self._stamp_ns = int(logs[-1]), int(stamps[-1])

    def values(self) -> DisplayScore:
        """Score of everything so far."""
        if not self._span_s:
            return DisplayScore(None, None)
        return DisplayScore(1e3 * self._seen / self._span_s, (self._frames - 1) / self._span_s)
