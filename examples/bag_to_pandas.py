"""Open a recording as a pandas data frame, and plot it."""

import sys
import tempfile
from pathlib import Path

import plotly.graph_objects as go

import teleop_core as tc


def plot(recording: tc.Recording, page: Path) -> None:
    """Write a page with the commanded and the measured height of the tool."""
    frame = recording.frame("slave/servo_cp", "slave/measured_cp")
    figure = go.Figure()
    for topic in ("slave/servo_cp", "slave/measured_cp"):
        figure.add_scatter(x=frame.index, y=1e3 * frame[f"{topic}.z"], name=topic)
    figure.update_layout(xaxis_title="time [s]", yaxis_title="z [mm]")
    figure.write_html(page)


def main(folder: Path) -> None:
    """Record ten seconds, print the summary of the data frame, and write the plot."""
    tc.run("coarse_box", duration=10.0, out=folder / "bag")
    recording = tc.open_recording(folder / "bag")
    joints = recording["slave/measured_js"].frame()
    speeds = joints.filter(like=".velocity").abs().max()
    print(f"{len(joints)} rows; the fastest joint is {speeds.idxmax()} with {speeds.max():.3f}")
    plot(recording, folder / "height.html")
    print(f"height.html: {(folder / 'height.html').stat().st_size / 1e6:.0f} MB")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            main(Path(folder))
