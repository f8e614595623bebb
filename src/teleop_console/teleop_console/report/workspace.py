"""Workspace picture: positions that a robot's tip can reach, with the manipulability at each position."""

from pathlib import Path
from typing import Any

import plotly.graph_objects as plots
from plotly.subplots import make_subplots

from teleop_console.report.plain_page import Figures, plain_page
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
    titles = ("in space", "from above: x, y", "from the side: x, z")
    figure = make_subplots(
        rows=2,
        cols=2,
        column_widths=[0.62, 0.38],
        subplot_titles=titles,
        specs=[[{"type": "scene", "rowspan": 2}, {"type": "xy"}], [None, {"type": "xy"}]],
    )
    x, y, z = points[:DRAWN].T
    marker: dict[str, Any] = {"size": 2, "color": values[:DRAWN], "colorscale": "Viridis", "opacity": 0.7}
    bar = {"title": "manipulability", "x": -0.08}
    figure.add_trace(
        plots.Scatter3d(x=x, y=y, z=z, mode="markers", marker={**marker, "colorbar": bar, "showscale": True}),
        row=1,
        col=1,
    )
    for row, second in ((1, y), (2, z)):
        trace = plots.Scattergl(x=x, y=second, mode="markers", marker=marker)
        figure.add_trace(trace, row=row, col=2)
        name = "yz"[row - 1]
        figure.update_yaxes(title_text=f"{name} [m]", scaleanchor=f"x{row}", row=row, col=2)
        figure.update_xaxes(title_text="x [m]", row=row, col=2)
    axes = {f"{axis}axis": {"title": f"{axis} [m]"} for axis in "xyz"}
    figure.update_layout(showlegend=False, height=820, template="none", scene={**axes, "aspectmode": "data"})
    told = f"{len(points):,} joint vectors drawn within the limits"
    figures = Figures()
    card = figures.card(figure.data, figure.layout, told)
    file.write_text(plain_page(f"Workspace of {robot.name}", [card], figures), encoding="utf-8")
