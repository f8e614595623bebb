"""Set a task of your own, and see how a simulated person does it: one corner after another."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]
NUMBER, ACT, GOAL, WIDTH = 0, 1, 2, 5  # places in task/state
PASS = 1.0


@dataclass(frozen=True, kw_only=True)
class CornersParameters:
    """What ``--set task.corners.side=...`` sets; the kernel gets them as numbers."""

    side: float = tc.parameter(0.02, unit="m", lower=1e-3, upper=0.2, doc="of the square")
    width: float = tc.parameter(0.003, unit="m", lower=1e-4, upper=0.1, doc="of a corner")


@tc.kernel
def corners(numbers: Array, memory: Array, scene: Array, state: Array) -> None:
    """Count a corner as soon as the tip is there, and ask for the next one."""
    if state[NUMBER] == 0.0:
        for i in range(3):
            memory[i] = scene[1 + i]
    else:
        off = 0.0
        for i in range(3):
            off += (scene[1 + i] - state[GOAL + i]) ** 2
        if math.sqrt(off) > 0.5 * state[WIDTH]:
            return
        state[6] += 1.0  # attempts
        state[7] += 1.0  # successes
        state[11] = scene[0] - memory[3]  # time of the attempt
    corner = int(state[NUMBER]) % 4
    state[NUMBER] += 1.0
    state[ACT], state[WIDTH] = PASS, numbers[1]
    state[GOAL] = memory[0]
    state[GOAL + 1] = memory[1] + numbers[0] * (corner in (0, 1))
    state[GOAL + 2] = memory[2] + numbers[0] * (corner in (1, 2))
    memory[3] = scene[0]


tc.register_task(tc.Task("corners", CornersParameters, corners))


def main() -> None:
    """Print how long a corner takes, by how late the person sees the slave."""
    for latency in (0.033, 0.233):
        recording = tc.run("point", duration=12.0, task="corners", display__latency=latency)
        score = recording.score()
        time, count = score.value("task.time_s") or 0.0, score.value("task.successes") or 0.0
        print(f"seen {1e3 * latency:.0f} ms late: {count:.0f} corners, {time:.2f} s each")


if __name__ == "__main__":
    main()
