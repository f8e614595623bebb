"""Transfer: how many objects the jaw brought from peg to peg, how fast, and how pegs pulled."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation import Context, Metric, Window, keys_of
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.pairing import mean_wait_s
from teleop_core.graph.topics import SLAVE_JAW_BOARD, SLAVE_JAW_GRIP

_TRANSFERRED, _DROPPED, _PULL = (SLAVE_JAW_BOARD.columns.index(name) for name in ("transferred", "dropped", "pull"))
_GRIPS = SLAVE_JAW_GRIP.columns.index("grips")


@dataclass(frozen=True)
class TransferScore:
    """What became of the objects of a board; None without a jaw."""

    transferred: int | None = figure("1", "objects that were let go onto another peg", "transferred")
    dropped: int | None = figure("1", "objects that came to rest on no peg", "dropped")
    time_s: float | None = figure(
        "s", "mean time of those transferred, from the last grip to rest", "time of a transfer, mean"
    )
    peak_pull_n: float | None = figure(
        "N", "largest pull of a peg on the gripped object, across the peg", "pull of a peg, max"
    )


class TransferMetric(Metric):
    """Counts, times and pulls of a simulated board, by what its simulator tells."""

    name, group = "transfer", "peg transfer"
    keys = keys_of("transfer", TransferScore)
    topics = (SLAVE_JAW_BOARD, SLAVE_JAW_GRIP)

    def __init__(self, _: Context) -> None:
        self._first: np.ndarray | None = None
        self._last = np.zeros(len(SLAVE_JAW_BOARD.columns))
        self._grips = np.nan  # of the last sample
        self._peak = 0.0
        self._begins: list[int] = []  # of grips [ns]
        self._ends: list[int] = []  # of transfers [ns]

    def add(self, window: Window) -> None:
        """Take one window."""
        grips, board = window.samples(SLAVE_JAW_GRIP), window.samples(SLAVE_JAW_BOARD)
        if len(grips):
            count = np.append(self._grips, grips.values[:, _GRIPS])
            self._begins += grips.stamp_ns[np.diff(count) > 0.0].tolist()
            self._grips = count[-1]
        if not len(board):
            return
        if self._first is None:
            self._first = self._last = board.values[0]
        count = np.append(self._last[_TRANSFERRED], board.values[:, _TRANSFERRED])
        self._ends += board.stamp_ns[np.diff(count) > 0.0].tolist()
        self._last = board.values[-1]
        self._peak = max(self._peak, float(board.values[:, _PULL].max()))

    def values(self) -> TransferScore:
        """Score of everything so far."""
        if self._first is None:
            return TransferScore(None, None, None, None)
        counts = self._last - self._first
        transferred, dropped = int(counts[_TRANSFERRED]), int(counts[_DROPPED])
        return TransferScore(transferred, dropped, mean_wait_s(self._begins, self._ends), self._peak)
