"""Repeat what a source did, and add an experiment of your own: another controller on its plant."""

import teleop_lab as lab
from teleop_lab import experiments
from teleop_lab.experiments import Bench, Comparison, Findings, factor


def measure(bench: Bench) -> Findings:
    """Compare a controller without integral action with the source's, on the same plant."""
    errors = {}
    for name in ("source_pid", "pd"):
        settings = {"plant": "hardware", "controller": name, "duration": 15.0}
        session = bench.session("fine_box", settings=settings)
        errors[name] = session.score.position_error_mm.rms or 0.0
    rows = [
        Comparison(
            quantity="position error, RMS",
            unit="mm",
            published=0.293,
            predicted=errors["source_pid"],
            ours=errors["pd"],
            within=factor(2.0),
        )
    ]
    return Findings(tuple(rows), notes=("ours: PD, 15 s instead of 40 s",))


def main() -> None:
    """Print an experiment of the package and the own one."""
    outcome = experiments.run("resolution")
    row = outcome.row("tip, all axes")
    print(f"{row.quantity}: published {row.published} {row.unit}, predicted {row.predicted:.3f}")
    print(f"{outcome.agreeing} of {outcome.judged} agree")
    mine = lab.Experiment("pd", "PD on the plant of the source", "Vongbunyong 2008, table 8.2", measure)
    lab.register_experiment("pd", mine, replace=True)
    print(experiments.run("pd", seed=2))


if __name__ == "__main__":
    main()
