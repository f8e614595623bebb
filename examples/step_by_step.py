"""Step a session yourself: a person who sees the slave, late, and leads it to a goal.

Between two ticks the program reads where the tip is and says what the hand wants. The same session
begins again for each delay.
"""

from collections import deque

import numpy as np

import teleop_core as tc

FOLLOWS = tc.topics.TELEOP_STATE.columns.index("is_following")
# The slave's x, y, z are the master's -z, -x, +y.
MASTER_OF_SLAVE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).T
WAY = np.array([-0.02, 0.015, 0.015])  # from where the tip starts to the goal [m]
LOOK, SHARE = 50, 0.08  # each 50 ms the hand goes on by so much of what it sees missing
NEAR, STAYS = 0.5e-3, 300  # there: within half a millimetre for 0.3 s


class Seeing:
    """Hand of a person, who wants it elsewhere now and then."""

    def __init__(self) -> None:
        self.wanted = np.zeros(3)

    def __call__(self, hand: tc.RemoteHand, time: float) -> None:
        """Say where the stylus shall be, in every tick."""
        hand.want(np.array([*self.wanted, 1.0, 0.0, 0.0, 0.0]))


def reach(session: tc.VirtualTime, person: Seeing, delay: int) -> float:
    """Time [s] that it takes to the goal if the tip is seen ``delay`` ticks late."""
    session.reset()
    person.wanted = np.zeros(3)
    while not (row := session.step())["teleop_state"][FOLLOWS]:
        pass
    tips = deque([row["slave_measured_cp"][:3]] * (delay + 1), maxlen=delay + 1)
    begin, goal, near = session.now_ns, tips[0] + WAY, 0
    while near < STAYS:
        tips.append(session.step()["slave_measured_cp"][:3])
        near = near + 1 if np.linalg.norm(tips[-1] - goal) < NEAR else 0
        if (session.now_ns - begin) % (LOOK * 1_000_000) == 0:
            person.wanted = person.wanted + SHARE * MASTER_OF_SLAVE @ (goal - tips[0])
    return (session.now_ns - begin) * 1e-9


def main() -> None:
    """Print how long the same way takes with what is seen ever later."""
    person = Seeing()
    made = tc.configuration(operator=tc.remote_operator("seeing", person))
    session = tc.VirtualTime(made)
    for delay in (0, 200, 400):
        print(f"seen {delay:3} ms late: {reach(session, person, delay):.2f} s to the goal")


if __name__ == "__main__":
    main()
