"""Accuracy: moves of the slave alone, measured with a ruler beside it (appendix E)."""

import math
from typing import NamedTuple

import numpy as np

from teleop_core.errors import TeleopError
from teleop_core.evaluation.figure import FIRST, SECOND, Figure
from teleop_core.experiments.bench import Bench
from teleop_core.experiments.drawing import axis, joined, published_points
from teleop_core.experiments.experiment import Experiment
from teleop_core.experiments.outcome import Findings, Row, absolute
from teleop_core.geometry import Array, rotation, transform
from teleop_core.robots import Robot, load_robot

DESIRED_MM = np.arange(10.0, 101.0, 10.0)
ESCAPE_MM = 30.0
"""Move along -x before those along y, for home lies on the edge of the reach."""
RULER_MM = 0.5
D3_OFFSET_MM = 5.5
"""What the true d3 is longer than the encoder says."""


class Axis(NamedTuple):
    """Moves along one axis.

    Attributes:
        direction: Unit vector of the moves in the base.
        escape_mm: Move along -x before them [mm].
        read_mm: What the ruler was read as, at each target (10,) [mm].
        step_mm: Smallest step between those readings [mm].
        rms: As printed [mm].
        deviation: As printed [mm].
        largest: As printed [mm].
    """

    direction: tuple[float, float, float]
    escape_mm: float
    read_mm: tuple[float, ...]
    step_mm: float
    rms: float
    deviation: float
    largest: float


# Tables E.1-E.4; of y the readings are distances from home.
AXES = {
    "x": Axis((-1.0, 0.0, 0.0), 0.0,
              (10.25, 20.0, 30.0, 40.25, 50.25, 60.5, 70.5, 79.5, 90.0, 100.25), 0.25,
              0.32, 0.29, 0.50),
    "y": Axis((0.0, 1.0, 0.0), ESCAPE_MM,
              (31.5, 36.0, 43.0, 50.5, 58.5, 68.0, 77.0, 86.5, 96.0, 105.5), 0.5,
              0.85, 0.56, 1.19),
    "z": Axis((0.0, 0.0, 1.0), 0.0,
              (10.0, 20.0, 29.5, 40.5, 50.5, 60.0, 71.0, 81.0, 91.75, 102.0), 0.25,
              0.99, 0.81, 2.00),
}  # fmt: skip


def moved(reading_mm: Array, escape_mm: float) -> Array:
    """Way along the axis [mm] of readings [mm] from home, which lies ``escape_mm`` beside it."""
    return np.sqrt(np.square(reading_mm) - escape_mm**2)


def published_errors(which: Axis) -> Array:
    """Desired less measured (10,) [mm]."""
    return DESIRED_MM - moved(np.array(which.read_mm), which.escape_mm)


def readings(robot: Robot, which: Axis, offset_mm: float, step_mm: float | None = None) -> Array:
    """What a ruler says at each target (10,) [mm], of an arm whose d3 is longer than it knows.

    The tool stays along x; at every target the encoders say what inverse kinematics asked for.

    Args:
        robot: The arm as its controller knows it.
        which: The moves.
        offset_mm: What d3 is longer [mm].
        step_mm: Step to which the ruler is read [mm]; None: exactly.

    Raises:
        TeleopError: A target cannot be reached.
    """
    home = _wrist(robot) + np.array([robot.geometry["L6"], 0.0, 0.0])
    escape = np.array([-1e-3 * which.escape_mm, 0.0, 0.0])
    ways = 1e-3 * DESIRED_MM[:, None] * np.array(which.direction)
    start = _true_tip(robot, home, offset_mm)
    true = np.array([_true_tip(robot, home + escape + way, offset_mm) for way in ways])
    if which.escape_mm:
        read = 1e3 * np.linalg.norm(true - start, axis=1)
    else:
        read = 1e3 * (true - start) @ np.array(which.direction)
    return read if step_mm is None else np.round(read / step_mm) * step_mm


def _wrist(robot: Robot) -> Array:
    """Centre of the wrist at home (3,) [m]."""
    pose = robot.fk(robot.home)
    return np.asarray(pose[:3, 3] - robot.geometry["L6"] * pose[:3, 2])


