"""Step a session yourself: a person who sees the slave, late, and leads it to a goal.

Between two steps the program reads where the tip is and says where the hand goes. The same session
begins again for each delay.
"""

from collections import deque

import numpy as np

import teleop_core as tc

# The slave's x, y, z are the master's -z, -x, +y.
MASTER_OF_SLAVE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).T
WAY = np.array([-0.02, 0.015, 0.015])  # from where the tip starts to the goal [m]
PERIOD, SHARE = 0.05, 0.08  # each 50 ms the hand goes on by so much of what it sees missing
NEAR, STAYS = 0.5e-3, 6  # there: within half a millimetre in six steps


def reach(session: tc.Session, late: int) -> float:
    """Time [s] that it takes to the goal if the tip is seen some steps late."""
    found, hand, near = session.reset(), np.zeros(3), 0
    begin, goal = found.time, found.measured_cp[:3] + WAY
    tips = deque([found.measured_cp[:3]] * (late + 1), maxlen=late + 1)
    while near < STAYS:
        hand += SHARE * MASTER_OF_SLAVE @ (goal - tips[0])
        session.command(hand)
        found = session.step()
        tips.append(found.measured_cp[:3])
        near = near + 1 if np.linalg.norm(tips[-1] - goal) < NEAR else 0
    return found.time - begin


def main() -> None:
    """Print how long the same way takes with what is seen ever later."""
    session = tc.Session("free_motion", period=PERIOD)
    for late in (0, 4, 8):
        took = reach(session, late)
        print(f"seen {1e3 * PERIOD * late:3.0f} ms late: {took:.2f} s to the goal")


if __name__ == "__main__":
    main()
