"""Half-space: everything in front of a plane, such as the space above a floor under the hand."""

from dataclasses import dataclass

import numpy as np

from teleop_core.base.parameters import Within, parameter
from teleop_core.kernels.geometry import Array
from teleop_core.shapes import Shape, plane
from teleop_core.shapes.basis import directions, drawing


@dataclass(frozen=True, kw_only=True)
class HalfSpaceParameters:
    """Everything in front of a plane."""

    normal: tuple[float, ...] = parameter(
        (0.0, 1.0, 0.0),
        Within(-1.0, 1.0),
        "normal of the plane, pointing into the half-space; its length does not matter",
        length=3,
    )
    room: float = parameter(
        0.01,
        Within(0.0, 0.5, "m"),
        "distance of the plane below the middle",
        source="assumed: less than half of the published box",
    )

    def __post_init__(self) -> None:
        directions.require_direction("half_space.normal", self.normal)


def half_space_numbers(parameters: HalfSpaceParameters) -> Array:
    """Numbers of the plane of a half-space; the plane's normal points out of the half-space."""
    return np.array((*(-x for x in parameters.normal), parameters.room))


def half_space_outline(parameters: HalfSpaceParameters) -> Array:
    """A square of 100 mm in the plane, (5, 3) [m], around the point of the plane below the middle."""
    normal = drawing.unit_vector(parameters.normal)
    drawn: Array = drawing.square(normal) - parameters.room * normal
    return drawn


HALF_SPACE = Shape("half_space", HalfSpaceParameters, plane.plane_distance, half_space_outline, half_space_numbers)
