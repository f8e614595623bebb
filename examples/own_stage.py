"""Put your own stage between two others: it limits the speed of poses.

The stage is inserted between motion_scaling and inverse_kinematics; nothing else changes. It declares its input topic,
and that the readers of this topic read the stage's output instead.
"""

import math
import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.graph.topics import SLAVE_SERVO_CP, passed_on

LIMITED = tc.Topic("slave/limited_cp", tc.Kind.POSE, passed_on("slave/servo_cp"), "slave_base")


@dataclass(frozen=True, kw_only=True)
class LimitParameters:
    """Parameters for ``--set velocity_limit.speed=...``."""

    speed: float = tc.parameter(0.02, tc.Within(1e-4, 10.0, "m/s"), "largest speed")


class LimitState(tc.Fields):
    """Memory of the stage from tick to tick."""

    held: tc.Vector3
    has_begun: int


class LimitRow(tc.Row):
    """Topics of the stage: existing ones, and its own one."""

    slave_limited_cp: NDArray[np.float64]


@tc.kernel
def limit(p: LimitParameters, s: LimitState, row: LimitRow, dt: float) -> None:
    """Move towards the commanded pose, in each tick no farther than the speed limit allows."""
    wanted, limited = row.slave_servo_cp, row.slave_limited_cp
    if s.has_begun == 0:
        for i in range(3):
            s.held[i] = wanted[i]
        s.has_begun = 1
    distance = 0.0
    for i in range(3):
        distance += (wanted[i] - s.held[i]) ** 2
    share = min(1.0, p.speed * dt / max(math.sqrt(distance), 1e-12))
    for i in range(3):
        s.held[i] += share * (wanted[i] - s.held[i])
        limited[i] = s.held[i]
    for i in range(3, 7):
        limited[i] = wanted[i]


VELOCITY_LIMIT = tc.Stage(
    "velocity_limit", LimitParameters, reads=(SLAVE_SERVO_CP,), writes=(LIMITED,), step=limit,
    state=LimitState, trigger=SLAVE_SERVO_CP, replaces=SLAVE_SERVO_CP,
)  # fmt: skip
tc.register_stage(VELOCITY_LIMIT)


def main() -> None:
    """Run the stage as a kernel and as plain Python; both give the same bits, but need different times."""
    results = []
    for stage in (VELOCITY_LIMIT, replace(VELOCITY_LIMIT, step=limit.py_func)):
        tc.run("free_motion", duration=0.1, stages=[stage])  # what is compiled once
        begin = time.perf_counter()
        recording = tc.run("free_motion", duration=3.0, stages=[stage])
        results.append(recording["slave/measured_js"].values)
        position = recording["slave/limited_cp"][["x", "y", "z"]]
        fastest = np.linalg.norm(np.diff(position, axis=0), axis=1).max() / 1e-3
        print(f"fastest command {1e3 * fastest:.2f} mm/s, {time.perf_counter() - begin:.1f} s")
    print("same bits:", np.array_equal(results[0], results[1]))


if __name__ == "__main__":
    main()
