"""Parallel robots: mobility counts of the lecture, and the loop of the 4-bar as a figure."""

import numpy as np

from teleop_core.evaluation.figure import FIRST, SECOND, Figure, axis, line
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import EXACT, Comparison, Findings
from teleop_lab.experiments.experiment import Experiment
from teleop_machines import four_bar_loop, mobility

# For each mechanism: degrees of freedom of the space, number of links, number of joints, degrees of freedom of the
# joints, and the printed mobility.
_COUNTS = {
    "planar 4-bar": (mobility.PLANAR, 4, 4, 4, 1),
    "3-RPS": (mobility.SPATIAL, 8, 9, 15, 3),
    "three-fingered hand": (mobility.SPATIAL, 11, 12, 18, 6),
    "Stewart platform": (mobility.SPATIAL, 14, 18, 36, 6),
}
_LOOP = four_bar_loop.FourBar(4.0, 1.0, 3.5, 2.5)


def _count_rows() -> list[Comparison]:
    group = "mobility, eq. 1"
    rows = [
        Comparison(
            quantity=f"freedoms, {name}",
            published=float(printed),
            predicted=float(mobility.degrees_of_freedom(links, joints, freedoms, space=space)),
            within=EXACT,
            group=group,
            note="spoken as three; the formula gives six" * (name == "three-fingered hand"),
        )
        for name, (space, links, joints, freedoms, printed) in _COUNTS.items()
    ]
    return rows + [
        Comparison(
            quantity=f"passive joints, {name}",
            published=float(printed),
            predicted=float(mobility.passive_joints(joints, freedoms)),
            within=EXACT,
            group=group,
        )
        for name, joints, freedoms, printed in (("4-bar", 4, 1, 3), ("3-RPS", 9, 3, 6))
    ]


def _measure(_: Bench) -> Findings:
    return Findings(tuple(_count_rows()), (_figure(),))


def _figure() -> Figure:
    around = np.linspace(-180.0, 180.0, 361)
    closure = _LOOP.close(np.radians(around))
    first, second = np.degrees(closure.phi1).T
    traces = [line(around, first, "one assembly", FIRST, 2.0, "°"), line(around, second, "the other", SECOND, 2.0, "°")]
    layout = {"xaxis": axis("theta1", "°"), "yaxis": axis("phi1", "°")}
    sentence = "Angle of the rocker against that of the crank of the 4-bar, in both assemblies."
    return Figure("4-bar", sentence, traces, layout, 320)


PARALLEL_ROBOTS = Experiment(
    "parallel_robots", "mobility of four mechanisms, loop of the 4-bar", "Ghosal 2020, lecture 11, eqs. 1-5", _measure
)
