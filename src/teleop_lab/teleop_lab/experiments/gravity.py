"""Gravity: the effect of gravity compensation on axis 2 on the errors of the master-slave test."""

import numpy as np

from teleop_core.evaluation.figure import COMMAND, MEASURED, Figure, axis, line, time_axis
from teleop_core.robots import load_robot
from teleop_lab.experiments import conditions, experiment, master_slave
from teleop_lab.experiments.bench import Bench, ScoredSession, pooled
from teleop_lab.experiments.comparison import Comparison, Findings, percent

_OFF = {"gravity_compensation": "none"}
_CURVE = 2


def _rms(sessions: list[ScoredSession]) -> float:
    return pooled(float(s.score.position_error_mm.rms or 0.0) for s in sessions)


def _measure(bench: Bench) -> Findings:
    rows, figures = [], []
    for name, printed in master_slave.MODES.items():
        group = f"position error, RMS, {printed.mode}"
        on, off = bench.sessions(name, conditions.PREDICTED), bench.sessions(name, {**conditions.PREDICTED, **_OFF})
        with_it, without = _rms(on), _rms(off)
        ours = _rms(bench.sessions(name, conditions.OURS))
        ours_off = _rms(bench.sessions(name, {**conditions.OURS, **_OFF}))
        rows += [
            Comparison(
                quantity="with compensation",
                unit="mm",
                published=printed.position_mm[0],
                predicted=with_it,
                ours=ours,
                within=percent(15.0),
                group=group,
            ),
            Comparison(quantity="without", unit="mm", predicted=without, ours=ours_off, group=group),
            Comparison(
                quantity="error without compensation divided by the error with it",
                predicted=without / with_it,
                ours=ours_off / ours,
                group=group,
            ),
        ]
        figures.append(_figure(printed.mode, on[0], off[0]))
    return Findings((*rows, *_effort_rows()), tuple(figures), _NOTES)


_NOTES = (
    "The source compensates gravity on axis 2 alone and prints no errors without; it credits the "
    "compensation with small errors along z.",
)


def _effort_rows() -> list[Comparison]:
    """Rows of the efforts that balance the arm's weight, compared with the closed form for the same parameters."""
    robot = load_robot("rcrt1")
    assert robot.dynamics is not None
    held = np.zeros(robot.n)
    level = robot.home.copy()
    level[1] = 0.5 * np.pi
    group = "efforts that hold the arm (eqs. 4.6.6-4.6.8, computed, not printed)"
    rows = []
    for q, where, values in ((robot.home, "at home", (-1.4084, -3.0740)), (level, "arm level", (-1.8141, 0.0))):
        robot.dynamics.gravity(q, robot.dynamics.parameters, held)
        for k, value, name, unit in ((1, values[0], "C2", "N·m"), (2, values[1], "C3", "N")):
            rows.append(
                Comparison(
                    quantity=f"{name} {where}",
                    unit=unit,
                    published=value,
                    predicted=held[k],
                    within=percent(0.1),
                    group=group,
                )
            )
    return rows


def _figure(mode: str, on: ScoredSession, off: ScoredSession) -> Figure:
    traces = []
    for session, name, color in ((off, "without", COMMAND), (on, "with compensation", MEASURED)):
        found = master_slave.drawn_of(session)
        error = np.linalg.norm(found.measured - found.reference, axis=1)[::_CURVE]
        traces.append(line(found.times[::_CURVE], error, name, color, 1.2))
    layout = {"xaxis": time_axis(), "yaxis": axis("position error", "mm", rangemode="tozero")}
    sentence = f"Position error in {mode} mode with and without compensation of gravity."
    return Figure(f"Gravity compensation, {mode}", sentence, traces, layout, 340)


GRAVITY = experiment.Experiment(
    "gravity",
    "effect of gravity compensation on axis 2 on the errors",
    "Vongbunyong 2008, sections 4.6, 6.1 and 7.6",
    _measure,
)
