"""Insertion: how deep the slave's tip came into a hole, and what resisted it."""

from dataclasses import dataclass

import numpy as np

from teleop_core.evaluation import Context, Metric, Window, keys_of
from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.metrics.touch import object_of
from teleop_core.graph.topics import SLAVE_TRUE_CF, SLAVE_TRUE_CP
from teleop_core.kernels import Array, length
from teleop_core.shapes.hole import HoleParameters


@dataclass(frozen=True)
class InsertionScore:
    """What a peg did in a hole; None where the world is no hole."""

    depth_mm: float | None = figure(
        "mm",
        "largest depth of the slave's tip in the hole, from the mouth to the far end at most",
        "largest depth in the hole",
    )
    resistance_n: float | None = figure(
        "N", "largest force on the tool along the hole's axis, against a tip that goes in", "largest force against it"
    )
    torque_nm: float | None = figure("N·m", "largest torque about the slave's tip", "largest torque about the tip")


def depth_in_hole(places: Array, center: Array, hole: HoleParameters) -> float:
    """Largest depth [m] of places (N, 3) [m] in a hole; 0 where none is in it.

    Args:
        places: In the slave's base.
        center: Middle of the mouth (3,) [m].
        hole: Its parameters.
    """
    axis = np.array(hole.axis) / length(hole.axis)
    ways = places - center
    depth = -(ways * axis).sum(axis=1)
    beside = length(ways + depth[:, None] * axis)
    is_inside = (beside < hole.radius + hole.chamfer) & (depth <= hole.thickness)
    return float(depth[is_inside].max(initial=0.0))


class InsertionMetric(Metric):
    """Depth of the tip in a hole, and force and torque of the contact, of where they truly are."""

    name = "insertion"
    keys = keys_of("insertion", InsertionScore)
    topics = (SLAVE_TRUE_CF,)

    def __init__(self, context: Context) -> None:
        self._object = object_of(context, HoleParameters)
        self._depth = self._resistance = self._torque = 0.0
        if self._object is not None:
            context.read((SLAVE_TRUE_CP,))

    def add(self, window: Window) -> None:
        """Take one window."""
        if self._object is None:
            return
        world, center = self._object
        hole = world.kind.parameters
        places = window.samples(SLAVE_TRUE_CP).values[:, :3]
        self._depth = max(self._depth, depth_in_hole(places, center, hole))
        wrench = window.samples(SLAVE_TRUE_CF).values
        against = (wrench[:, :3] * (np.array(hole.axis) / length(hole.axis))).sum(axis=1)
        self._resistance = max(self._resistance, float(against.max(initial=0.0)))
        self._torque = max(self._torque, float(length(wrench[:, 3:6]).max(initial=0.0)))

    def values(self) -> InsertionScore:
        """Score of everything so far."""
        if self._object is None:
            return InsertionScore(None, None, None)
        return InsertionScore(1e3 * self._depth, self._resistance, self._torque)
