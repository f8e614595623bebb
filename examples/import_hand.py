"""Import the motion of a hand that was recorded elsewhere, let the slave follow it, and export."""

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

import teleop_core as tc
import teleop_exchange


def record_elsewhere(file: Path) -> None:
    """Write a file like that of a motion capture system: irregular times in ms, positions in mm, angles."""
    rng = np.random.default_rng(7)
    times = np.cumsum(rng.uniform(9.0, 11.0, 1000))
    phase = 2e-3 * np.pi * times
    table = pd.DataFrame(
        {
            "stamp": times,
            "X (mm)": 15.0 * np.cos(0.5 * phase),
            "Y (mm)": 10.0 * np.sin(phase),
            "Z (mm)": 900.0 + 2.0 * np.sin(0.3 * phase),
            "Roll (deg)": 8.0 * np.sin(0.4 * phase),
            "Pitch (deg)": 5.0 * np.cos(0.7 * phase),
            "Yaw (deg)": 12.0 * np.sin(0.2 * phase),
        }
    )
    table.loc[300:309, "Y (mm)"] = np.nan  # a marker was hidden
    table.to_csv(file, index=False)


def main() -> None:
    """Import, replay and export; print the results."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        record_elsewhere(place / "hand.csv")
        report = teleop_exchange.import_recording(place / "hand.csv", place / "hand", center="mean")
        print(report)
        answer = tc.replay(report.recording)
        teleop_exchange.export_recording(answer, place / "answer.parquet", rate=100.0)
        table = pd.read_parquet(place / "answer.parquet")
        print(f"answer.parquet: {len(table)} rows, {len(table.columns)} columns")
        table = table[table["teleop/state.is_following"] == 1.0]  # before this time the arm moves to its start
        for topic in ("master/measured_cp", "slave/measured_cp"):
            columns = [f"{topic}.{axis}" for axis in "xyz"]
            width = (table[columns].max() - table[columns].min()).max()
            print(f"{topic}: {1e3 * width:.1f} mm wide")


if __name__ == "__main__":
    main()
