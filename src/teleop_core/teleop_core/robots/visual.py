"""Visual: a shape of a link, as an arm's file draws it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels import Array

Color = tuple[float, float, float]
"""Red, green and blue, from 0 to 1."""
VisualKind = Literal["mesh", "box", "cylinder", "capsule", "sphere"]


@dataclass(frozen=True, eq=False)
class Visual:
    """A shape of a link.

    Attributes:
        link: Name of the link.
        joints: Number of movable joints between the base and the link.
        place: Pose of the shape (4, 4) in the base, with the arm at home [m].
        kind: Kind of shape.
        size: Mesh: scale factors along x, y and z. Box: x, y, z [m]. Cylinder: radius and length [m]. Capsule:
            radius, and length between the centres of its half spheres [m]. Sphere: radius [m].
        file: Name of the mesh as written in the URDF; empty for other kinds.
        urdf: Path of the URDF.
        color: Colour of the material; None if the file states none.
        travel: Poses (K, 4, 4) of the shape in the base [m], from the closed to the open jaw, with the arm at home.
            None for a shape that the jaw does not move.
    """

    link: str
    joints: int
    place: Array
    kind: VisualKind
    size: tuple[float, ...]
    file: str
    urdf: Path
    color: Color | None = None
    travel: Array | None = None


@dataclass(frozen=True, eq=False)
class Surrounding:
    """Shapes of one colour that one body of a scene carries.

    Attributes:
        place: Index of the body's pose in ``scene/poses``; -1 for shapes that do not move.
        mesh: Vertices (V, 3) [m] in the frame of the body, and faces (F, 3).
        color: Colour of the shapes.
        begin: Pose (7,) of the body in the world of the scene at the start.
    """

    place: int
    mesh: tuple[Array, NDArray[np.int64]]
    color: Color
    begin: Array
