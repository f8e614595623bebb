"""Touch your own object: a horizontal ring, as a compiled kernel."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class RingParameters:
    """Parameters for ``--set world.ring.radius=...``; the distance gets them as numbers in this order."""

    radius: float = tc.parameter(0.02, tc.Within(1e-3, 1.0, "m"), "of its middle line")
    thickness: float = tc.parameter(0.02, tc.Within(1e-3, 1.0, "m"), "of its wire")


@tc.kernel
def ring_distance(offset: Array, numbers: Array, out: Array) -> float:
    """Write the vector from the ring's middle line to the point; return the distance outside the wire."""
    x, y, z = offset[0], offset[1], offset[2]
    from_axis = max(math.sqrt(x * x + y * y), 1e-9)
    aside = from_axis - numbers[0]
    away = max(math.sqrt(aside * aside + z * z), 1e-9)
    share = aside / (away * from_axis)
    out[0], out[1], out[2] = share * x, share * y, z / away
    return float(away - 0.5 * numbers[1])


def ring_outline(p: RingParameters) -> Array:
    """Middle line of the ring."""
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    return p.radius * np.stack((np.cos(angle), np.sin(angle), np.zeros(41)), axis=1)


RING = tc.Shape("ring", RingParameters, ring_distance, ring_outline)
tc.register_shape(RING)


def main() -> None:
    """Print the force with which the same hand presses the slave onto a box, a ball and the ring."""
    for name, place in (
        ("box", [0.241, -0.236, -0.087]),
        ("sphere", [0.241, -0.236, -0.087]),
        ("ring", [0.261, -0.236, -0.082]),
    ):
        settings: dict[str, str | list[float]] = {"world": name, "world.place": place}
        recording = tc.run("palpation", duration=12.0, settings=settings)
        peak = recording.score().value("touch.peak_n")
        print(f"{name}: pushed with at most {peak:.2f} N")


if __name__ == "__main__":
    main()
