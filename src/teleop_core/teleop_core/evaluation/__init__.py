"""Evaluation: what a recording is worth, in numbers, tables and plots.

:func:`evaluate` scores one arm of a recording, :func:`scores` all of them. What is measured are
metrics, one file each in ``evaluation/metrics``; a user's own is a class below :class:`Metric` that
is added to :data:`METRICS`, and stands in every table, page and JSON from then on.
"""

from teleop_core.evaluation.accumulators import Delay, Distribution, Moments, Spread
from teleop_core.evaluation.context import Context
from teleop_core.evaluation.figure import Figure, line, time_axis
from teleop_core.evaluation.metric import Key, Metric
from teleop_core.evaluation.registry import METRICS
from teleop_core.evaluation.rows import Row, row, spread_rows
from teleop_core.evaluation.score import Score, Session, frame_of, key_table, keys
from teleop_core.evaluation.scoring import evaluate, measure, scores
from teleop_core.evaluation.traces import Envelope
from teleop_core.evaluation.tracking import Tracked, tracked
from teleop_core.evaluation.windows import Window

__all__ = [
    "METRICS",
    "Context",
    "Delay",
    "Distribution",
    "Envelope",
    "Figure",
    "Key",
    "Metric",
    "Moments",
    "Row",
    "Score",
    "Session",
    "Spread",
    "Tracked",
    "Window",
    "evaluate",
    "frame_of",
    "key_table",
    "keys",
    "line",
    "measure",
    "register_metric",
    "row",
    "scores",
    "spread_rows",
    "time_axis",
    "tracked",
]


def register_metric(metric: type[Metric], *, replace: bool = False) -> type[Metric]:
    """Add a metric under its own name for the rest of the program; see :meth:`Registry.add`."""
    fallback = getattr(metric, "__name__", type(metric).__name__)
    return METRICS.add(getattr(metric, "name", fallback), metric, replace=replace)
