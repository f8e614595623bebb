"""Delay: how much latency slows an operator who sees the slave, and how much a smaller scale helps."""

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

from teleop_core.evaluation.figure import Figure
from teleop_lab.experiments.bench import Bench, Settings
from teleop_lab.experiments.comparison import EXACT, Comparison, Findings, percent
from teleop_lab.experiments.experiment import Experiment

if TYPE_CHECKING:
    from xarray import DataArray

LATE = "network.there.least_delay"
GAIN = "coarse_gain"
DELAYS = (0.0, 0.25, 0.5, 1.0)
"""Delays of the commands [s]."""
FOLLOWED = DELAYS[:3]
GAINS = (1.0, 0.5, 0.2)
SCALED = 0.5
"""Delay of the commands in the comparison of scales [s]."""
_KEYS = ("task.time_s", "task.error_share", "task.effective_width_mm", "task.throughput")
_FIXED: Settings = {
    "teleop.stages": ("network", "display", "task"),
    "feedback_timeout": 5.0,  # longer than the delay, which must not count as an outage
}
Scores = Callable[[str], "DataArray"]
"""Function that returns the means over the seeds for the key of a score."""


def _study(bench: Bench, kind: str, delays: tuple[float, ...], gains: tuple[float, ...]) -> Scores:
    """Sessions of the scenario ``point`` with a task, over delays and scales."""
    from teleop_lab.studies import Study

    swept = {LATE: delays, GAIN: gains}
    fixed = {**_FIXED, "task.kind": kind}
    found = Study("point", swept, tuple(bench.seeds), _KEYS, fixed).run(jobs=bench.workers, progress=bench.progress)
    return lambda key: found[key].mean("seed")


def _rises(quantity: str, low: float, high: float, group: str) -> Comparison:
    """Row that tests whether a score is larger in the second case, as the source reports; 1 means yes."""
    is_so = float(high > low)
    note = f"{low:.3g} and {high:.3g}"
    return Comparison(quantity=quantity, published=1.0, predicted=is_so, within=EXACT, group=group, note=note)


def _delays(bench: Bench) -> Findings:
    pressed = _study(bench, "point", DELAYS, (0.5,))("task.time_s").values[:, 0]
    followed = _study(bench, "follow", FOLLOWED, (0.5,))
    none, some = float(pressed[0]), float(pressed[1])
    looks = (some - none) / DELAYS[1]
    pressing, group = "press in targets on a ring", "follow a point that wanders: order"
    rows = [
        Comparison(
            quantity="looks in an attempt: increase of its time divided by the delay", predicted=looks, group=pressing
        ),
        Comparison(quantity="time of an attempt, not late", unit="s", predicted=none, group=pressing),
    ]
    for delay, time in zip(DELAYS[2:], pressed[2:], strict=True):
        rows.append(
            Comparison(
                quantity=f"time of an attempt, {1e3 * delay:g} ms late",
                unit="s",
                published=none + looks * delay,
                predicted=float(time),
                basis="law",
                within=percent(15.0),
                group=pressing,
            )
        )
    for key, what in (("task.error_share", "errors"), ("task.effective_width_mm", "deviation")):
        values = followed(key).values[:, 0]
        for i, delay in enumerate(FOLLOWED[1:], start=1):
            text = f"{what} larger, {1e3 * delay:g} ms late than {1e3 * FOLLOWED[i - 1]:g}"
            rows.append(_rises(text, float(values[i - 1]), float(values[i]), group))
    return Findings(tuple(rows), (), _DELAY_NOTES)


_DELAY_NOTES = (
    "The law is that of Ferrell 1965: a task takes T0 + n (delay + reaction), n the number of "
    "looks. n is taken from the shortest delay, so the longer ones test that the time is a "
    "straight line.",
    "Korte 2014 led a PA-10 along a path with a Phantom Omni, 0 to 2.5 s late, at a speed of one's "
    "own; our point goes on whether it is followed or not. So only the order is compared.",
    "An order counts as 1 where it is as published.",
)


def _scaling(bench: Bench) -> Findings:
    score = _study(bench, "point", (0.0, SCALED), GAINS)
    late, rows = f"{1e3 * SCALED:g} ms late: order", []
    for larger, smaller in pairwise(GAINS):
        for key, what in (("task.effective_width_mm", "spread of the end points"), ("task.error_share", "errors")):
            values = score(key).sel({LATE: SCALED})
            low, high = (float(values.sel({GAIN: gain})) for gain in (smaller, larger))
            if high > 0.0 or key != "task.error_share":
                text = f"{what} larger, scale {larger:g} than {smaller:g}"
                rows.append(_rises(text, low, high, late))
    for delay in (0.0, SCALED):
        for gain in GAINS:
            at = {LATE: delay, GAIN: gain}
            group = f"{1e3 * delay:g} ms late"
            rows += [
                Comparison(quantity=f"time of an attempt, scale {gain:g}", unit="s", group=group,
                    predicted=float(score("task.time_s").sel(at))),
                Comparison(quantity=f"throughput, scale {gain:g}", unit="bit/s", group=group,
                    predicted=float(score("task.throughput").sel(at))),
            ]  # fmt: skip
    return Findings(tuple(rows), (_figure(score),), _SCALING_NOTES)


def _figure(score: Scores) -> Figure:
    """Plot of the spread of the end points against the scale, with a line for each delay."""
    widths = score("task.effective_width_mm")
    traces = [
        {
            "type": "scatter",
            "mode": "lines+markers",
            "name": f"{1e3 * delay:g} ms late",
            "x": list(GAINS),
            "y": widths.sel({LATE: delay}).values,
        }
        for delay in (0.0, SCALED)
    ]
    layout = {
        "xaxis": {"title": {"text": "scale from hand to slave"}},
        "yaxis": {"title": {"text": "effective width [mm]"}},
    }
    sentence = "The end points of presses spread less with a smaller scale, with and without delay."
    return Figure("Spread of the end points by scale", sentence, traces, layout)


_SCALING_NOTES = (
    "Richter, Orosco and Yip 2019 let people reach targets late with several scales: scaled down "
    "they make fewer errors. An order counts as 1 where it is as published.",
    "A hand moves no faster with a smaller scale, so an attempt takes longer.",
)

DELAY = Experiment(
    "delay",
    "effect of a delayed line on an operator who sees: times, errors and deviations",
    "Ferrell 1965; Korte et al. 2014 (order of errors and deviations)",
    _delays,
)
SCALING_UNDER_DELAY = Experiment(
    "scaling_under_delay",
    "whether a smaller scale from hand to slave reduces the errors that a delayed line causes",
    "Richter, Orosco and Yip 2019 (order)",
    _scaling,
)
