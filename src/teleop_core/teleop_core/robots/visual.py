"""Visual: a shape of a link, as an arm's file draws it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from teleop_core.kernels import Array

VisualKind = Literal["mesh", "box", "cylinder", "sphere"]


@dataclass(frozen=True, eq=False)
class Visual:
    """A shape of a link.

    Attributes:
        link: Name of the link.
        joints: Number of movable joints between the base and the link.
        place: Pose of the shape (4, 4) in the base, with the arm at home [m].
        kind: Kind of shape.
        size: For a mesh, scales along x, y and z; for a box x, y, z; for a cylinder radius and length; for a sphere
            its radius [m].
        file: Name of a mesh as the file gives it; empty for other kinds.
        urdf: The file.
    """

    link: str
    joints: int
    place: Array
    kind: VisualKind
    size: tuple[float, ...]
    file: str
    urdf: Path
