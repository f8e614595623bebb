"""Teleoperate an arm that is described only by its URDF: kinematics, drives, and a session."""

from pathlib import Path

import numpy as np

import teleop_core as tc

URDF = str(Path(__file__).with_name("any_arm.urdf"))


def main() -> None:
    """Print the content of the file, the share of poses that inverse kinematics finds again, and the tracking error."""
    arm = tc.load_robot(URDF, tip="tool0")
    print(f"{arm.name}: {', '.join(arm.joint_names)}; tip at {arm.fk(arm.home)[:3, 3].round(3)}")
    if arm.drives is not None:
        print(f"what the file leaves out, and is assumed: {', '.join(arm.drives.assumed)}")
    q = np.random.default_rng(1).uniform(arm.lower, arm.upper, (1000, arm.n))
    answers = arm.ik_batch(arm.fk(q))
    found = np.hypot(*answers.residual.T) < 1e-9
    print(f"{100.0 * found.mean():.1f} % of 1000 legal poses reached from home")
    recording = tc.run("coarse_box", duration=10.0, robot=URDF, geometry=["tip=tool0"])
    error = recording.score().value("position_error_mm.rms")
    print(f"{arm.name}: {error:.3f} mm RMS behind its reference")


if __name__ == "__main__":
    main()
