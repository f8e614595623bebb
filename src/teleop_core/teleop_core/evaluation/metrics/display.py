"""Display: delay and rate of the picture in which the operator saw the slave."""

import numpy as np

from teleop_core.evaluation import Context, Metric, Window
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import DISPLAY_MEASURED_CP, NO_COMMAND_NS


class DisplayMetric(Metric):
    """Mean age of the slave pose on the display, and rate of the frames; None without a display.

    The age counts from the measurement of the pose until the next frame replaces the pose.
    """

    name, topics = "display", (DISPLAY_MEASURED_CP,)
    age_mean_ms = figure("ms", "mean age of the frame on the screen", "age of what is seen, mean")
    rate_hz = figure("Hz", "shown frames per second whose pose differs from the frame before", "frames")

    def __init__(self, _: Context) -> None:
        self._log_ns = self._stamp_ns = NO_COMMAND_NS  # times of the newest frame
        self._frames, self._span_s, self._seen = 0, 0.0, 0.0

    def add(self, window: Window) -> None:
        """Process one window."""
        shown = window.samples(DISPLAY_MEASURED_CP)
        # A sample without a valid stamp means that the screen is still dark.
        is_new = np.diff(shown.stamp_ns, prepend=self._stamp_ns) > 0
        if not is_new.any():
            return
        logs = np.append(self._log_ns, shown.log_ns[is_new])
        stamps = np.append(self._stamp_ns, shown.stamp_ns[is_new])
        first = int(self._frames == 0)  # no frame was shown before the first frame
        until = 1e-9 * np.diff(logs)[first:]
        # The age grows from the arrival of a frame to the arrival of the next frame.
        ages = 1e-9 * (logs[:-1] - stamps[:-1])[first:] + 0.5 * until
        self._seen += float((ages * until).sum())
        self._span_s += float(until.sum())
        self._frames += int(is_new.sum())
        self._log_ns, self._stamp_ns = int(logs[-1]), int(stamps[-1])
        if self._span_s:
            self.age_mean_ms, self.rate_hz = 1e3 * self._seen / self._span_s, (self._frames - 1) / self._span_s
