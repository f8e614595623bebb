"""Try several values of a parameter, and compare the scores side by side."""

import pandas as pd

import teleop_core as tc

KEYS = ("position_error_mm.rms", "position_error_mm.max", "fixture.penetration_max_mm")


def main() -> None:
    """Print the errors for each stiffness of the wall."""
    rows = {}
    for stiffness in (250.0, 500.0, 1000.0, 2000.0):
        score = tc.run("coarse_box", duration=15.0, fixture__stiffness=stiffness).score()
        rows[f"{stiffness:.0f} N/m"] = {key: score.value(key) for key in KEYS}
    table = pd.DataFrame.from_dict(rows, orient="index")
    print(table.round(3).to_string())


if __name__ == "__main__":
    main()
