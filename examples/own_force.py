"""Let a second source push the hand: a damping that is added to the force of the fixture."""

from dataclasses import dataclass
from typing import Any

import numpy as np

import teleop_core as tc
from teleop_core.graph.topics import MASTER_MEASURED_CP, MASTER_MEASURED_CV, passed_on

DAMPING_CF = tc.Topic(
    "master/damping_cf", tc.Kind.WRENCH, passed_on("master/measured_cp"), "master_base",
    adds_to="master/servo_cf",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class DampingParameters:
    """Parameters for ``--set hand_damping.damping=...``."""

    damping: float = tc.parameter(10.0, tc.Within(0.0, 50.0, "N·s/m"), "of the hand")


@tc.kernel
def damp(p: Any, s: Any, row: Any, dt: float) -> None:
    """Push against the hand's speed."""
    for i in range(3):
        row.master_damping_cf[i] = -p.damping * row.master_measured_cv[i]


DAMPING = tc.Stage(
    "hand_damping", DampingParameters, reads=(MASTER_MEASURED_CP, MASTER_MEASURED_CV),
    writes=(DAMPING_CF,), step=damp, trigger=MASTER_MEASURED_CP,
)  # fmt: skip
tc.register_stage(DAMPING)


def main() -> None:
    """Print the largest speed of the hand and the largest force, without and with the damping."""
    for name, stages in (("alone", []), ("damped", [DAMPING])):
        recording = tc.run("free_motion", duration=15.0, stages=stages)
        speed = np.linalg.norm(recording["master/measured_cv"][["vx", "vy", "vz"]], axis=1)
        force = np.linalg.norm(recording["master/measured_cf"][["fx", "fy", "fz"]], axis=1)
        print(f"{name}: {1e3 * speed.max():.0f} mm/s, {force.max():.2f} N")


if __name__ == "__main__":
    main()
