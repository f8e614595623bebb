"""History: scores that the page computes from the samples that it received."""

from dataclasses import dataclass

import numpy as np

from teleop_console.link import ArmView
from teleop_core.graph import topics
from teleop_core.kernels.geometry import Array


@dataclass
class LiveScores:
    """Scores of one arm since the last reset, computed from the samples that the page received.

    The scores of a recording use every sample; these scores are a preview.

    Attributes:
        time: Time for which the arm has followed the hand [s], without clutched time.
        way: Length of the tip's path [m].
        rms: RMS distance between setpoint and measured position [m].
        largest: Largest distance between setpoint and measured position [m].
        force: Largest force at the stylus [N].
    """

    time: float = 0.0
    way: float = 0.0
    rms: float = 0.0
    largest: float = 0.0
    force: float = 0.0
    _square: float = 0.0
    _last: tuple[float, Array] | None = None

    def add(self, time: float, view: ArmView) -> None:
        """Add the view of a time [s]; only samples while the slave follows the hand count."""
        reference, place = view.get(topics.SLAVE_SETPOINT_CP), view.get(topics.SLAVE_MEASURED_CP)
        force = view.get(topics.MASTER_MEASURED_CF)
        is_led = view.state.get("is_following") and not view.state.get("is_clutched")
        if reference is None or place is None or not is_led:
            self._last = None
            return
        if self._last is not None and 0.0 < (step := time - self._last[0]) < 1.0:
            error = float(np.linalg.norm(reference[:3] - place[:3]))
            self.time += step
            self.way += float(np.linalg.norm(place[:3] - self._last[1]))
            self._square += step * error * error
            self.rms = float(np.sqrt(self._square / self.time))
            self.largest = max(self.largest, error)
        if force is not None:
            self.force = max(self.force, float(np.linalg.norm(force[:3])))
        self._last = (time, place[:3].copy())

    def text(self) -> str:
        """The scores as a table in Markdown."""
        rows = (
            ("followed", f"{self.time:.1f} s"),
            ("path of the tip", f"{1e3 * self.way:.1f} mm"),
            ("tracking error, RMS", f"{1e3 * self.rms:.3f} mm"),
            ("tracking error, largest", f"{1e3 * self.largest:.3f} mm"),
            ("force, largest", f"{self.force:.2f} N"),
        )
        return "\n".join(["| so far | |", "|---|---:|", *(f"| {a} | {b} |" for a, b in rows)])
