"""Union: the points inside at least one of several shapes, such as a ball with a channel that leads out of it."""

from dataclasses import dataclass

from teleop_core.kernels import Array, kernel
from teleop_core.shapes import Shape
from teleop_core.shapes.basis import combined


@dataclass(frozen=True, kw_only=True)
class UnionParameters:
    """Shapes of which the union consists."""

    parts: tuple[str, ...] = combined.parts_parameter(
        ("sphere radius=0.015", "cylinder radius=0.005 length=0.05 direction=[1.0, 0.0, 0.0]"),
        "parts that together form the shape",
    )

    def __post_init__(self) -> None:
        combined.parts_of(self.parts, "union.parts")


@kernel
def union_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the outward direction (3,) of the part nearest to a point; return the point's distance outside [m]."""
    return combined.extreme_part(offset, numbers, -1.0, out)


UNION = Shape("union", UnionParameters, union_distance, combined.outline_of_parts, combined.numbers_of_parts)
