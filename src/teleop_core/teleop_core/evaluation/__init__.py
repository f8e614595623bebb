"""Evaluation: scores of a recording, as numbers, tables and plots.

:func:`evaluate` scores one arm of a recording, :func:`scores` all arms. Each measured quantity is a metric, a file in
``evaluation/metrics``. A user's own metric is a subclass of :class:`Metric` that is added to :data:`METRICS`; from
then on it appears in every table, page and JSON file.
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from teleop_core.evaluation.accumulators import *  # noqa: F403
    from teleop_core.evaluation.context import *  # noqa: F403
    from teleop_core.evaluation.figure import *  # noqa: F403
    from teleop_core.evaluation.metric import SPREAD_MEANING as SPREAD_MEANING
    from teleop_core.evaluation.metric import Key as Key
    from teleop_core.evaluation.metric import Metric as Metric
    from teleop_core.evaluation.metric import keys_of as keys_of
    from teleop_core.evaluation.pairing import *  # noqa: F403
    from teleop_core.evaluation.registry import *  # noqa: F403
    from teleop_core.evaluation.rows import *  # noqa: F403
    from teleop_core.evaluation.score import *  # noqa: F403
    from teleop_core.evaluation.scoring import *  # noqa: F403
    from teleop_core.evaluation.traces import *  # noqa: F403
    from teleop_core.evaluation.tracking import *  # noqa: F403
    from teleop_core.evaluation.windows import *  # noqa: F403
else:  # imported when they are first used
    _NAMES = {
        "accumulators": ("DelaySpread", "Distribution", "Integers", "Moments", "Spread"),
        "context": ("Context",),
        "figure": ("COMMAND", "DARK", "FIRST", "FIXTURE", "Figure", "MEASURED", "SECOND", "THIRD", "axis_suffix",
            "line", "time_axis"),
        "metric": ("Key", "Metric", "SPREAD_MEANING", "keys_of"),
        "pairing": ("latest", "same_stamp"),
        "registry": ("METRICS", "register_metric"),
        "rows": ("MISSING", "TableRow", "error_rows", "fixed", "number", "row", "spread_rows"),
        "score": ("Score", "Session", "frame_of", "key_table", "keys"),
        "scoring": ("evaluate", "measure", "scores", "study"),
        "traces": ("Envelope", "spacing_s"),
        "tracking": ("TRACKED", "Tracked", "tracked"),
        "windows": ("Window",),
    }  # fmt: skip
    __getattr__, __dir__, __all__ = lazy_loader.attach(__name__, None, _NAMES)
