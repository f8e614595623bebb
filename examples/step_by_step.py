"""Step a session by your own program: a person sees the slave with a delay and moves it to a goal.

Between two steps the program reads the pose of the tip and commands the hand. The same session restarts for each
delay.
"""

from collections import deque

import numpy as np

import teleop_core as tc

# The slave's x, y, z are the master's -z, -x, +y.
MASTER_OF_SLAVE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).T
WAY = np.array([-0.02, 0.015, 0.015])  # vector from the start of the tip to the goal [m]
PERIOD, SHARE = 0.05, 0.08  # every 50 ms the hand moves by this share of the remaining distance that it sees
NEAR, STAYS = 0.5e-3, 6  # the goal is reached if the tip is within half a millimetre in six steps


def reach(session: tc.Session, late: int) -> float:
    """Time [s] to reach the goal if the tip is seen some steps late."""
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
    """Print the time for the same distance with increasing delay of the picture."""
    session = tc.Session("free_motion", period=PERIOD)
    for late in (0, 4, 8):
        took = reach(session, late)
        print(f"seen {1e3 * PERIOD * late:3.0f} ms late: {took:.2f} s to the goal")


if __name__ == "__main__":
    main()
