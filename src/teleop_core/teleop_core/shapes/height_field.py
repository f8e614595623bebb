"""Height field: a block whose surface is given by a table of heights."""

from dataclasses import dataclass

from teleop_core.base.parameters import Within, fixed
from teleop_core.kernels.geometry import Array
from teleop_core.shapes import Shape
from teleop_core.shapes.basis.distance_grid import DistanceGrid, GridRequest, distance_grid
from teleop_core.shapes.mesh import mesh_distance


@dataclass(frozen=True, kw_only=True)
class HeightFieldParameters:
    """A table of heights above the middle."""

    file: str = fixed("", doc="CSV or .npy file of heights [m], with a row for each x and a column for each y")
    spacing: float = fixed(2e-3, Within(1e-5, 0.1, "m"), "distance between neighbouring heights")
    step: float = fixed(
        1e-3, Within(5e-5, 5e-3, "m"), "spacing of the grid of distances; smaller details are rounded off"
    )


def _grid(p: HeightFieldParameters) -> DistanceGrid:
    return distance_grid(GridRequest(p.file, p.spacing, (), p.step, "height_field"))


def height_field_numbers(parameters: HeightFieldParameters) -> Array:
    """Numbers of the grid for :func:`mesh_distance`; raises the errors of :func:`distance_grid`."""
    return _grid(parameters).numbers


def height_field_outline(parameters: HeightFieldParameters) -> Array:
    """Edges of the field and three sections through its middle, (N, 3) [m]; errors as :func:`height_field_numbers`."""
    return _grid(parameters).outline


HEIGHT_FIELD = Shape("height_field", HeightFieldParameters, mesh_distance, height_field_outline, height_field_numbers)