def _true_tip(robot: Robot, place: Array, offset_mm: float) -> Array:
    """Where the tip really is (3,) [m] when the encoders say that it is at a place (3,) [m]."""
    along_x = transform(rotation("y", 0.5 * math.pi), place)
    answer = robot.ik(along_x, robot.home)
    if float(np.max(answer.residual)) > 1e-6:
        raise TeleopError(f"accuracy: {np.round(place, 4).tolist()} m cannot be reached")
    q = np.array(answer.q)
    q[2] += 1e-3 * offset_mm
    return np.asarray(robot.fk(q)[:3, 3])


def _measure(_: Bench) -> Findings:
    robot = load_robot("rcrt1")
    predicted, figures, rows = {}, [], []
    for name, which in AXES.items():
        read = readings(robot, which, D3_OFFSET_MM, which.step_mm)
        predicted[name] = DESIRED_MM - moved(read, which.escape_mm)
    for name, which in AXES.items():
        error, group = predicted[name], f"summary of {name}, table E.4"
        rows += [
            Row(quantity=quantity, unit="mm", published=printed, predicted=value,
                within=absolute(0.5 * RULER_MM), group=group)
            for quantity, printed, value in (
                ("RMS", which.rms, _rms(error)),
                ("S.D.", which.deviation, float(np.std(error, ddof=1))),
                ("largest", which.largest, float(np.abs(error).max())),
            )
        ]  # fmt: skip
    rows += _total_rows(robot)
    for number, (name, which) in enumerate(AXES.items(), start=1):
        printed = published_errors(which)
        rows += [
            Row(quantity=f"error at {way:g} mm", unit="mm", published=round(float(was), 2),
                predicted=is_now, within=absolute(RULER_MM),
                group=f"moves along {name}, table E.{number}")
            for way, was, is_now in zip(DESIRED_MM, printed, predicted[name], strict=True)
        ]  # fmt: skip
        figures.append(_figure(robot, name, which, predicted[name]))
    return Findings(tuple(rows), tuple(figures), _NOTES)


_NOTES = (
    f"The offset of {D3_OFFSET_MM} mm in d3 is fitted to these very tables, with moves along -x, "
    "±y and +z: that it explains them is a finding, not a prediction. Readings are rounded as the "
    "source read its ruler of 0.5 mm, to 0.25 mm along x and z.",
)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _total_rows(robot: Robot) -> list[Row]:
    """All readings as the ruler gives them, of y from home, without and with the offset."""
    read = np.concatenate([which.read_mm for which in AXES.values()])
    drawn, known = (
        np.concatenate([readings(robot, which, offset) for which in AXES.values()])
        for offset in (0.0, D3_OFFSET_MM)
    )
    group = "all readings of the ruler, less what is expected of it"
    return [
        Row(quantity="RMS, without the offset", unit="mm", predicted=_rms(read - drawn),
            group=group),
        Row(quantity="RMS, with the offset", unit="mm", predicted=_rms(read - known), group=group),
    ]  # fmt: skip


def _figure(robot: Robot, name: str, which: Axis, rounded: Array) -> Figure:
    exact = DESIRED_MM - moved(readings(robot, which, D3_OFFSET_MM), which.escape_mm)
    traces = [
        joined(DESIRED_MM, rounded, "predicted, as read", FIRST),
        joined(DESIRED_MM, exact, "predicted, exact", SECOND),
        published_points(DESIRED_MM, published_errors(which), "published"),
    ]
    traces[1] |= {"mode": "lines", "line": {**traces[1]["line"], "dash": "dash"}}
    layout = {"xaxis": axis("desired way", "mm"), "yaxis": axis("desired less measured", "mm")}
    sentence = (
        f"Error of moves along {name} against a ruler: published, and of an arm whose d3 is "
        f"{D3_OFFSET_MM} mm longer than it knows."
    )
    return Figure(f"Accuracy along {name}", sentence, traces, layout, 320)


ACCURACY = Experiment(
    "accuracy",
    "moves of the slave alone, measured with a ruler: what its encoders do not see",
    "Vongbunyong 2008, appendix E, tables E.1-E.4",
    _measure,
)
