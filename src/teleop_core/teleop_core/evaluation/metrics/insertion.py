"""Insertion: the depth of the slave's tip in a hole, and the force and torque that resisted it."""

from teleop_core.evaluation.metric import figure
from teleop_core.evaluation.objects import ObjectMetric
from teleop_core.kernels import Array, length
from teleop_core.shapes.hole import HoleParameters


class InsertionMetric(ObjectMetric):
    """Depth of the tip in a hole, and force and torque of the contact, from the true pose and the true wrench."""

    name, kind = "insertion", HoleParameters
    depth_mm = figure(
        "mm",
        "largest depth of the slave's tip in the hole, at most the length of the hole",
        "largest depth in the hole",
    )
    resistance_n = figure(
        "N", "largest force on the tool along the hole's axis, against the insertion", "largest force against it"
    )
    torque_nm = figure("N·m", "largest torque about the slave's tip", "largest torque about the tip")

    def meet(self, shape: HoleParameters, ways: Array, wrench: Array) -> None:
        """Update the maxima of depth, force and torque."""
        against = wrench[:, :3] @ shape.out
        self.depth_mm = max(self.depth_mm or 0.0, 1e3 * shape.depth(ways))
        self.resistance_n = float(against.max(initial=self.resistance_n or 0.0))
        self.torque_nm = float(length(wrench[:, 3:]).max(initial=self.torque_nm or 0.0))
