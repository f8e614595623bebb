"""Move the hand along a table of numbers, such as a motion that another system recorded."""

import csv
import tempfile
from pathlib import Path

import numpy as np

import teleop_core as tc


def write_table(path: Path) -> None:
    """Write a circle of 20 mm in four seconds; missing columns are zero."""
    times = np.linspace(0.0, 4.0, 81)
    angle = 2.0 * np.pi * times / 4.0
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "x", "y", "z"])
        rows = np.stack((times, 0.01 * np.cos(angle), 0.01 * np.sin(angle), 0.0 * angle), axis=1)
        for row in rows.tolist():
            writer.writerow([f"{value:.6f}" for value in row])


def main() -> None:
    """Run five seconds of the motion, and print the distances that hand and slave moved."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder, "circle.csv")
        write_table(table)
        recording = tc.run(operator=table, duration=5.0)
    # The slave first moves to its start; the hand waits until then.
    state = recording["teleop/state"]
    begin = state.time[state["is_following"] > 0.0][0]
    for topic in ("master/measured_cp", "slave/measured_cp"):
        stream = recording[topic]
        position = stream[["x", "y", "z"]][stream.time >= begin]
        width = np.ptp(position, axis=0).max()
        print(f"{topic}: {1e3 * width:.1f} mm wide")


if __name__ == "__main__":
    main()
