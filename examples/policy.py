"""Train a policy on demonstrations, then let it move the hand: how often it succeeds if it sees the slave late.

The demonstrator moves the tip to a goal and looks at it all the time. A small network imitates it. Both move the hand,
so the same mapping and limits hold for both.
"""

import sys

import numpy as np

import teleop_core as tc
from teleop_lab.policies import Pilot, Policy, Way, trained

# The slave's x, y, z are the master's -z, -x, +y.
MASTER_OF_SLAVE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).T
PERIOD, SHARE = 0.05, 0.2
NEAR, STAYS, LONGEST = 5e-4, 10, 120  # within 0.5 mm in ten steps, after 6 s at most
DELAYS = (0, 2, 4, 5, 6, 8, 12)


def offset(found: tc.Observation, goal: np.ndarray) -> np.ndarray:
    """Way from the tip to the goal, in axes of the hand [m]."""
    return np.asarray(MASTER_OF_SLAVE @ (goal - found.measured_cp[:3]))


def attempt(session: tc.Session, goal_offset: np.ndarray, move: Policy, way: Way) -> bool:
    """Whether the tip reaches a goal and stays there; ``move`` gets the way to the goal in place of an observation."""
    found, near, hand = session.reset(), 0, np.zeros(3)
    goal = found.measured_cp[:3] + goal_offset

    def policy(seen: tc.Observation) -> np.ndarray:
        nonlocal hand
        hand = hand + np.clip(move(offset(seen, goal)), -5e-3, 5e-3)  # type: ignore[arg-type]
        return np.asarray(np.clip(hand, -0.06, 0.06))

    pilot = Pilot(session, policy, way)
    for _ in range(LONGEST):
        found = pilot.step(found)
        near = near + 1 if np.linalg.norm(offset(found, goal)) < NEAR else 0
        if near == STAYS:
            return True
    return False


def main() -> None:
    """Print the share of goals that demonstrator and policy reach, by the age of what they see."""
    count, seed = int(sys.argv[1]) if len(sys.argv) > 1 else 20, 1
    session, rng = tc.Session("free_motion", period=PERIOD), np.random.default_rng(seed)
    seen, done = list[np.ndarray](), list[np.ndarray]()

    def demonstrate(way_left: np.ndarray) -> np.ndarray:
        seen.append(way_left)
        done.append(np.clip(SHARE * way_left, -5e-3, 5e-3))
        return done[-1]

    for _ in range(count):
        attempt(session, rng.uniform(-0.006, 0.006, 3), demonstrate, Way())  # type: ignore[arg-type]
    policy = trained(np.array(seen), np.array(done), seed=seed)
    print(f"trained on {len(seen)} steps of {count} demonstrations")
    goals = rng.uniform(-0.006, 0.006, (count, 3))
    for late in DELAYS:
        shares = [
            100 * np.mean([attempt(session, goal, move, Way(seen_late=late)) for goal in goals])  # type: ignore[arg-type]
            for move in (demonstrate, policy)
        ]
        print(f"seen {1e3 * PERIOD * late:4.0f} ms late: demonstrator {shares[0]:3.0f} %, policy {shares[1]:3.0f} %")


if __name__ == "__main__":
    main()
