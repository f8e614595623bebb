"""Define your own task for a simulated person: reach one corner after another."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.hand.tasks import attempts

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CornersParameters:
    """Parameters for ``--set task.corners.side=...``; the kernel gets them as numbers."""

    side: float = tc.parameter(0.02, tc.Within(1e-3, 0.2, "m"), "of the square")
    width: float = tc.parameter(0.003, tc.Within(1e-4, 0.1, "m"), "of a corner")
    longest: float = tc.parameter(10.0, tc.Within(0.1, 60.0, "s"), "after which an attempt is an error")


@tc.kernel
def corners(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Count a corner as soon as the tip has reached it, and set the next one as goal."""
    if state[0] == 0.0:  # no goal yet: store the start of the tip
        for i in range(3):
            memory[i] = scene[1 + i]
    elif attempts.is_at_goal(scene, state):
        attempts.tell_attempt(memory, scene, state)
    elif attempts.waited(memory, scene) > numbers[2]:
        attempts.end_attempt(memory, scene, state, attempts.LATE)
    else:
        return
    corner = int(state[0]) % 4
    y = memory[1] + numbers[0] * (corner in (0, 1))
    z = memory[2] + numbers[0] * (corner in (1, 2))
    attempts.begin_goal(memory, scene, state, attempts.PASS, memory[0], y, z, numbers[1])


tc.register_task(tc.Task("corners", CornersParameters, corners))


def main() -> None:
    """Print the time per corner for several delays of the picture."""
    for latency in (0.033, 0.233):
        recording = tc.run("point", duration=12.0, task="corners", display__latency=latency)
        score = recording.score()
        time, count = score.value("task.time_s") or 0.0, score.value("task.successes") or 0.0
        print(f"seen {1e3 * latency:.0f} ms late: {count:.0f} corners, {time:.2f} s each")


if __name__ == "__main__":
    main()
