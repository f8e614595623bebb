"""Touch: contacts of the slave's tip with the world."""

import numpy as np

from teleop_core.evaluation import Context, Envelope, Metric, Moments, Window, number
from teleop_core.evaluation.figure import Figure, force_figure
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.objects import object_of
from teleop_core.graph.topics import SLAVE_MEASURED_CF, SLAVE_TRUE_CF, SLAVE_TRUE_CP
from teleop_core.kernels.geometry import Array
from teleop_core.slave.world.button import ButtonParameters, count_presses

_NEXT_NS = 5_000_000
"""Largest time between two samples that count as consecutive [ns]."""


class _Presses:
    """Counts presses of a button, from the true position of the tip.

    Attributes:
        count: Number of presses so far; None if no button is known.
    """

    def __init__(self, context: Context) -> None:
        self.count: int | None = None
        self._is_pressed = False
        found = object_of(context, ButtonParameters)
        if found is not None:
            self._world, self._center = found
            self._button, self.count = self._world.kind.parameters, 0
            context.read((SLAVE_TRUE_CP,))

    def add(self, places: Array) -> None:
        """Add positions (N, 3) [m] of the tip; must be called only if a button is known."""
        assert self.count is not None
        depth = np.array([-self._world.distance(place[None], self._center) for place in places])
        new, self._is_pressed = count_presses(depth, self._button, is_pressed=self._is_pressed)
        self.count += new


class TouchMetric(Metric):
    """Touches of the tip with the world, and forces of these touches; None if no forces were recorded.

    The true force is used if it was recorded, so that noise and bias of a sensor do not count as touches.
    """

    name, group = "touch", "what the slave touched"
    topics = (SLAVE_TRUE_CF, SLAVE_MEASURED_CF)
    count = figure("1", "number of touches: times that a force on the slave's tip began", "touches")
    peak_n = figure("N", "largest force on the tip; null without a touch", "force on the tip, max")
    rms_n = figure("N", "RMS force over the samples with a force")
    share = figure("1", "share of the recorded time with contact", "share of the time in touch")
    drop_n = figure(
        "N",
        "largest drop of the force between two samples at most 5 ms apart, such as at a puncture",
        "largest fall of it",
    )
    presses = figure(
        "1",
        "number of times that the button was pressed to its stop; each press needs a new click; null without a button",
        "presses",
    )

    def __init__(self, context: Context) -> None:
        self._presses = _Presses(context)
        self._force = Moments()
        self._touches, self._time_ns, self._seen = 0, 0, 0
        self._last = (0, 0.0)  # log time [ns] and force [N] of the last sample
        self._drop = 0.0
        self._begin_ns = 0
        self._trace = Envelope(context.bag.start_ns, context.bag.end_ns, columns=4)

    def add(self, window: Window) -> None:
        """Process one window. A force is sent when it changes, and otherwise at long intervals."""
        if self._presses.count is not None:
            self._presses.add(window.samples(SLAVE_TRUE_CP).values[:, :3])
            self.presses = self._presses.count if self._seen else None
        is_known = len(window.around(SLAVE_TRUE_CF)) > 0
        samples = window.samples(SLAVE_TRUE_CF if is_known else SLAVE_MEASURED_CF)
        if not len(samples.values):
            return
        force = samples.values[:, :3]
        magnitude = np.sqrt(np.einsum("ij,ij->i", force, force))
        touches = magnitude > 0.0
        if not self._seen:
            self._begin_ns, self._last = int(samples.log_ns[0]), (int(samples.log_ns[0]), 0.0)
        self._seen += len(touches)
        forces = np.append(self._last[1], np.where(np.isfinite(magnitude), magnitude, 0.0))
        before = forces[:-1] > 0.0
        times = np.diff(np.append(self._last[0], samples.log_ns))
        falls = -np.diff(forces)[times <= _NEXT_NS]
        self._drop = max(self._drop, float(falls.max(initial=0.0)))
        self._touches += int(np.sum(touches & ~before))
        self._time_ns += int(times[before].sum())  # a value is valid until the next value
        self._last = int(samples.log_ns[-1]), float(forces[-1])
        self._force.add(magnitude[touches])
        self._trace.add(samples.log_ns, np.column_stack((force, magnitude)))
        found, whole = self._force.spread(), self._last[0] - self._begin_ns
        self.count, self.peak_n, self.rms_n, self.presses = self._touches, found.max, found.rms, self._presses.count
        self.share = self._time_ns / whole if whole else 0.0
        self.drop_n = self._drop if self._touches else None

    def figures(self) -> list[Figure]:
        """Plot of the force on the tip against time; no plot if the tip touched nothing."""
        times, values = self._trace.line()
        if not self.count:
            return []
        text = f"The world pushes the slave's tip with {number(self.peak_n)} N at most, in {self.count} touches."
        return [force_figure("Force on the slave's tip", text, times, values, "slave")]
