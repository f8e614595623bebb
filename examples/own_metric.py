"""Measure something of your own on every recording: how smooth the slave's reference is."""

import numpy as np

import teleop_core as tc
from teleop_core.evaluation import Context, Moments, Spread, Window
from teleop_core.graph.topics import SLAVE_SETPOINT_CP


class JerkMetric(tc.Metric):
    """Third derivative of the setpoint's place, [m/s³]."""

    name = "jerk"
    keys = (tc.Key("jerk.rms|sd|max", "m/s^3", "magnitude of the jerk of the slave's setpoint"),)
    topics = (SLAVE_SETPOINT_CP,)

    def __init__(self, context: Context) -> None:
        self._jerk = Moments()

    def add(self, window: Window) -> None:
        """Take one window; three samples before it are needed for its first one."""
        series, own = window.around(SLAVE_SETPOINT_CP), window.own(SLAVE_SETPOINT_CP)
        first = max(own.start - 3, 0)
        place, time = series.values[first : own.stop, :3], series.log_ns[first : own.stop] * 1e-9
        if len(place) > 3:
            jerk = np.diff(place, 3, axis=0) / np.diff(time).mean() ** 3
            self._jerk.add(np.linalg.norm(jerk, axis=1))

    def values(self) -> Spread:
        """What ``keys`` name."""
        return self._jerk.spread()


tc.register_metric(JerkMetric)


def main() -> None:
    """Print the jerk with the reference filter and without it."""
    for is_on in (True, False):
        recording = tc.run("coarse_box", duration=15.0, reference_filter__is_on=is_on)
        score = recording.score()
        print(f"filter {'on' if is_on else 'off'}: {score.value('jerk.rms'):.1f} m/s³ RMS")


if __name__ == "__main__":
    main()
