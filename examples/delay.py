"""Delay one link, as a slow network between two machines would."""

import numpy as np

import teleop_core as tc


def main() -> None:
    """Print the added delay of the slave's references, and the resulting error."""
    recordings = [tc.run("coarse_box", duration=15.0, delays=delays) for delays in ({}, {"slave/servo_jp": 0.02})]
    stamps = [recording["slave/setpoint_js"].stamp_ns for recording in recordings]
    behind = (recordings[0]["slave/setpoint_js"].log_ns - stamps[1]) * 1e-6
    print(f"the reference in force is {np.median(behind):.0f} ms old, in place of 0")
    for name, recording in zip(("direct", "delayed"), recordings, strict=True):
        error = recording.score().value("command_error_mm.rms")
        print(f"{name}: slave {error:.2f} mm RMS from what was commanded")


if __name__ == "__main__":
    main()
