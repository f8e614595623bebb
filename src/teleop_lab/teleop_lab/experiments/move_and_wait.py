"""Move and wait: the time of a task over delays up to 3 s, and what a predictive display changes."""

from typing import NamedTuple

import numpy as np

from teleop_core.evaluation.figure import Figure
from teleop_lab.experiments.bench import Bench, Settings
from teleop_lab.experiments.comparison import Comparison, Findings, percent
from teleop_lab.experiments.experiment import Experiment

DELAYS = (0.0, 0.5, 1.0, 2.0, 3.0)
"""Delays of the commands [s]."""
_FIXED: Settings = {
    "teleop.stages": ("network", "display", "task"),
    "feedback_timeout": 5.0,  # longer than the delay, which must not count as an outage
    "operator.observer.longest_wait": 6.0,  # the operator must not give up before the longest delay
}


class Way(NamedTuple):
    """A task whose pace the operator chooses: what its attempt is, its scenario and settings, and a session's length.

    The length of a session is ``seconds`` and ``seconds_per_delay`` for each second of the delay [s].
    """

    name: str
    scenario: str
    settings: Settings
    seconds: float
    seconds_per_delay: float


POINTING = Way("press in a target", "point", {**_FIXED, "coarse_gain": 0.5, "task.point.stays": True}, 40.0, 60.0)
ENTERING = Way("enter a target", "point", {**POINTING.settings, "task.point.by_entering": True}, 40.0, 60.0)
TRACING = Way(
    "trace 4 mm of a ring", "point",
    {**_FIXED, "coarse_gain": 0.5, "task.kind": "trace", "task.trace.waits": True}, 30.0, 30.0,
)  # fmt: skip
TRANSFER = Way(
    "transfer a block, one arm", "peg_transfer",
    {**_FIXED, "teleop.stages": ("network", "jaw_command", "jaw", "jaw_sim", "display", "task"), "operator": "observer",
     "operator.tremor_amplitude": 0.0, "operator.buttons.jaw": (), "task": "peg_transfer",
     "jaw_sim.pegs.clearance": 0.003, "task.peg_transfer.clearance": 0.003, "task.peg_transfer.longest": 600.0},
    35.0, 65.0,
)  # fmt: skip


def _times(bench: Bench, way: Way, shows: str = "slave") -> np.ndarray:
    """Mean time of an attempt at each of the delays [s]."""
    times = []
    for delay in DELAYS:
        given = {
            **way.settings,
            "teleop.duration": way.seconds + way.seconds_per_delay * delay,
            "network.there.least_delay": delay,
            "display.shows": shows,
        }
        times.append(bench.session(way.scenario, settings=given).score.value("task.time_s"))
    return np.array(times, np.float64)


def _move_and_wait(bench: Bench) -> Findings:
    rows, traces = list[Comparison](), []
    for way in (POINTING, TRACING, TRANSFER):
        times = _times(bench, way)
        looks, none = np.polyfit(DELAYS, times, 1)
        group = way.name
        rows += [
            Comparison(quantity="time without a delay, of the fitted line", unit="s", predicted=none, group=group),
            Comparison(quantity="delays that an attempt waits for", predicted=looks, group=group),
        ]
        for delay, time in zip(DELAYS, times, strict=True):
            line = none + looks * delay
            rows.append(
                Comparison(
                    quantity=f"time, {delay:g} s late", unit="s", published=line, predicted=time, basis="law",
                    within=percent(10.0), group=group,
                )
            )  # fmt: skip
        traces.append(_trace(way.name, times))
    for way in (ENTERING, TRACING):
        seen, predicted = (np.polyfit(DELAYS, _times(bench, way, shows), 1)[0] for shows in ("slave", "command"))
        group = f"predictive display: {way.name}"
        rows += [
            Comparison(quantity="delays that an attempt waits for, slave shown", predicted=seen, group=group),
            Comparison(quantity="delays that an attempt waits for, command shown", predicted=predicted, group=group),
        ]
    layout = {"xaxis": {"title": {"text": "delay of the commands [s]"}}, "yaxis": {"title": {"text": "time [s]"}}}
    sentence = "The time of an attempt is a straight line over the delay; its slope is the number of waits."
    return Findings(tuple(rows), (Figure("Move and wait", sentence, traces, layout),), _NOTES)


def _trace(name: str, times: np.ndarray) -> dict[str, object]:
    return {"type": "scatter", "mode": "lines+markers", "name": name, "x": list(DELAYS), "y": times}


_NOTES = (
    "The law is that of Ferrell 1965: T = T0 + N delay, where N does not depend on the delay. Each line is fitted to "
    "the five times, so a row says how far a time is from it.",
    "One seed, the first of the bench. With task.trace.waits the point goes on by 4 mm when the tip is near.",
    "A predictive display shows the command. The arm enters the target later, so one delay of an attempt remains. "
    "Nothing delays a press, so a press would come before the arm; therefore the target is entered here.",
)

MOVE_AND_WAIT = Experiment(
    "move_and_wait",
    "time of pointing, tracing and peg transfer over 0 to 3 s of delay, and with a predictive display",
    "Ferrell 1965",
    _move_and_wait,
)
