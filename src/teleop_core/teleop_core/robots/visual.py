"""Visual: a shape of a link, as an arm's file draws it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from teleop_core.kernels import Array

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
    """

    link: str
    joints: int
    place: Array
    kind: VisualKind
    size: tuple[float, ...]
    file: str
    urdf: Path
