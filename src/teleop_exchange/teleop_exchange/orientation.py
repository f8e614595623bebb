"""Orientation: converts orientations in any notation to unit quaternions w, x, y, z, block by block.

An orientation that is not a valid rotation becomes NaN and is counted as strange. Missing orientations stay NaN.
"""

import math
from dataclasses import dataclass

import numpy as np

from teleop_core.kernels import Array, dot, kernel, length, product
from teleop_core.kernels.geometry import quaternion_from_rotation

TOLERANCE = 0.1
"""Largest deviation of a quaternion's length from 1, or of a matrix from a rotation matrix."""
_UPRIGHT, _OVER = 0.9, 0.5  # mean of |w| of turns that are small on average, and of turns that hardly are
_MISSING = 1e-6  # length of a quaternion below which no orientation was measured


@dataclass
class Attitudes:
    """Converts rows of one notation, block by block.

    Attributes:
        kind: ``quaternion``, ``matrix``, ``euler``, ``rotation_vector`` or ``none``.
        order: Order of the numbers: ``wxyz`` or ``xyzw`` of a quaternion, ``row`` or ``column`` of a matrix, or the
            axes of Euler angles.
        degrees: Whether angles are in degrees.
        strange: Number of rows that are not valid rotations.
        mirrored: Number of rows that are mirrored rotations; they are included in ``strange``.
        longest: Largest difference of a used quaternion's length from 1.
        real: Mean of the size of w, as read and as the other order of the columns would read it.
    """

    kind: str
    order: str = ""
    degrees: bool = False
    strange: int = 0
    mirrored: int = 0
    longest: float = 0.0
    real: tuple[float, float] = (0.0, 0.0)
    _count: int = 0

    @property
    def doubt(self) -> str:
        """Text if the other order of a quaternion's columns is more plausible; empty otherwise.

        A wrong order mirrors the four numbers. Sizes of turns and their speeds stay the same, so they tell nothing.
        But it makes a half turn of every small turn from the axes of the file.
        """
        as_read, other = self.real
        if self.kind != "quaternion" or as_read > _OVER or other < _UPRIGHT:
            return ""
        own, better = (f"{2.0 * math.degrees(math.acos(min(w, 1.0))):.0f}°" for w in self.real)
        swapped = "wxyz" if self.order == "xyzw" else "xyzw"
        return (
            f"on average the hand is turned {own} from the axes of the file, in the order {swapped} only {better}: "
            f"is the order right? (--quaternion-order {swapped})"
        )

    @property
    def width(self) -> int:
        """Number of columns of an orientation."""
        return {"quaternion": 4, "matrix": 9, "none": 0}.get(self.kind, 3)

    def quaternions(self, rows: Array) -> Array:
        """Unit quaternions (N, 4) of the next rows (N, width); NaN for rows without a valid orientation."""
        if self.kind == "none":
            return np.tile([1.0, 0.0, 0.0, 0.0], (len(rows), 1))
        if self.kind == "quaternion":
            turned = self._unit(rows[:, [3, 0, 1, 2]] if self.order == "xyzw" else rows)
            self._weigh(turned[np.isfinite(turned).all(axis=1)])
            return turned
        if self.kind == "matrix":
            matrices = rows.reshape(-1, 3, 3)
            return self._of_matrices(matrices.transpose(0, 2, 1) if self.order == "column" else matrices)
        return self._of_angles(np.radians(rows) if self.degrees else rows)

    def _weigh(self, unit: Array) -> None:
        """Add unit quaternions to the means of w in both orders."""
        total = self._count + len(unit)
        if total:
            swapped = unit[:, 1 if self.order == "xyzw" else 3]
            sums = (abs(unit[:, 0]).sum(), abs(swapped).sum())
            first, other = (
                (self._count * mean + float(added)) / total for mean, added in zip(self.real, sums, strict=True)
            )
            self.real, self._count = (first, other), total

    def _of_angles(self, angles: Array) -> Array:
        from scipy.spatial.transform import Rotation

        turns = Rotation.from_euler(self.order, angles) if self.kind == "euler" else Rotation.from_rotvec(angles)
        return np.asarray(turns.as_quat(scalar_first=True))

    def _unit(self, quaternions: Array) -> Array:
        lengths = length(quaternions)
        missing = lengths < _MISSING
        strange = np.abs(lengths - 1.0) > TOLERANCE
        self.strange += int((strange & ~missing).sum())
        lengths[strange | missing] = math.nan
        off = np.abs(lengths[np.isfinite(lengths)] - 1.0)
        self.longest = max(self.longest, float(off.max(initial=0.0)))
        unit: Array = quaternions / lengths[:, None]
        return unit

    def _of_matrices(self, matrices: Array) -> Array:
        squares = product(matrices, matrices.transpose(0, 2, 1))
        missing = np.abs(matrices).max(axis=(1, 2), initial=0.0) < _MISSING
        off = np.abs(squares - np.eye(3)).max(axis=(1, 2), initial=0.0) > TOLERANCE
        mirror = dot(np.cross(matrices[:, 0], matrices[:, 1]), matrices[:, 2]) < 0.0
        self.strange += int(((off | mirror) & ~missing).sum())
        self.mirrored += int((mirror & ~off).sum())
        quaternions = np.empty((len(matrices), 4))
        write_quaternions(np.ascontiguousarray(matrices), quaternions)
        quaternions[off | mirror | missing] = math.nan
        return quaternions


@kernel
def write_quaternions(matrices: Array, quaternions: Array) -> None:
    """Write the unit quaternions (N, 4) of rotation matrices (N, 3, 3) into ``quaternions``.

    The matrices may be inexact.
    """
    for i in range(matrices.shape[0]):
        quaternion_from_rotation(matrices[i], quaternions[i])
