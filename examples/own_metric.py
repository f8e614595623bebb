"""Add your own score to every recording: the smoothness of the slave's reference."""

import numpy as np

import teleop_core as tc
from teleop_core.evaluation import Window
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import SLAVE_SETPOINT_CP


class JerkMetric(tc.Metric):
    """Third derivative of the setpoint's position."""

    name, topics = "jerk", (SLAVE_SETPOINT_CP,)
    rms = figure("m/s^3", "root mean square of the jerk of the slave's setpoint")
    _squares, _count = 0.0, 0

    def add(self, window: Window) -> None:
        """Process one window; its first sample needs the three samples before the window."""
        series, own = window.around(SLAVE_SETPOINT_CP), window.own(SLAVE_SETPOINT_CP)
        first = max(own.start - 3, 0)
        place, time = series.values[first : own.stop, :3], series.log_ns[first : own.stop] * 1e-9
        if len(place) > 3:
            jerk = np.diff(place, 3, axis=0) / np.diff(time).mean() ** 3
            self._squares, self._count = self._squares + float((jerk**2).sum()), self._count + len(jerk)
            self.rms = float(np.sqrt(self._squares / self._count))


tc.register_metric(JerkMetric)


def main() -> None:
    """Print the jerk with the reference filter and without it."""
    for is_on in (True, False):
        recording = tc.run("coarse_box", duration=15.0, reference_filter__is_on=is_on)
        score = recording.score()
        print(f"filter {'on' if is_on else 'off'}: {score.value('jerk.rms'):.1f} m/s³ RMS")


if __name__ == "__main__":
    main()
