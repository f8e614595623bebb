"""Touch tissue over a delayed line, with each kind of passivity.

The simulated hand of the scenario ``palpation`` presses a block for 20 s of virtual time. The example prints the
largest speed of the hand after it engages the slave, and the forces on hand and tip.
"""

import sys

import numpy as np

import teleop_core as tc

QUIET = {"feedback_timeout": 1.0, "reach_force.is_on": False, "gimbal_noise": 0.0}


def touch(passivity: str, round_trip: float, material: str = "tissue") -> tuple[float, ...]:
    """Largest speed of the hand [m/s], RMS of its force, and largest and RMS force on the tip [N]."""
    late = dict.fromkeys(("network.there.least_delay", "network.back.least_delay"), 0.5 * round_trip)
    settings = QUIET | late | {"reflection.passivity": passivity, "world.material": material}
    session = tc.run("palpation", duration=20.0, stages=["network", "passivity"], settings=settings)
    hand = session["master/measured_cp"].values[5000:, :3]
    fastest = np.linalg.norm(hand[20:] - hand[:-20], axis=1).max() / 0.02
    push = np.linalg.norm(session["master/servo_cf"].values[:, :3], axis=1)
    force = np.linalg.norm(session["slave/measured_cf"].values[:, :3], axis=1)
    return float(fastest), rms(push), float(force.max()), rms(force)


def rms(sizes: np.ndarray) -> float:
    """Root mean square of the values that are not zero."""
    return float(np.sqrt((sizes[sizes > 0.0] ** 2).mean())) if sizes.any() else 0.0


def main() -> int:
    """Print a line for each kind and round trip."""
    for passivity in ("none", "tank", "tdpa", "wave"):
        for round_trip in (0.0, 0.2, 0.7):
            speed, felt, most, usual = touch(passivity, round_trip)
            print(
                f"{passivity:4} {1e3 * round_trip:3.0f} ms: hand at most {1e3 * speed:3.0f} mm/s, "
                f"feels {felt:.2f} N RMS; tip {most:.1f} N at most, {usual:.2f} N RMS"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
