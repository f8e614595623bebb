"""Force: how hard the device pushed the hand."""

import numpy as np

from teleop_core.evaluation import Context, Envelope, Moments, Spread, TableRow, Window, number, row
from teleop_core.evaluation.figure import Figure, force_figure
from teleop_core.evaluation.metric import SPREAD_MEANING, Key, Metric
from teleop_core.evaluation.metrics.fixture import GROUP
from teleop_core.evaluation.outlines import kinds_of, outlines_of
from teleop_core.graph.topics import MASTER_MEASURED_CF


class ForceMetric(Metric):
    """Spread of the magnitude of the force on the hand, [N]."""

    name = "force_n"
    keys = (Key("force_n.rms|sd|max", "N", f"magnitude of the force on the hand: {SPREAD_MEANING}"),)
    topics = (MASTER_MEASURED_CF,)

    def __init__(self, context: Context) -> None:
        self._context, self._magnitude = context, Moments()
        # Columns: x, y, z and magnitude of the force, [N].
        self._trace = Envelope(context.bag.start_ns, context.bag.end_ns, columns=4)

    def add(self, window: Window) -> None:
        """Process one window."""
        samples = window.samples(MASTER_MEASURED_CF)
        force = samples.values[:, :3]
        magnitude = np.sqrt(np.einsum("ij,ij->i", force, force))
        self._magnitude.add(magnitude)
        self._trace.add(samples.log_ns, np.column_stack((force, magnitude)))

    def values(self) -> Spread:
        """Spread so far, [N]."""
        return self._magnitude.spread()

    def rows(self) -> list[TableRow]:
        """Row of the largest force, in the group of the virtual fixture."""
        return [row(GROUP, "force on hand, max", "N", self.values().max)]

    def figures(self) -> list[Figure]:
        """Plot of the force against time; no plot if the force was not recorded."""
        times, values = self._trace.line()
        if not len(times):
            return []
        kinds = kinds_of(outlines_of(self._context))
        sentence = f"The device pushes the hand with {number(self.values().max)} N at most"
        sentence += f"; the {kinds} pushes back only where the hand is beyond a wall" * bool(kinds)
        return [force_figure("Force on the hand", f"{sentence}.", times, values, "master")]
