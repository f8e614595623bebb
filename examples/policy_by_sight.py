"""A policy as operator: it moves the hand by a share of the way to the goal that it sees, fifty times a second.

teleop sim --parts examples/policy_by_sight.py --scenario point --set operator=policy policy.name=by_sight task=reach
"""

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc

Array = NDArray[np.float64]
GAIN = 4.0  # speed of the tip divided by the way that is left [1/s]
PERIOD = 0.02  # of the policy [s], the inverse of operator.policy.rate


def by_sight(seen: tc.View) -> Array:
    """Wanted place of the hand (3,) [m]: a share of the way from the tip, as seen, to the goal."""
    if seen.goal is None or not seen.is_following:
        return seen.place
    return np.asarray(seen.place + GAIN * PERIOD * seen.to_hand(seen.goal - seen.measured_cp[:3]))


tc.register_policy("by_sight", by_sight)


def main() -> None:
    """Print successes at a task of reaching, by the delay of the network on the way back."""
    settings = {"teleop.stages": ["display", "task", "network"], "task": "reach", "policy.name": "by_sight"}
    for late in (0.0, 0.1, 0.2, 0.3, 0.4):
        given = settings | {"network.back.least_delay": late}
        score = tc.run("point", duration=20.0, operator="policy", settings=given).score()
        age, done = score.value("display.age_mean_ms"), score.value("task.successes")
        print(f"network {1e3 * late:3.0f} ms: seen {age:3.0f} ms late, {done:.0f} goals in 20 s")


if __name__ == "__main__":
    main()
