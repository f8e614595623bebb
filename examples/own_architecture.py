"""Let the hand feel the slave by your own law: the force, and a spring if the tip lags."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class BothParameters:
    """Parameters for ``--set reflection.both.slack=...``; the push gets them as numbers in their order."""

    stiffness: float = tc.parameter(300.0, tc.Within(0.0, 5000.0, "N/m"), "of the spring")
    slack: float = tc.parameter(2e-3, tc.Within(0.0, 0.1, "m"), "lag that is not felt")


@tc.kernel
def both_push(numbers: Array, memory: Array, felt: Array, away: Array, period: float, out: Array) -> None:
    """Push with the force on the tip, and with a spring if the tip lags by more than the slack."""
    length = (away[0] ** 2 + away[1] ** 2 + away[2] ** 2) ** 0.5
    share = max(length - numbers[1], 0.0) / length if length > 0.0 else 0.0
    for i in range(3):
        out[i] = felt[i] + numbers[0] * share * away[i]


tc.register_architecture(tc.Architecture("both", BothParameters, both_push))


def main() -> None:
    """Print the force on the hand in free motion, and while the slave presses silicone."""
    for kind in ("unilateral", "position_force", "position_position", "both"):
        settings = {"reflection.architecture": kind, "world.material": "silicone"}
        recording = tc.run("palpation", duration=14.0, settings=settings)
        felt, true = recording["master/servo_cf"], recording["slave/true_cf"]
        force = np.linalg.norm(felt.values[:, :3], axis=1)
        pressed = np.interp(felt.time, true.time, np.linalg.norm(true.values[:, :3], axis=1)) > 0.0
        free = float(np.median(force[~pressed & (felt.time > 6.0)]))
        print(f"{kind}: {free:.2f} N in free motion, up to {force.max():.2f} N of silicone")


if __name__ == "__main__":
    main()
