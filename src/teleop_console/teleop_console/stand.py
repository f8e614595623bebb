"""Stand: the pose of the master's device beside its slave on the page, in which both move in the same direction."""

from dataclasses import dataclass, field

import numpy as np

from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import Array, quaternion_from_rotation
from teleop_core.robots.bodies.meshes import mesh_of
from teleop_core.robots.solids import Solid

PUBLISHED_AXES = axis_map("axes", MotionScalingParameters.axes)
"""Rotation (3, 3) from the master's base to the slave's axes; used if a session does not define one."""
REST = np.array([0.0, -0.0655, -0.0881, 0.97918, -0.20300, 0.0, 0.0])
"""Pose (7,) of the stylus in the inkwell, in master_base."""
_UPRIGHT = (np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0)  # brings z of a solid to the device's y, upwards


def _solid(kind: str, size: tuple[float, ...], at: tuple[float, ...], turn: tuple[float, ...], role: str) -> Solid:
    return Solid(kind, size, np.array((*at, *turn)), role)  # type: ignore[arg-type]


_LEVEL = (1.0, 0.0, 0.0, 0.0)
DEVICE = (
    _solid("cylinder", (0.085, 0.02), (0.0, -0.195, -0.20), _UPRIGHT, "base"),
    _solid("cylinder", (0.05, 0.08), (0.0, -0.145, -0.21), _UPRIGHT, "base"),
    _solid("sphere", (0.05,), (0.0, -0.10, -0.21), _LEVEL, "link"),
    _solid("box", (0.045, 0.025, 0.06), (0.0, -0.185, -0.105), _LEVEL, "base"),
    _solid("cylinder", (0.012, 0.10), (0.0, -0.13, -0.105), _UPRIGHT, "base"),
)
"""Solids of the device in master_base: foot, body, shoulder, and the inkwell in front."""
STYLUS = (
    _solid("cylinder", (0.003, 0.03), (0.0, 0.0, 0.015), _LEVEL, "tool"),
    _solid("capsule", (0.008, 0.10), (0.0, 0.0, 0.085), _LEVEL, "link"),
)
"""Solids of the stylus in the stylus's frame; the origin is the tip, and z points to the back end."""


@dataclass(frozen=True, eq=False)
class Stand:
    """Pose of master_base in slave_base.

    Attributes:
        axes: Rotation (3, 3) from the master's base to the slave's axes.
        origin: Position of the origin of master_base (3,) [m].
    """

    axes: Array = field(default_factory=PUBLISHED_AXES.copy)
    origin: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def quaternion(self) -> Array:
        """Rotation of the device (4,): w, x, y, z."""
        out = np.empty(4)
        quaternion_from_rotation(np.ascontiguousarray(self.axes), out)
        return out


def stand_beside(low: Array, high: Array, axes: Array) -> Stand:
    """Stand to the right of a robot, seen along the robot's x axis, on the same floor.

    Args:
        low: Lowest corner (3,) [m] of the box around the robot, in slave_base.
        high: Highest corner (3,) [m] of this box.
        axes: Rotation (3, 3) from the master's base to the slave's axes.
    """
    vertices = np.concatenate([mesh_of(solid)[0] for solid in DEVICE]) @ axes.T
    own_low, own_high = vertices.min(axis=0), vertices.max(axis=0)
    gap = 0.04 + 0.02 * float((high - low).max())
    middle = 0.5 * (low + high)[0] - 0.5 * (own_low + own_high)[0]
    return Stand(axes, np.array([middle, low[1] - gap - own_high[1], low[2] - own_low[2]]))
