"""Fit a plant to rest positions of a machine, and predict how the machine follows a hand."""

from pathlib import Path
from tempfile import TemporaryDirectory

import teleop_core as tc
import teleop_lab as lab

FREE = ("coulomb.theta1", "coulomb.theta2", "bias.theta1", "weight.m2b_L0b")
PUBLISHED = {"coarse_box": 0.338, "fine_box": 0.293}  # Vongbunyong 2008, table 8.2, RMS [mm]


def main() -> None:
    """Fit to tables 7.1-7.6, predict table 8.2, and try another control law on the same plant."""
    found = lab.fit_plant(free=FREE)  # rows of joint positions at rest; your own CSV file works as well
    for number in found.numbers:
        print(f"{number.name} = {number.value:.3g} ({number.low:.3g} to {number.high:.3g})")

    with TemporaryDirectory() as folder:
        plant = Path(folder) / "plant.yaml"
        plant.write_text(found.parameter_file(), encoding="utf-8")
        for name, published in PUBLISHED.items():
            print(f"{name}: published {published} mm RMS", end="")
            for law, says in (("source_pid", "predicted"), ("disturbance_observer", "with ours")):
                recording = tc.run(name, files=[plant], controller=law, duration=16.0)
                error = recording.score().position_error_mm.rms
                print(f", {says} {error:.3f}", end="")
            print()

    ideal = tc.run("coarse_box", plant="ideal", duration=16.0).score().position_error_mm.rms
    print(f"the source's law on an ideal plant: {ideal:.3f}, which predicts nothing")


if __name__ == "__main__":
    main()
