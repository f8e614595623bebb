"""Attempts at a task's goals, from ``task/state``, and the base class of metrics about them."""

from abc import abstractmethod

import numpy as np

from teleop_core.evaluation.context import Context
from teleop_core.evaluation.metric import Metric
from teleop_core.evaluation.plain import Values
from teleop_core.evaluation.windows import Window
from teleop_core.graph.topics import TASK_STATE
from teleop_core.kernels.geometry import Array

_ATTEMPTS, _SUCCESSES = (TASK_STATE.columns.index(name) for name in ("attempts", "successes"))


class Attempts:
    """Accumulates the attempts at a task's goals; an attempt is a sample of ``task/state`` that counts one more.

    Attributes:
        successes: Number of attempts that reached their goal; None without a task.
    """

    def __init__(self, _: Context) -> None:
        self.successes: int | None = None
        self._tried: list[Array] = []
        self._attempts = np.nan  # number of attempts in the last sample
        self._before = 0.0  # number of successes in the first sample

    def add(self, window: Window) -> None:
        """Process one window."""
        told = window.samples(TASK_STATE).values
        if len(told):
            if self.successes is None:
                self._before = told[0, _SUCCESSES]
            self._tried += list(told[np.diff(told[:, _ATTEMPTS], prepend=self._attempts) > 0.0])
            self._attempts, self.successes = told[-1, _ATTEMPTS], int(told[-1, _SUCCESSES] - self._before)

    @property
    def count(self) -> int:
        """Number of attempts."""
        return len(self._tried)

    def column(self, name: str) -> Array:
        """A column of ``task/state`` at the end of each attempt (count,)."""
        return np.array([row[TASK_STATE.columns.index(name)] for row in self._tried])

    def settled(self, name: str) -> Array:
        """A column of ``task/state`` at the end of each attempt; if there are four or more, the first is left out.

        The first attempt begins while the arm is still moved to its start.
        """
        return self.column(name)[int(self.count >= 4) :]


class AttemptsMetric(Metric):
    """Measure of the attempts at a task's goals."""

    topics = (TASK_STATE,)

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._attempts = context.shared(Attempts)

    @abstractmethod
    def judge(self, tried: Attempts) -> None:
        """Set the values of this metric from the attempts; called only if the recording contains a task."""

    def add(self, window: Window) -> None:
        """Do nothing: :class:`Attempts` processes each window once for all metrics."""

    def values(self) -> Values:
        """Values of all attempts so far; None without a task."""
        if self._attempts.successes is not None:
            self.judge(self._attempts)
        return super().values()
