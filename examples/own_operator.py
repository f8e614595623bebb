"""Simulate a person who sees: the hand moves by the remaining distance that it sees, with the delay of the picture.

A delay slows down only an operator who sees.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

# The slave's x, y, z are the master's -z, -x, +y.
MASTER_OF_SLAVE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).T
WAY = np.array([-0.02, 0.015, 0.015])  # vector from the start of the tip to the goal [m]
RATE = 2.0  # speed of the hand divided by the remaining distance [1/s]
NEAR = 0.5e-3  # there [m]
LOOKS = 1.0  # time for which the person watches before the hand moves [s]


def make(_: object, setting: tc.Setting) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Motion of one session; it reads the seen values at each call."""
    seen, place = setting.seen, np.zeros(3)
    assert seen is not None
    goal: list[NDArray[np.float64]] = []

    def motion(times: NDArray[np.float64]) -> NDArray[np.float64]:
        if times[0] >= LOOKS:
            if not goal:
                goal.append(seen.slave[:3] + WAY)
            missing = MASTER_OF_SLAVE @ (goal[0] - seen.slave[:3])
            place[:] += RATE * 1e-3 * len(times) * missing
        return np.tile(place, (len(times), 1))

    return motion


SEEING = tc.Operator("seeing", make, ahead=1)  # called for one tick at a time


def reached(delay: float) -> float:
    """Time [s] until the tip stays at the goal, if it is seen with a delay [s]."""
    delays = [f"slave/measured_cp@operator={delay}"] if delay else []
    recording = tc.run(operator=SEEING, duration=9.0, settings={"tremor_amplitude": 0.0, "teleop.delays": delays})
    state = recording["teleop/state"]
    begin = state.time[state["is_following"] > 0.0][0] + LOOKS
    tip = recording["slave/measured_cp"]
    places = tip[["x", "y", "z"]]
    goal = places[tip.time >= begin][0] + WAY
    off = np.linalg.norm(places - goal, axis=1)
    return float(tip.time[off > NEAR][-1] - begin)


def main() -> None:
    """Print the time for the same distance with increasing delay of the picture."""
    for delay in (0.0, 0.2, 0.4):
        print(f"seen {1e3 * delay:3.0f} ms late: {reached(delay):.2f} s to the goal")


if __name__ == "__main__":
    main()
