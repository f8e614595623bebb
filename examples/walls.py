"""Press against walls: the distance of the hand beyond a wall for several aims, and the energy that walls return."""

import warnings

import pandas as pd

import teleop_core as tc

WALLS = ("damped", "hard", "source", "soft", "step")
AIMS_MM = (1.0, 2.0, 4.0, 6.0, 10.0)
BOX_MM = 30.0


def scores(aim_mm: float, wall: str) -> dict[str, object]:
    """Overshoot and energy in the box of coarse_box, for a hand that aims beyond the walls by ``aim_mm``."""
    side = 1e-3 * (BOX_MM + 2.0 * aim_mm)
    score = tc.run(
        "coarse_box", duration=25.0, operator="random", operator__period=10.0,
        operator__size=[side] * 3, fixture__wall=wall,
    ).score()  # fmt: skip
    shares = score.value("contact.returned_max")
    return {
        "wall": wall,
        "aims out [mm]": aim_mm,
        "hand out [mm]": score.value("fixture.hand_penetration_max_mm"),
        "slave out [mm]": score.value("fixture.penetration_max_mm"),
        "force [N]": score.value("force_n.max"),
        "contacts": score.value("contact.count"),
        "wall gave more": score.value("contact.feeding"),
        "device too": score.value("contact.feeding_device"),
        "given back, most [%]": None if shares is None else 100.0 * shares,
    }


def main() -> None:
    """Print the overshoot by aim for the damped wall, then all walls at the scenario's own aim."""
    warnings.simplefilter("ignore")  # the warning that some walls are stiffer than the device
    rows = [scores(aim, "damped") for aim in AIMS_MM]
    rows += [scores(2.0, wall) for wall in WALLS[1:]]
    print(pd.DataFrame(rows).round(2).to_string(index=False))


if __name__ == "__main__":
    main()
