"""Accuracy: moves of the slave alone, measured with a ruler beside it (appendix E)."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from teleop_core.base.errors import TeleopError
from teleop_core.evaluation.figure import FIRST, SECOND, Figure, axis, joined, published_points
from teleop_core.kernels.geometry import Array, rotation, transform
from teleop_core.robots import Robot, load_robot
from teleop_core.slave.pair import ArmParameters
from teleop_lab.calibration.appendix_e import ESCAPE, OFFSET_OF_D3, READ, STEP
from teleop_lab.experiments import conditions, experiment
from teleop_lab.experiments.bench import Bench, rms
from teleop_lab.experiments.comparison import Comparison, Findings, absolute
from teleop_lab.fitting.rests import Mover

DESIRED_MM = np.arange(10.0, 101.0, 10.0)
ESCAPE_MM = 1e3 * ESCAPE
"""Displacement along -x before the moves along y [mm]; it is needed because home lies on the edge of the workspace."""
RULER_MM = 1e3 * STEP
D3_OFFSET_MM = 1e3 * OFFSET_OF_D3
"""True d3 minus the encoder's value [mm]."""


class Axis(NamedTuple):
    """Moves along one axis.

    Attributes:
        direction: Unit vector of the moves in the base.
        escape_mm: Displacement along -x before these moves [mm].
        read_mm: Reading of the ruler at each target (10,) [mm].
        step_mm: Smallest step between two readings [mm].
        error_mm: Desired minus measured, as printed (10,) [mm].
        rms: RMS as printed [mm].
        deviation: Standard deviation as printed [mm].
        largest: Largest error as printed [mm].
    """

    direction: tuple[float, float, float]
    escape_mm: float
    read_mm: tuple[float, ...]
    step_mm: float
    error_mm: tuple[float, ...]
    rms: float
    deviation: float
    largest: float


# Values as printed. Table E.2 prints 0.39, -1.03 and -1.15, but its readings give 0.395, -1.019 and -1.145.
_ERROR = {
    "x": (-0.25, 0.0, 0.0, -0.25, -0.25, -0.5, -0.5, 0.5, 0.0, -0.25),
    "y": (0.39, 0.10, -0.81, -0.62, -0.22, -1.03, -0.92, -1.13, -1.19, -1.15),
    "z": (0.0, 0.0, 0.5, -0.5, -0.5, 0.0, -1.0, -1.0, -1.75, -2.0),
}
# Tables E.1-E.4; the readings of y are distances from home.
AXES = {
    "x": Axis((-1.0, 0.0, 0.0), 0.0, READ["x"], 0.25, _ERROR["x"], 0.32, 0.29, 0.50),
    "y": Axis((0.0, 1.0, 0.0), ESCAPE_MM, READ["y"], 0.5, _ERROR["y"], 0.85, 0.56, 1.19),
    "z": Axis((0.0, 0.0, 1.0), 0.0, READ["z"], 0.25, _ERROR["z"], 0.99, 0.81, 2.00),
}


def moved(reading_mm: Array, escape_mm: float) -> Array:
    """Displacement along the axis [mm] for readings [mm] from home, which lies ``escape_mm`` beside the axis."""
    return np.sqrt(np.square(reading_mm) - escape_mm**2)


Rest = Callable[[Array], Array]
"""Function from commanded joints (n,) [rad or m] to the true position of the tip at rest (3,) [m]."""


def readings(robot: Robot, which: Axis, rest: Rest) -> Array:
    """Readings of an exact ruler at each target (10,) [mm].

    Args:
        robot: Model of the arm in its controller; the tool stays parallel to x.
        which: The moves.
        rest: Function that moves the arm and returns the rest position of the tip.

    Raises:
        TeleopError: A target cannot be reached.
    """
    home = _wrist(robot) + np.array([robot.geometry["L6"], 0.0, 0.0])
    escape = np.array([-1e-3 * which.escape_mm, 0.0, 0.0])
    ways = 1e-3 * DESIRED_MM[:, None] * np.array(which.direction)
    start = rest(_joints(robot, home))
    true = np.array([rest(_joints(robot, home + escape + way)) for way in ways])
    if which.escape_mm:
        return np.asarray(1e3 * np.linalg.norm(true - start, axis=1))
    return np.asarray(1e3 * (true - start) @ np.array(which.direction))


def as_read(exact: Array, step_mm: float) -> Array:
    """Readings rounded to the nearest step [mm]."""
    return np.asarray(np.round(exact / step_mm) * step_mm)


def longer_d3(robot: Robot, offset_mm: float) -> Rest:
    """Return an arm that rests exactly at its command, but whose true d3 is longer than the encoder's value."""

    def rest(q: Array) -> Array:
        true = q.copy()
        true[2] += 1e-3 * offset_mm
        return np.asarray(robot.fk(true)[:3, 3])

    return rest


def moved_plant(parameters: ArmParameters) -> Rest:
    """Return an arm that is the plant with its controller; it moves to one target after the other by cubics."""
    mover = Mover(parameters)

    def rest(q: Array) -> Array:
        mover.move(q)
        return mover.true_pose()[:3]

    return rest


