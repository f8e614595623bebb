"""Force sensing: errors of measured and estimated forces during contact, relative to the true force on the tip."""

import numpy as np

from teleop_core.evaluation import Context, Metric, Moments, Window, latest
from teleop_core.evaluation.metric import figure
from teleop_core.graph.topics import SLAVE_ESTIMATED_CF, SLAVE_MEASURED_CF, SLAVE_TRUE_CF, Topic
from teleop_core.kernels.geometry import Array


class ForceSensingMetric(Metric):
    """Distance of measured and estimated forces from the true force.

    Values are None if there was no contact, or the true force is unknown.

    Messages of all three topics are sent only when a force changes, so each value is valid until the next sample.
    """

    name, group = "force_sensing", "force on the tip as it was told"
    topics = (SLAVE_TRUE_CF, SLAVE_MEASURED_CF, SLAVE_ESTIMATED_CF)
    measured_rms_n = figure(
        "N",
        "RMS difference of slave/measured_cf and slave/true_cf at all common samples with contact; "
        "null without a contact, or if the true force is unknown",
        "measured, error, rms",
    )
    measured_max_n = figure("N", "largest difference of slave/measured_cf and slave/true_cf at samples with contact")
    estimated_rms_n = figure(
        "N",
        "RMS difference of slave/estimated_cf and slave/true_cf at all common samples with "
        "contact; null also if no force was estimated",
        "estimated, error, rms",
    )
    estimated_max_n = figure("N", "largest difference of slave/estimated_cf and slave/true_cf at samples with contact")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._measured, self._estimated = Moments(), Moments()
        self._is_estimated = False

    def add(self, window: Window) -> None:
        """Process one window."""
        self._measured.add(force_errors(window, SLAVE_MEASURED_CF))
        self._estimated.add(force_errors(window, SLAVE_ESTIMATED_CF))
        self._is_estimated |= bool(window.samples(SLAVE_ESTIMATED_CF).values.any())
        measured = self._measured.spread()
        self.measured_rms_n, self.measured_max_n = measured.rms, measured.max
        if self._is_estimated:
            estimated = self._estimated.spread()
            self.estimated_rms_n, self.estimated_max_n = estimated.rms, estimated.max


def force_errors(window: Window, told: Topic) -> Array:
    """Distances (N,) [N] of the forces on topic ``told`` from the true force, at all samples during contact."""
    true, said = window.around(SLAVE_TRUE_CF), window.around(told)
    own = [window.samples(topic).stamp_ns for topic in (SLAVE_TRUE_CF, told)]
    stamps = np.unique(np.concatenate(own))
    at_true, at_said = latest(stamps, true.stamp_ns), latest(stamps, said.stamp_ns)
    is_known = (at_true >= 0) & (at_said >= 0)
    force, heard = true.values[at_true[is_known], :3], said.values[at_said[is_known], :3]
    off = (heard - force)[force.any(axis=1)]
    distances: Array = np.sqrt(np.einsum("ij,ij->i", off, off))
    return distances
