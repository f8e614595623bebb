"""Measure the effect of a delay and a gain: sessions over named values and seeds, as an xarray data set."""

from pathlib import Path
from tempfile import TemporaryDirectory

from teleop_lab import Study


def main() -> None:
    """Print the cost, run the sessions, and print the means; a second call would run no session."""
    study = Study(
        "point",
        {"display.latency": (0.033, 0.333), "coarse_gain": (0.5, 1.0)},
        seeds=(1, 2),
        metrics=("task.time_s", "task.error_share"),
        settings={"teleop.duration": 16.0},
    )
    with TemporaryDirectory() as folder:
        store = Path(folder) / "delay"
        print(study.explain(store))
        found = study.run(store)
        print("again:", study.explain(store))
    times = found["task.time_s"].mean("seed")
    for latency in found["display.latency"].values:
        row = times.sel({"display.latency": latency})
        slow, fast = (float(row.sel(coarse_gain=gain)) for gain in (0.5, 1.0))
        print(f"seen {1e3 * latency:.0f} ms late: {slow:.2f} s at gain 0.5, {fast:.2f} s at gain 1")


if __name__ == "__main__":
    main()
