"""Steps: how long each step of transfers took."""

import numpy as np

from teleop_core.evaluation import Context, Key, Metric, Window
from teleop_core.graph.topics import TASK_STATE
from teleop_core.hand.tasks.transfer import STEPS

_STEP = TASK_STATE.columns.index("step")


class StepsMetric(Metric):
    """Mean time of each step of a task that has steps, [s]; a step that the recording cuts off does not count."""

    name, topics = "step_s", (TASK_STATE,)
    keys = (Key(f"step_s.{'|'.join(STEPS[1:])}", "s", "mean duration of the named step, over its completed runs"),)

    def __init__(self, _: Context) -> None:
        self._runs: list[list[float]] = [[] for _ in STEPS]  # durations of completed runs [s], by step
        self._step, self._begin_ns = 0, 0

    def add(self, window: Window) -> None:
        """Process one window; a step lasts until the first sample of another step."""
        told = window.samples(TASK_STATE)
        for ns, step in zip(told.log_ns.tolist(), told.values[:, _STEP].astype(int).tolist(), strict=True):
            if step != self._step:
                self._runs[self._step].append(1e-9 * (ns - self._begin_ns))
                self._step, self._begin_ns = step, ns

    def values(self) -> dict[str, float | None]:
        """Values named by ``keys``; None for a step that was never completed."""
        return {
            name: float(np.mean(runs)) if runs else None for name, runs in zip(STEPS[1:], self._runs[1:], strict=True)
        }
