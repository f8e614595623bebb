"""Workspace: reach of the arm, and positions that the tip can reach (figure 4.1)."""

import numpy as np

from teleop_core.evaluation.figure import FIRST, SECOND, Figure, axis, in_space, line, scene
from teleop_core.kernels.geometry import Array
from teleop_core.robots import Robot, load_robot
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import Comparison, Findings, percent
from teleop_lab.experiments.experiment import Experiment

_REACH_MM = 460.0
_SAMPLES, _SLICE_MM = 40_000, 6.0


def _measure(bench: Bench) -> Findings:
    robot = load_robot("rcrt1")
    places = _samples(robot, bench.seed)
    low, high = places.min(axis=0), places.max(axis=0)
    reach = float(np.linalg.norm(places, axis=1).max())
    longest = 1e3 * float(robot.upper[2] + robot.geometry["L6"])
    rows = [
        Comparison(quantity="reach, d3 and tool in line", unit="mm", published=_REACH_MM,
            predicted=longest, within=percent(1.0), group="tip", note="rounded in its estimate"),
        Comparison(quantity="reach of the samples", unit="mm", predicted=reach, group="tip"),
    ]  # fmt: skip
    for name, begin, end in zip("xyz", low, high, strict=True):
        rows.append(Comparison(quantity=f"{name}, from", unit="mm", predicted=begin, group="tip"))
        rows.append(Comparison(quantity=f"{name}, to", unit="mm", predicted=end, group="tip"))
    return Findings(tuple(rows), (_in_space(places), _sections(places, robot)), _NOTES)


_NOTES = (
    "The source gives the extents of its workspace in pictures alone. Its stage has a rail of "
    "200 mm, so a part of the range of d3 is not there; tests used 350 to 421 mm.",
)


def _samples(robot: Robot, seed: int) -> Array:
    """Positions of the tip (N, 3) [mm] for joints that are uniformly distributed in their ranges."""
    joints = np.random.default_rng(seed).uniform(robot.lower, robot.upper, (_SAMPLES, robot.n))
    return 1e3 * robot.fk(joints)[:, :3, 3]


def _in_space(places: Array) -> Figure:
    trace = in_space(places[:6000], "tip", FIRST, 1, "markers", size=1.6, opacity=0.6)
    trace["marker"] |= {"color": np.linalg.norm(places[:6000], axis=1), "colorscale": "Viridis"}
    sentence = "Where the tip can be, for joints drawn evenly within their ranges."
    return Figure("Workspace, as figure 4.1", sentence, [trace], scene("mm"), 520)


def _sections(places: Array, robot: Robot) -> Figure:
    """Vertical and horizontal section through the shoulder, with the boundary of the wrist's range."""
    angles = np.linspace(robot.lower[1], robot.upper[1], 60)
    turns = np.linspace(robot.lower[0], robot.upper[0], 60)
    far = 1e3 * float(robot.upper[2])
    upright, level = np.abs(places[:, 1]) < _SLICE_MM, np.abs(places[:, 2]) < _SLICE_MM
    wrist = np.vstack(([0, 0], far * np.column_stack((np.sin(angles), np.cos(angles))), [0, 0]))
    around = np.vstack(([0, 0], far * np.column_stack((np.cos(turns), np.sin(turns))), [0, 0]))
    traces, layout = [], {"grid": {"rows": 1, "columns": 2, "pattern": "independent"}}
    for plot, (kept, axes, edge) in enumerate(((upright, (0, 2), wrist), (level, (0, 1), around))):
        suffix = "" if plot == 0 else "2"
        place = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "showlegend": plot == 0}
        dots = line(places[kept, axes[0]], places[kept, axes[1]], "tip", FIRST, 1.0)
        dots |= {"mode": "markers", "marker": {"size": 3, "color": FIRST, "opacity": 0.5}}
        traces += [{**dots, **place}]
        traces += [{**line(edge[:, 0], edge[:, 1], "edge of the wrist centre", SECOND, 2), **place}]
        layout[f"xaxis{suffix}"] = axis("xyz"[axes[0]], "mm", constrain="domain")
        layout[f"yaxis{suffix}"] = axis("xyz"[axes[1]], "mm", scaleanchor=f"x{suffix}", constrain="domain")
    sentence = f"Cuts of {2 * _SLICE_MM:g} mm through the shoulder: upright (left), level (right)."
    return Figure("Sections of the workspace", sentence, traces, layout, 420)


WORKSPACE = Experiment(
    "workspace", "reach, and where the tip can be", "Vongbunyong 2008, section 4.2, table 6.2, figure 4.1", _measure
)
