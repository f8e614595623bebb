"""Transfer: number of objects that the jaw moved from peg to peg, their times, and the forces on the pegs."""

from teleop_core.evaluation import Context, Metric, Window
from teleop_core.evaluation.changes import Changes
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.pairing import mean_wait_s
from teleop_core.graph.topics import SLAVE_JAW_BOARD, SLAVE_JAW_GRIP


class TransferMetric(Metric):
    """Counts, times and peg forces of a simulated board, as its simulator reports them."""

    name, group, topics = "transfer", "peg transfer", (SLAVE_JAW_BOARD, SLAVE_JAW_GRIP)
    transferred = figure("1", "number of objects that were released onto another peg", "transferred")
    dropped = figure("1", "number of objects that came to rest on no peg", "dropped")
    time_s = figure("s", "mean time from the last grip of a transferred object to its rest", "time of a transfer, mean")
    peak_pull_n = figure("N", "largest force of a peg on the gripped object, across the peg", "pull of a peg, max")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._board, self._grips = Changes(SLAVE_JAW_BOARD, "transferred"), Changes(SLAVE_JAW_GRIP, "grips")

    def add(self, window: Window) -> None:
        """Process one window."""
        self._grips.add(window)
        if self._board.add(window):
            self.transferred, self.dropped = self._board.risen("transferred", "dropped")
            self.time_s = mean_wait_s(self._grips.rises("grips"), self._board.rises("transferred"))
            self.peak_pull_n = self._board.peak("pull")
