"""Grading: motion scores of every episode of a data set, the most unusual episode first.

Grading needs no ROS and no arm: an episode is the motion of a hand. A score is missing if the data set lacks its data.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from teleop_core.bags.reader import Bag
from teleop_core.base.errors import ParameterError, RecordingError
from teleop_core.evaluation import measure
from teleop_exchange import ImportOptions, import_episodes

if TYPE_CHECKING:
    import pandas

FIGURES = (
    "time_s", "path_mm", "speed_median_mm_s", "speed_p95_mm_s", "acceleration_p95_m_s2",
    "idle_share", "peaks_per_s", "reversals", "sparc",
)  # fmt: skip
"""Scores (see :doc:`scores`, keys below ``motion.hand``) by which an episode is graded."""
_TINY = 1e-9  # avoids a division by zero
_ROUNDING = 1e-6  # a median absolute deviation below this share of the median counts as 0
ODD, WORST, REASON = "odd", "most_odd", "reason"
_NORMAL = 1.4826  # standard deviation of a normal distribution, divided by its median absolute deviation
_NORMAL_MEAN = 1.2533  # the same for the mean absolute deviation
_LEAST_SHARE = 0.01  # smallest spread of a score, as a share of its median
_LEAST_SPREAD = {"reversals": 1.0, "peaks_per_s": 0.1, "idle_share": 0.01}
"""Smallest spread of scores that have few values or are often 0."""


def grade(
    data: Path | str,
    *,
    figures: Sequence[str] = FIGURES,
    options: ImportOptions | None = None,
    recordings: Path | str | None = None,
    say: Callable[[str], object] = lambda _: None,
) -> "pandas.DataFrame":
    """Return the scores of every episode, the oddest episode first.

    The oddness of a score is its deviation from the median of all episodes, in robust standard deviations (1.4826 times
    the median absolute deviation). If more than half of the episodes share a value, this is 0; then it is 1.2533 times
    the mean absolute deviation of the others, at least 1 % of the median. The oddness of an episode is that of its
    oddest score. A large oddness means that an episode should be inspected, not that it is wrong.

    Args:
        data: Folder of a LeRobot data set, or a table with a column of episodes.
        figures: Keys below ``motion.hand`` of a score.
        options: As in :func:`teleop_exchange.import_recording`: columns, units, frames.
        recordings: Folder for a recording of each episode; None for no recordings.
        say: Called with a line after each episode.

    Returns:
        A table with a row for each episode, by its number. The columns are the scores, the oddness ``odd``, the oddest
        score ``most_odd``, and the ``reason`` why an episode has no scores. A score is NaN if the data set lacks its
        data.

    Raises:
        RecordingError: The data set cannot be read, or none of its episodes can.
        ParameterError: ``figures`` is empty, or an option is wrong.
        UnknownNameError: ``figures`` contains an unknown key.
    """
    import pandas

    if not figures:
        raise ParameterError("figures", (), "at least one, as speed_median_mm_s")
    keys = [f"motion.hand.{name}" for name in figures]
    rows: dict[int, dict[str, float | str | None]] = {}
    with TemporaryDirectory() as folder:
        place = Path(folder) if recordings is None else Path(recordings)
        report = import_episodes(data, place, options, say=say)
        for number in sorted((*report.made, *report.kept)):
            found = measure(Bag(place / f"episode_{number:06d}"), keys)
            rows[number] = dict(zip(figures, found.values(), strict=True)) | {REASON: ""}
    rows |= {number: {REASON: why} for number, why in report.refused.items()}
    if not any(len(row) > 1 for row in rows.values()):
        first = next(iter(report.refused.values()), "there are none")
        raise RecordingError(Path(data), f"no episode can be graded: {first}")
    table = pandas.DataFrame.from_dict(rows, orient="index").rename_axis("episode")
    table = table.reindex(columns=[*figures, REASON])
    table[REASON] = table[REASON].fillna("")
    values = table[list(figures)].astype(float)
    table[list(figures)] = values
    shares = _shares(values)
    table.insert(0, ODD, shares.max(axis=1).where(table[REASON] == "", np.inf))
    table.insert(1, WORST, shares.idxmax(axis=1).where(shares.max(axis=1) > 0.0, ""))
    return table.sort_values([ODD], ascending=False, kind="stable")


def _shares(values: "pandas.DataFrame") -> "pandas.DataFrame":
    """Deviation of each score from the median of its column, in robust standard deviations; 0 for a missing score.

    If more than half of the episodes share a value, the median absolute deviation is 0. The spread is then the mean
    absolute deviation of the other episodes (Iglewicz and Hoaglin 1993), so that the only episode that differs is odd.
    """
    median = values.median()
    off = (values - median).abs()
    spread = off * 0.0 + _NORMAL * off.median()
    for name in off.columns[off.median() <= _ROUNDING * median.abs()]:
        others = (off[name].sum() - off[name]) / max(1, off[name].count() - 1)
        least = max(_LEAST_SHARE * abs(median[name]), _LEAST_SPREAD.get(name, _TINY))
        spread[name] = (_NORMAL_MEAN * others).clip(lower=least)
    return (off / spread).fillna(0.0)


def usual(table: "pandas.DataFrame", most: float = 3.5) -> list[int]:
    """Return the sorted numbers of the episodes whose oddness is at most `most`, for example as training data."""
    return sorted(int(number) for number in table.index[table[ODD] <= most])
