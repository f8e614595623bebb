"""Parallel robots: mobility counts of the lecture, loops of the 4-bar and the 3-RPS."""

from itertools import pairwise

import numpy as np

from teleop_core.evaluation.figure import FIRST, SECOND, Figure
from teleop_core.robots.four_bar_loop import Assembly, FourBar
from teleop_core.robots.mobility import (
    PLANAR,
    SPATIAL,
    degrees_of_freedom,
    independent_loops,
    loop_rank,
    passive_joints,
)
from teleop_core.robots.rps3 import assembly_modes, joint_points
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.drawing import PUBLISHED, axis, line, published_points
from teleop_lab.experiments.experiment import Experiment
from teleop_lab.experiments.outcome import EXACT, Findings, Row, absolute

# Mechanism: space, links, joints, freedoms of the joints, and the printed freedom.
_COUNTS = {
    "planar 4-bar": (PLANAR, 4, 4, 4, 1),
    "3-RPS": (SPATIAL, 8, 9, 15, 3),
    "three-fingered hand": (SPATIAL, 11, 12, 18, 6),
    "Stewart platform": (SPATIAL, 14, 18, 36, 6),
}
_SIX = absolute(1.05e-6)
_LOOP = FourBar(4.0, 1.0, 3.5, 2.5)
_ANGLES = {"phi1": 101.536959, "phi2": 44.415309, "phi3": -122.878350}


def _count_rows() -> list[Row]:
    group = "mobility, eq. 1"
    rows = [
        Row(quantity=f"freedoms, {name}", published=float(printed),
            predicted=float(degrees_of_freedom(links, joints, freedoms, space=space)),
            within=EXACT, group=group,
            note="spoken as three; the formula gives six" * (name == "three-fingered hand"))
        for name, (space, links, joints, freedoms, printed) in _COUNTS.items()
    ]  # fmt: skip
    rows += [
        Row(quantity=f"passive joints, {name}", published=float(printed),
            predicted=float(passive_joints(joints, freedoms)), within=EXACT, group=group)
        for name, joints, freedoms, printed in (("4-bar", 4, 1, 3), ("3-RPS", 9, 3, 6))
    ]  # fmt: skip
    edges = [edge for leg in range(6) for edge in pairwise([0, 1 + 2 * leg, 2 + 2 * leg, 13])]
    loops = [_stewart_loop(i, i + gap) for gap in (1, 2, 3) for i in range(6 - gap)]
    rows += [
        Row(quantity="passive freedoms, Stewart platform", published=30.0, predicted=36.0 - 6.0,
            within=EXACT, group=group),
        Row(quantity="loops that are named, Stewart platform", published=12.0,
            predicted=float(len(loops)), within=EXACT, group=group),
        Row(quantity="independent of them", published=float(independent_loops(14, 18)),
            predicted=float(loop_rank(edges, loops)), within=EXACT, group=group,
            note="joints - links + 1; the lecture leaves it open"),
    ]  # fmt: skip
    return rows


def _stewart_loop(first: int, second: int) -> list[int]:
    """Links of the loop through two legs: base 0, halves of the legs, platform 13."""
    return [0, 1 + 2 * first, 2 + 2 * first, 13, 2 + 2 * second, 1 + 2 * second]


def _four_bar_rows() -> list[Row]:
    closure = _LOOP.close(0.0)
    group = "4-bar of 4, 1, 3.5, 2.5 at theta1 = 0"
    rows = [
        Row(quantity=name, unit="°", published=printed,
            predicted=float(np.degrees(getattr(closure, name)[0])), within=_SIX, group=group)
        for name, printed in _ANGLES.items()
    ]  # fmt: skip
    around = np.radians(0.1 * (np.arange(3600) + 0.5) - 180.0)
    for lengths, printed in (((4, 1, 3.5, 2.5), 360.0), ((6, 1, 2, 2), 0.0), ((4, 3, 3, 2), 180.0)):
        closed = FourBar(*map(float, lengths)).close(around).status == Assembly.CLOSED
        rows.append(
            Row(quantity=f"range of theta1 that closes, {lengths}", unit="°",
                published=printed, predicted=360.0 * float(closed.mean()),
                within=absolute(0.2), group=group)
        )  # fmt: skip
    return rows


def _rps_rows() -> list[Row]:
    group = "3-RPS, base 1, platform 0.5, legs of 1.2"
    modes = assembly_modes((1.2, 1.2, 1.2), b=1.0, a=0.5)
    angles = np.degrees(modes.angles)
    nearest = angles[np.argmin(np.abs(angles - 65.375682).max(axis=1))]
    height = float(joint_points([1.2] * 3, np.radians(nearest), b=1.0).mean(axis=0)[2])
    return [
        Row(quantity="angle of the legs", unit="°", published=65.375682,
            predicted=float(nearest.mean()), within=_SIX, group=group),
        Row(quantity="height of the platform", unit="m", published=1.090871, predicted=height,
            within=_SIX, group=group),
    ]  # fmt: skip


def _measure(_: Bench) -> Findings:
    rows = (*_count_rows(), *_four_bar_rows(), *_rps_rows())
    return Findings(rows, (_figure(),), _NOTES)


_NOTES = (
    "The lecture prints the counts alone: 'published' for the 4-bar and the 3-RPS are computed "
    "from its equations beforehand, by other code.",
)


def _figure() -> Figure:
    around = np.linspace(-180.0, 180.0, 361)
    closure = _LOOP.close(np.radians(around))
    first, second = np.degrees(closure.phi1).T
    traces = [
        line(around, first, "one assembly", FIRST, 2.0, "°"),
        line(around, second, "the other", SECOND, 2.0, "°"),
        published_points(
            np.zeros(2), np.array([101.536959, -101.536959]), "computed beforehand", "°"
        ),
    ]
    traces[2]["marker"]["color"] = PUBLISHED
    layout = {"xaxis": axis("theta1", "°"), "yaxis": axis("phi1", "°")}
    sentence = "Rocker over crank of the 4-bar, in both assemblies."
    return Figure("4-bar", sentence, traces, layout, 320)


PARALLEL_ROBOTS = Experiment(
    "parallel_robots",
    "mobility of four mechanisms, loops of the 4-bar and the 3-RPS",
    "Ghosal 2020, lecture 11, eqs. 1-5",
    _measure,
)
