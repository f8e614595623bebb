"""Points: the source's real task with 24 points of a circuit board that a camera shows (section 7.7)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from teleop_core.base.errors import TeleopError
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.evaluation.figure import COMMAND, FIRST, MEASURED, Figure, axis, line
from teleop_core.graph.signals import DT
from teleop_core.hand.operators.behaviour import OperatorParameters
from teleop_core.hand.operators.tour import TourParameters
from teleop_core.kernels.axes import axis_map
from teleop_core.kernels.geometry import Array
from teleop_lab.experiments.bench import Bench, ScoredSession, Settings, mean
from teleop_lab.experiments.comparison import EXACT, Comparison, Findings
from teleop_lab.experiments.conditions import OURS, PREDICTED
from teleop_lab.experiments.experiment import Experiment

SCENARIO = "points24"
INNER_MM = 0.5
"""Radius of the inner circle of a point [mm]. It is not published; half of a pad of 1 mm is assumed."""
POINTS = 24
# Only the second half of a rest counts, because the low-pass has almost settled then.
_SETTLED = 0.5


class Visits(NamedTuple):
    """Result of the task in a session; distances are in the plane of the board.

    Attributes:
        targets: Positions of the points in the slave's base (24, 3) [mm].
        missed_mm: Mean of tip minus point while the tip rests at the point (24, 3) [mm].
        off_mm: Largest distance of the tip from each point while the tip rests there (24,) [mm].
        mean_mm: Mean distance of the tip from each point while the tip rests there (24,) [mm].
        line_mm: Smallest distance of the drawn line from each point (24,) [mm].
        visiting: Path of the tip while it visits the points (N, 3) [mm].
        tracing: Path of the tip while it draws the line (M, 3) [mm].
    """

    targets: Array
    missed_mm: Array
    off_mm: Array
    mean_mm: Array
    line_mm: Array
    visiting: Array
    tracing: Array


def visits_of(session: ScoredSession, p: TourParameters, center: Array, approach_s: float) -> Visits:
    """Compute the result of the task in a session.

    Args:
        session: A session of the scenario.
        p: Parameters of the tour.
        center: Centre of the tour relative to the start of the hand (3,) [m].
        approach_s: Duration of the hand's approach [s].

    Raises:
        TeleopError: The session ends before the tour ends.
    """
    follows = session.is_followed
    times = session.time[follows] - session.time[follows][0] - approach_s
    path = session.places_mm("slave/measured_cp")[follows]
    sent = session["slave/servo_cp"].time >= session.time[follows][0]
    start = session.places_mm("slave/servo_cp")[sent][0]  # the hand's motion begins when the slave begins to follow
    axes = axis_map("axes", MotionScalingParameters.axes)
    targets = start + 1e3 * (center + p.stops) @ axes.T
    if times[-1] < (needed := p.visit_time + p.trace_time) - DT:  # the last tick ends one period after its time
        text = f"the session ends {needed - times[-1]:.1f} s before its tour of {needed:.1f} s"
        raise TeleopError(f"{SCENARIO}: {text}; give it more time (duration)")
    cycle = p.leg_time + p.rest_time
    begins = np.arange(len(targets)) * cycle + p.leg_time + _SETTLED * p.rest_time
    rests = [path[(times >= begin) & (times < (k + 1) * cycle)] for k, begin in enumerate(begins)]
    means = np.array([rest.mean(axis=0) for rest in rests])
    away = [_in_plane(rest - target) for rest, target in zip(rests, targets, strict=True)]
    drawing = path[(times > p.visit_time) & (times < p.visit_time + p.trace_time)]
    is_visiting = (times > 0.0) & (times <= p.visit_time)
    return Visits(
        targets,
        means - targets,
        np.array([row.max() for row in away]),
        np.array([row.mean() for row in away]),
        np.array([_in_plane(drawing - target).min() for target in targets]),
        path[is_visiting],
        drawing,
    )


def _in_plane(off: Array) -> Array:
    """Lengths (N,) of the components of vectors (N, 3) in the plane of the board."""
    return np.asarray(np.linalg.norm(off[:, :2], axis=1), dtype=np.float64)


def _visits(bench: Bench, settings: Settings, *, seeing: bool) -> list[Visits]:
    """Results of all hands. A hand that sees repeats the task and corrects the errors of the first run."""
    from teleop_core.session.api import configuration

    made = configuration(SCENARIO).of(OperatorParameters)
    center, p, approach = np.array(made.center), made.kind.parameters, float(made.approach_time)
    first = [visits_of(s, p, center, approach) for s in bench.sessions(SCENARIO, settings)]
    if not seeing:
        return first
    axes, found = axis_map("axes", MotionScalingParameters.axes), []
    for seed, visits in zip(bench.seeds, first, strict=True):
        missed = 1e-3 * visits.missed_mm * (1.0, 1.0, 0.0)  # the camera shows only the board's plane
        aims = tuple((p.stops - missed @ axes).ravel().tolist())
        again = bench.session(SCENARIO, seed, {**settings, "operator.tour.points": aims})
        found.append(visits_of(again, p, center, approach))
    return found


def _held(visits: Visits) -> float:
    """Number of points at which the tip rested inside the inner circle."""
    return float((visits.off_mm < INNER_MM).sum())


def _met(visits: Visits) -> float:
    """Number of points whose inner circle the drawn line crosses."""
    return float((visits.line_mm < INNER_MM).sum())


def _measure(bench: Bench) -> Findings:
    rows: list[Comparison] = []
    blind = _visits(bench, PREDICTED, seeing=False)
    seen = _visits(bench, PREDICTED, seeing=True)
    ours = {"blind": _visits(bench, OURS, seeing=False), "seen": _visits(bench, OURS, seeing=True)}

    def add(which: str, text: str, unit: str, value: Callable[[Visits], float], published: float | None = None) -> None:
        values = [value(v) for v in (seen if which == "seen" else blind)]
        others = [value(v) for v in ours[which]]
        rows.append(
            Comparison(quantity=text, unit=unit, published=published, predicted=mean(values),
                ours=mean(others), lowest=min(values), highest=max(values),
                within=EXACT if published is not None else None, group=_GROUPS[which])
        )  # fmt: skip

    add("seen", "points with the tip inside the inner circle", "", _held, float(POINTS))
    add("seen", "distance from a point at rest, mean", "mm", lambda v: float(v.mean_mm.mean()))
    add("seen", "distance from a point at rest, largest", "mm", lambda v: float(v.off_mm.max()))
    add("blind", "points with the tip inside the inner circle", "", _held)
    add("blind", "distance from a point at rest, mean", "mm", lambda v: float(v.mean_mm.mean()))
    add("blind", "points that the line meets within it", "", _met)
    add("blind", "distance of the line from a point, largest", "mm", lambda v: float(v.line_mm.max()))
    figures = _figure(seen[0], seeing=True), _figure(blind[0], seeing=False)
    return Findings(tuple(rows), figures, _NOTES)


_GROUPS = {
    "seen": "a hand that sees: it repeats the task, with its aim corrected by the first errors",
    "blind": "a hand that does not see: friction of the device holds it back",
}
_NOTES = (
    "The source gives neither places nor the size of the circles: a grid of 6 by 4 points at "
    f"2.54 mm and {INNER_MM} mm are assumed. Its operator saw tip and board through a camera.",
)


def _circles(targets: Array, radius: float) -> Array:
    """Circles around all points as one line (N, 3); NaN separates the circles."""
    angles = np.linspace(0.0, 2.0 * np.pi, 25)
    ring = radius * np.column_stack((np.cos(angles), np.sin(angles), np.zeros(25)))
    gap = np.full((1, 3), np.nan)
    return np.vstack([np.vstack((target + ring, gap)) for target in targets])


def _figure(visits: Visits, *, seeing: bool) -> Figure:
    rings = _circles(visits.targets, INNER_MM)
    drawn = [
        (rings, "inner circles", FIRST, 1.5),
        (visits.visiting[::5], "stops", MEASURED if seeing else COMMAND, 1.2),
    ]
    if not seeing:  # a hand that sees corrects each stop, but not the line
        drawn.append((visits.tracing[::5], "line", MEASURED, 1.5))
    traces = [line(-path[:, 1], path[:, 0], name, color, width) for path, name, color, width in drawn]
    for trace in traces:
        trace["hovertemplate"] = "%{x:.3f}, %{y:.3f} mm"
    layout = {"xaxis": axis("-y", "mm"), "yaxis": axis("x", "mm", scaleanchor="x")}
    sentence = "The board from above: stops at each point"
    sentence += "." if seeing else ", then the line back through all."
    whose = "which sees" if seeing else "which does not see"
    return Figure(f"24 points, by a hand {whose}", sentence, traces, layout, 420)


POINTS24 = Experiment(
    "points24",
    "stop at each of 24 points of a circuit board, then draw a line through them",
    "Vongbunyong 2008, section 7.7",
    _measure,
)
