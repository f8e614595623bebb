"""Delay of the jaw: time from the moment at which the hand begins to close the jaw to the grip."""

from teleop_core.evaluation import Context, Metric, Window
from teleop_core.evaluation.changes import Changes
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.pairing import mean_wait_s
from teleop_core.graph.topics import SLAVE_JAW_GRIP, SLAVE_JAW_SERVO_JP


class JawDelayMetric(Metric):
    """Mean time from the command to the grip; None without a grip."""

    name, below, group, topics = "jaw_delay", "jaw", "the jaw", (SLAVE_JAW_GRIP, SLAVE_JAW_SERVO_JP)
    delay_s = figure(
        "s", "mean time from the first master sample that closes the jaw to the grip", "from the command to the grip"
    )

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._asked, self._grip = Changes(SLAVE_JAW_SERVO_JP, "jaw"), Changes(SLAVE_JAW_GRIP, "is_gripped")

    def add(self, window: Window) -> None:
        """Process one window."""
        if self._asked.add(window) & self._grip.add(window):
            self.delay_s = mean_wait_s(self._asked.falls("jaw"), self._grip.rises("is_gripped"))
