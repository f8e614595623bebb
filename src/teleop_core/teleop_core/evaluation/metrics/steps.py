"""Steps: how long each step of a transfer took."""

import numpy as np

from teleop_core.evaluation import Context, Key, Metric, Window
from teleop_core.graph.topics import TASK_STATE
from teleop_core.hand.tasks.transfer import STEPS

_ATTEMPTS, _STEP = (TASK_STATE.columns.index(name) for name in ("attempts", "step"))


class StepsMetric(Metric):
    """Mean time of each step over the attempts at a task that has steps, [s]."""

    name, topics = "step_s", (TASK_STATE,)
    keys = (Key(f"step_s.{'|'.join(STEPS[1:])}", "s", "mean duration of the named step of a transfer"),)

    def __init__(self, _: Context) -> None:
        self._times, self._last, self._tried = np.zeros(len(STEPS)), (0, 0), 0.0

    def add(self, window: Window) -> None:
        """Process one window; a step lasts until the first sample of another step."""
        told, (log_ns, step) = window.samples(TASK_STATE), self._last
        for ns, row in zip(told.log_ns.tolist(), told.values, strict=True):
            self._times[step] += 1e-9 * (ns - (log_ns or ns))
            log_ns, step, self._tried = ns, int(row[_STEP]), row[_ATTEMPTS]
        self._last = log_ns, step

    def values(self) -> dict[str, float | None]:
        """Values named by ``keys``; None if there are no steps, or before the end of the first transfer."""
        count = self._tried if self._times[1:].any() else 0.0
        means = [float(time) / count if count else None for time in self._times[1:]]
        return dict(zip(STEPS[1:], means, strict=True))
