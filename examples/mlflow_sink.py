"""Send a study to MLflow: a run for each session, with its parameters and scores.

pip install mlflow-skinny
MLFLOW_TRACKING_URI=sqlite:///runs.db python examples/mlflow_sink.py
"""

import sys

import numpy as np

from teleop_lab import sweep

METRICS = ["position_error_mm.rms", "position_error_mm.max"]


def main() -> None:
    """Run four sessions, and log each."""
    try:
        import mlflow
    except ImportError:
        sys.exit("this example needs MLflow: pip install mlflow-skinny")
    found = sweep(
        "coarse_box", metrics=METRICS, seed=range(1, 3), coarse_gain=[0.5, 1.0],
        teleop__duration=2.0, jobs=1,
    )  # fmt: skip
    mlflow.set_experiment("teleop: coarse_gain")
    for index in np.ndindex(*found["error"].shape):
        point = found.isel(dict(zip(found["error"].dims, index, strict=True)))
        with mlflow.start_run():
            mlflow.log_params({name: value.item() for name, value in point.coords.items()})
            mlflow.set_tags({name: str(value) for name, value in found.attrs.items()})
            mlflow.log_metrics({name: float(point[name]) for name in METRICS})
    print(f"{found['error'].size} runs logged to {mlflow.get_tracking_uri()}")


if __name__ == "__main__":
    main()
