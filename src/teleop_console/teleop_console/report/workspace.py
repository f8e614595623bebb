"""Workspace picture: positions that a robot's tip can reach, with the manipulability at each position."""

from pathlib import Path
from typing import Any

from teleop_console.report.pages import Section, page
from teleop_core.evaluation.figure import Figure, axis, scene
from teleop_core.kernels.geometry import Array
from teleop_core.robots.robot import Robot

# Largest number of drawn points; more points make the page slow, and the picture no clearer.
DRAWN = 20_000


def write_workspace_page(robot: Robot, points: Array, values: Array, file: Path) -> None:
    """Write one self-contained page: the points in space, from above and from the side.

    Args:
        robot: The arm of the points.
        points: Positions of the tip (N, 3) [m] in the axes of the base.
        values: Manipulability at each position (N,).
        file: Path of the page; its folder must exist.

    Raises:
        OSError: The file cannot be written.
    """
    x, y, z = points[:DRAWN].T
    bar = {"title": {"text": "manipulability"}}
    marker: dict[str, Any] = {"size": 2, "color": values[:DRAWN], "colorscale": "Viridis", "opacity": 0.7}
    whole = {"type": "scatter3d", "x": x, "y": y, "z": z, "mode": "markers", "marker": {**marker, "colorbar": bar}}
    figures = [Figure("in space", "", [whole], {**scene("m"), "showlegend": False}, 560)]
    for title, name, second in (("from above", "y", y), ("from the side", "z", z)):
        trace = {"type": "scattergl", "x": x, "y": second, "mode": "markers", "marker": marker}
        layout = {"xaxis": axis("x", "m"), "yaxis": axis(name, "m", scaleanchor="x"), "showlegend": False}
        figures.append(Figure(title, "", [trace], layout, 420))
    told = f"{len(points):,} joint vectors drawn within the limits"
    file.write_text(page(f"Workspace of {robot.name}", [], [Section(facts=told, parts=figures)]), encoding="utf-8")
