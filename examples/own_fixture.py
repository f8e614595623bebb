"""Hold the hand in a shape of your own: an upright cylinder, as a compiled kernel."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CylinderParameters:
    """What ``--set fixture.cylinder.radius=...`` sets; the depth gets the numbers in this order."""

    radius: float = tc.parameter(0.012, unit="m", lower=1e-4, upper=0.5, doc="of the cylinder")
    height: float = tc.parameter(0.02, unit="m", lower=1e-4, upper=0.5, doc="from end to end")


@tc.kernel
def cylinder_depth(offset: Array, shape: Array, depth: Array) -> float:
    """Write the vector from the nearest point inside to the hand; return its length."""
    distance = math.sqrt(offset[0] ** 2 + offset[2] ** 2)
    share = max(distance - shape[0], 0.0) / max(distance, 1e-9)
    depth[0], depth[2] = share * offset[0], share * offset[2]
    depth[1] = offset[1] - min(max(offset[1], -0.5 * shape[1]), 0.5 * shape[1])
    return math.sqrt(depth[0] ** 2 + depth[1] ** 2 + depth[2] ** 2)


def cylinder_outline(p: CylinderParameters) -> Array:
    """Draw both ends and a line between them, around the middle; y is up."""
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    ends = [
        np.stack((p.radius * np.cos(angle), np.full(41, y), p.radius * np.sin(angle)), axis=1)
        for y in (-0.5 * p.height, 0.5 * p.height)
    ]
    return np.concatenate(ends)


CYLINDER = tc.Fixture("cylinder", CylinderParameters, cylinder_depth, cylinder_outline)
tc.register_fixture(CYLINDER)


def main() -> None:
    """Print how far hand and slave went through the wall of box, sphere and cylinder."""
    for fixture in ("box", "sphere", "cylinder"):
        recording = tc.run("coarse_box", duration=20.0, fixture=fixture)
        depth = recording.score().value("fixture.penetration_max_mm")
        print(f"{fixture}: slave at most {depth:.2f} mm through the wall")


if __name__ == "__main__":
    main()
