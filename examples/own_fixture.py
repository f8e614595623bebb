"""Keep the hand inside your own shape: an upright pill, as a compiled kernel."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PillParameters:
    """Parameters for ``--set fixture.pill.radius=...``; the distance gets them as numbers in this order."""

    radius: float = tc.parameter(0.012, tc.Within(1e-4, 0.5, "m"), "of sides and ends")
    height: float = tc.parameter(0.01, tc.Within(0.0, 0.5, "m"), "without its ends")


@tc.kernel
def pill_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the vector from the middle line to the point, of any length; return the distance outside the pill."""
    out[0], out[2] = offset[0], offset[2]
    out[1] = offset[1] - min(max(offset[1], -0.5 * numbers[1]), 0.5 * numbers[1])
    from_line = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    if from_line == 0.0:
        out[0] = 1.0
    return float(from_line - numbers[0])


def pill_outline(p: PillParameters) -> Array:
    """Silhouette of the pill around its middle; y is up."""
    angle = np.linspace(0.0, np.pi, 21)
    half = np.stack((p.radius * np.cos(angle), 0.5 * p.height + p.radius * np.sin(angle)), axis=1)
    loop = np.concatenate((half, -half, half[:1]))
    return np.column_stack((loop, np.zeros(len(loop))))


PILL = tc.Shape("pill", PillParameters, pill_distance, pill_outline)
tc.register_shape(PILL)


def main() -> None:
    """Print how far hand and slave moved beyond the walls of box, sphere and pill."""
    for fixture in ("box", "sphere", "pill"):
        recording = tc.run("coarse_box", duration=20.0, fixture=fixture)
        depth = recording.score().value("fixture.penetration_max_mm")
        print(f"{fixture}: slave at most {depth:.2f} mm through the wall")


if __name__ == "__main__":
    main()
