"""Jaw: number of grips, slips and drops, and the largest force."""

from teleop_core.evaluation import Context, Metric, Window
from teleop_core.evaluation.changes import Changes
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import SLAVE_JAW_GRIP


class JawMetric(Metric):
    """Grips of a simulated jaw, as its simulator reports them."""

    name, group, topics = "jaw", "the jaw", (SLAVE_JAW_GRIP,)
    grips = figure("1", "number of times that the jaw gripped the object", "grips")
    slips = figure("1", "number of grips in which the object slid by more than 1 mm", "slips")
    drops = figure("1", "number of times that the object slid out of the jaw above the table", "drops")
    peak_force_n = figure("N", "largest force of a finger on the object", "push of each finger, max")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._grip = Changes(SLAVE_JAW_GRIP)

    def add(self, window: Window) -> None:
        """Process one window."""
        if self._grip.add(window):
            self.grips, self.slips, self.drops = self._grip.risen("grips", "slips", "drops")
            self.peak_force_n = self._grip.peak("force")
