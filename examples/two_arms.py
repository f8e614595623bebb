"""Run two arms at once: each with its own hand and robot, in one recording, scored one by one."""

import teleop_core as tc


def main() -> None:
    """Run a left RCRT-1 and a right PUMA 560, and print the score of each."""
    recording = tc.run(
        "coarse_box",
        duration=15.0,
        arms=["left", "right"],
        settings={"right/robot": "puma560", "right/haptic_master.seed": 2},
    )
    print(recording)
    print("topics of the default arm keep their names:", len(recording["slave/measured_js"]))
    for score in recording.scores():
        about = score.session
        error = score.value("position_error_mm.rms")
        print(f"{about.arm}: {about.robot}, seed {about.seed}, {error:.3f} mm RMS")


if __name__ == "__main__":
    main()
