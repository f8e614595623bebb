"""Fitts: movement times to a target on a delayed screen, of people and of the operator `observer`."""

import math

from teleop_lab.experiments import experiment, look_and_move
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Comparison, Findings, percent

LAGS = (0.0083, 0.025, 0.075, 0.225)
"""Delays of the screen [s]."""
TIMES = (0.911, 0.934, 1.059, 1.493)
"""Printed mean movement times at the delays of `LAGS` [s]."""
WAYS = (96.0, 192.0, 384.0)
"""Distances of the targets [pixels]; only the ratio of distance and width matters."""
WIDTHS = (6.0, 12.0, 24.0, 48.0)
"""Widths of the targets [pixels]."""
LATENCIES = (0.033, 0.133, 0.333)
"""Latencies of the display in sessions of the scenario ``point`` [s]."""


def _laws() -> list[Comparison]:
    rows = []
    for lag, time in zip(LAGS, TIMES, strict=True):
        found = [look_and_move.movement_time(way, width, lag)[0] for way in WAYS for width in WIDTHS]
        rows.append(
            Comparison(
                quantity=f"time of movement, {1e3 * lag:g} ms late",
                unit="s",
                published=time,
                predicted=sum(found) / len(found),
                group="pointing",
            )
        )
    return rows


def _sessions(bench: Bench) -> list[Comparison]:
    """Compare movement times of whole sessions with the slowing that the look-move cycle predicts."""
    times = []
    for latency in LATENCIES:
        session = bench.session("point", settings={"display.latency": latency})
        times.append(float(session.score.value("task.time_s") or math.nan))
    rows = []
    for latency, time in zip(LATENCIES[1:], times[1:], strict=True):
        law = times[0] * (look_and_move.CYCLE + latency) / (look_and_move.CYCLE + LATENCIES[0])
        rows.append(
            Comparison(
                quantity=f"time of an attempt, display {1e3 * latency:g} ms late",
                unit="s",
                published=law,
                predicted=time,
                basis="law",
                within=percent(15.0),
                group="through master, mapping, arm and display",
            )
        )
    return rows


_NOTES = (
    "The constants of the operator observer are set on the four times of movement; the rows of "
    "pointing show how well that is possible, and predict nothing.",
    "The law of the sessions: a motion that the eye leads slows by (0.325 s + latency). A session "
    "has times that no delay changes, such as a reaction and the way of a slow arm.",
    "Errors (3.6, 3.6, 4.9, 11.3 %) are not predicted: the observer presses where it saw the tip. "
    "With operator.observer.error_cost=1.0 it presses unseen, and misses 1.7, 2.2, 3.7, 10.0 %; "
    "but it then is 15 % too fast at 225 ms.",
)


def _measure(bench: Bench) -> Findings:
    return Findings((*_laws(), *_sessions(bench)), (), _NOTES)


FITTS = experiment.Experiment(
    "fitts",
    "times to press inside targets that are seen late, of people and of the operator `observer`",
    "MacKenzie and Ware 1993",
    _measure,
)
