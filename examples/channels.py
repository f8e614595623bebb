"""Press silicone with two, three and four channels: without delay, with delay, and with a slave that yields.

The simulated hand of the scenario ``palpation`` presses a block for 14 s of virtual time. The example prints the
largest speed of the hand, the largest forces on hand and tip, and the distance from the tip to its command.
"""

import sys

import numpy as np

import teleop_core as tc

CHANNELS = {
    "position_force": ("network", "passivity"),
    "position_force, slave yields": ("network", "impedance", "passivity"),
    "three_channel": ("network", "impedance", "passivity"),
    "four_channel": ("network", "impedance", "passivity"),
}
"""Architectures, and the stages that they need in addition to those of every session."""
CALM: dict[str, float | str | bool] = {
    "feedback_timeout": 1.0, "reach_force.is_on": False, "world.material": "silicone",
}  # fmt: skip


def press(kind: str, round_trip: float) -> tuple[float, ...]:
    """Largest speed of the hand [m/s], largest forces on hand and tip [N], distance from the command to the tip [m]."""
    late = dict.fromkeys(("network.there.least_delay", "network.back.least_delay"), 0.5 * round_trip)
    settings = CALM | late | {"reflection.architecture": kind.partition(",")[0]}
    session = tc.run("palpation", duration=14.0, stages=CHANNELS[kind], settings=settings)
    hand = session["master/measured_cp"].values[5000:, :3]
    fastest = np.linalg.norm(hand[20:] - hand[:-20], axis=1).max() / 0.02
    push = np.linalg.norm(session["master/servo_cf"].values[:, :3], axis=1)
    told = session["slave/measured_cf"]
    force = np.linalg.norm(told.values[:, :3], axis=1)
    tip, goal = session["slave/measured_cp"], session["slave/servo_cp"]
    at = np.searchsorted(tip.time, told.time[int(force.argmax())])
    height = np.interp(tip.time[at], goal.time, goal.values[:, 2])
    return float(fastest), float(push.max()), float(force.max()), float(tip.values[at, 2] - height)


def main() -> int:
    """Print a line for each architecture and round trip."""
    for kind in CHANNELS:
        for round_trip in (0.0, 0.1):
            speed, felt, most, way = press(kind, round_trip)
            print(
                f"{kind}, {1e3 * round_trip:.0f} ms: hand at most {1e3 * speed:.0f} mm/s, feels "
                f"{felt:.2f} N; tip {most:.2f} N, {1e3 * way:.2f} mm from where it is led"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
