"""Compare control laws on the plant that predicts the built arm: tracking error and control effort.

`teleop experiment controllers` does this with several hands, steps and rest positions, and draws the results.
"""

import sys

import numpy as np

import teleop_core as tc

LAWS = {
    "source_pid": "the published controller",
    "pid": "more integral action, a filtered derivative",
    "computed_torque": "knows the robot's model",
    "disturbance_observer": "estimates what else acts on a joint, and cancels it",
    "friction_compensation": "feeds dry friction forward, too",
    "adaptive": "learns friction and load as it goes",
}


def main(duration: float = 46.0) -> None:
    """Print a row for each law; errors are measured at the encoders."""
    drives = tc.load_robot("rcrt1").drives
    assert drives is not None
    print(f"{'law':22} {'RMS':>7} {'max':>7}  effort jumps by (RMS of a tick)")
    for law, what in LAWS.items():
        recording = tc.run("coarse_box", duration=duration, plant="hardware", controller=law)
        # A measured pose is published one tick after the setpoint with which it was sampled.
        wanted, seen = (recording["slave/setpoint_cp"].part(slice(-1)), recording["slave/measured_cp"])
        follows = wanted.stamp_ns > 1
        places = ["x", "y", "z"]
        error = 1e6 * np.linalg.norm(seen[places][1:] - wanted[places], axis=1)[follows]
        joints = recording["slave/measured_js"]
        names = [name for name in joints.columns if name.endswith(".effort")]
        jumps = np.diff(joints[names][:-1][follows] / drives.effort_limit, axis=0)
        rms, jump = np.sqrt(np.mean(error**2)), 100.0 * np.sqrt(np.mean(jumps**2))
        print(f"{law:22} {rms:4.0f} µm {error.max():4.0f} µm  {jump:4.1f} % of the limit   {what}")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:2]))