def _wrist(robot: Robot) -> Array:
    """Centre of the wrist at home (3,) [m]."""
    pose = robot.fk(robot.home)
    return np.asarray(pose[:3, 3] - robot.geometry["L6"] * pose[:3, 2])


def _joints(robot: Robot, place: Array) -> Array:
    """Joints (n,) that put the tip at a position (3,) [m] with the tool parallel to x."""
    along_x = transform(rotation("y", 0.5 * math.pi), place)
    answer = robot.ik(along_x, robot.home)
    if float(np.max(answer.residual)) > 1e-6:
        raise TeleopError(f"accuracy: {np.round(place, 4).tolist()} m cannot be reached")
    return np.array(answer.q)


def _measure(bench: Bench) -> Findings:
    robot = load_robot("rcrt1")
    longer = {n: readings(robot, w, longer_d3(robot, D3_OFFSET_MM)) for n, w in AXES.items()}
    plant = bench.slave(conditions.RESTING)
    exact = {name: readings(robot, which, moved_plant(plant)) for name, which in AXES.items()}
    rows, figures = [], []
    for name, which in AXES.items():
        error = _errors(which, as_read(exact[name], which.step_mm))
        rows += [
            Comparison(
                quantity=quantity,
                unit="mm",
                published=printed,
                predicted=value,
                within=absolute(0.5 * RULER_MM),
                group=f"summary of {name}, table E.4",
            )
            for quantity, printed, value in (
                ("RMS", which.rms, rms(error)),
                ("S.D.", which.deviation, float(np.std(error, ddof=1))),
                ("largest", which.largest, float(np.abs(error).max())),
            )
        ]
        figures.append(_figure(name, which, exact[name], longer[name]))
    rows += _total_rows(robot, longer, exact)
    for number, (name, which) in enumerate(AXES.items(), start=1):
        error = _errors(which, as_read(exact[name], which.step_mm))
        rows += [
            Comparison(
                quantity=f"error at {way:g} mm",
                unit="mm",
                published=was,
                predicted=is_now,
                within=absolute(RULER_MM),
                group=f"moves along {name}, table E.{number}",
            )
            for way, was, is_now in zip(DESIRED_MM, which.error_mm, error, strict=True)
        ]
    return Findings(tuple(rows), tuple(figures), _NOTES)


_NOTES = (
    f"The offset of {D3_OFFSET_MM} mm in d3 is fitted to these very tables, with moves along -x, "
    "±y and +z: that it explains them is a finding, not a prediction. The other link errors and "
    "the play of the tendons are one draw of tolerances. Readings are rounded as the source read "
    "its ruler of 0.5 mm, to 0.25 mm along x and z. The source tuned its gains for no error at "
    "rest here; so ours moves the plant.",
)


def _errors(which: Axis, read_mm: Array) -> Array:
    """Desired minus measured displacement (10,) [mm]."""
    return DESIRED_MM - moved(read_mm, which.escape_mm)


def _total_rows(robot: Robot, longer: dict[str, Array], exact: dict[str, Array]) -> list[Comparison]:
    """Rows of the differences between all readings of the ruler and the readings that models predict."""
    read = np.concatenate([which.read_mm for which in AXES.values()])
    drawn = {name: readings(robot, which, longer_d3(robot, 0.0)) for name, which in AXES.items()}
    group = "all readings of the ruler, minus their expected values"
    return [
        Comparison(
            quantity=f"RMS, {text}",
            unit="mm",
            group=group,
            predicted=rms(read - np.concatenate(list(expected.values()))),
        )
        for text, expected in (
            ("arm as drawn", drawn),
            (f"d3 longer by {D3_OFFSET_MM} mm alone", longer),
            ("the plant", exact),
        )
    ]


def _figure(name: str, which: Axis, exact: Array, longer: Array) -> Figure:
    read = _errors(which, as_read(exact, which.step_mm))
    traces = [
        joined(DESIRED_MM, read, "the plant, as read", FIRST),
        joined(DESIRED_MM, _errors(which, exact), "the plant", FIRST),
        joined(DESIRED_MM, _errors(which, longer), f"d3 longer by {D3_OFFSET_MM} mm alone", SECOND),
        published_points(DESIRED_MM, np.array(which.error_mm), "published"),
    ]
    for trace in traces[1:3]:
        trace |= {"mode": "lines", "line": {**trace["line"], "dash": "dash"}}
    layout = {"xaxis": axis("desired way", "mm"), "yaxis": axis("desired minus measured", "mm")}
    sentence = f"Error of moves along {name} against a ruler, published and predicted."
    return Figure(f"Accuracy along {name}", sentence, traces, layout, 320)


ACCURACY = experiment.Experiment(
    "accuracy",
    "moves of the slave alone, measured with a ruler: errors that its encoders do not measure",
    "Vongbunyong 2008, appendix E, tables E.1-E.4",
    _measure,
)
