"""Carry three blocks from peg to peg, with higher pegs, tighter holes, and slippery fingers."""

import teleop_core as tc

CASES: dict[str, dict[str, float]] = {
    "nothing else": {},
    "pegs higher than the hand lifts": {"jaw_sim.pegs.height": 0.04},
    "a clearance of 0.1 mm": {"jaw_sim.pegs.clearance": 0.0001},
    "a friction of 0.05": {"jaw_sim.object.friction": 0.05},
}


def main() -> None:
    """Print for each case the number of transferred blocks and the largest force on a peg."""
    print(f"{'':34}{'transferred':>12}{'dropped':>9}{'time, s':>9}{'pull, N':>9}{'slips':>7}")
    for name, settings in CASES.items():
        score = tc.run("peg_transfer", settings=settings).score()
        keys = ("transfer.transferred", "transfer.dropped", "transfer.time_s",
                "transfer.peak_pull_n", "jaw.slips")  # fmt: skip
        cells = ("-" if value is None else f"{value:.3g}" for value in map(score.value, keys))
        columns = zip(cells, (12, 9, 9, 9, 7), strict=True)
        print(f"{name:34}" + "".join(f"{cell:>{width}}" for cell, width in columns))


if __name__ == "__main__":
    main()
