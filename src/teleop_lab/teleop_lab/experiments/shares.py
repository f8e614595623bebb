"""Shares: how much each fault of the plant adds to the errors, found by switching off one fault at a time."""

import numpy as np

from teleop_core.evaluation.figure import FIRST, SECOND, Figure, axis
from teleop_core.slave.plants.hardware import FAULTS
from teleop_lab.experiments import conditions, experiment
from teleop_lab.experiments.bench import Bench, ScoredSession, Settings
from teleop_lab.experiments.comparison import Comparison, Findings


def _without(bench: Bench, *faults: str) -> ScoredSession:
    off: Settings = {"plant.hardware.without": faults}
    return bench.session("coarse_box", settings={**conditions.PREDICTED, **off})


def _errors(session: ScoredSession) -> tuple[float, float]:
    score = session.score
    return float(score.position_error_mm.rms or 0.0), float(score.true_error_mm.rms or 0.0)


def _measure(bench: Bench) -> Findings:
    whole = _errors(_without(bench))
    alone = {name: _errors(_without(bench, name)) for name in FAULTS}
    none = _errors(_without(bench, *FAULTS))
    rows = []
    for k, group in enumerate(("at the encoders, RMS", "at the true tip, RMS")):
        rows.append(Comparison(quantity="all faults", unit="mm", predicted=whole[k], group=group))
        rows += [
            Comparison(quantity=f"without {name}", unit="mm", predicted=found[k], group=group)
            for name, found in alone.items()
        ]
        rows.append(Comparison(quantity="without any", unit="mm", predicted=none[k], group=group))
    return Findings(tuple(rows), (_figure(whole, alone),), _NOTES)


_NOTES = (
    "; ".join(f"{name}: {text}" for name, text in FAULTS.items()) + ".",
    "Squares of independent errors add, shares need not: sticking friction also hides a bias.",
    "Encoders see nothing that lies behind them, so the published errors hold no share of it.",
)


def _figure(whole: tuple[float, float], alone: dict[str, tuple[float, float]]) -> Figure:
    names = list(alone)
    traces = []
    for k, (place, color) in enumerate((("at the encoders", FIRST), ("at the true tip", SECOND))):
        less = np.array([whole[k] - alone[name][k] for name in names])
        traces.append({"type": "bar", "orientation": "h", "name": place, "x": less, "y": names,
                       "marker": {"color": color}, "hovertemplate": "%{x:.3f} mm"})  # fmt: skip
    layout = {"xaxis": axis("error that goes with it", "mm"), "yaxis": {"automargin": True}, "barmode": "group"}
    sentence = "Decrease of the RMS error of coarse_box if one fault is switched off."
    return Figure("Contribution of each fault", sentence, traces, layout, 380)


SHARES = experiment.Experiment(
    "shares",
    "contribution of each fault of the plant to the errors in coarse_box",
    "of our model; Vongbunyong 2008 names the faults in chapter 8",
    _measure,
)
