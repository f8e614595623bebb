"""Plots: the last seconds of one arm as curves, drawn by the browser."""

import time
from dataclasses import dataclass

import numpy as np
import viser
from viser import uplot

from teleop_console.history import SPAN, History
from teleop_console.look import AXIS, AXIS_GRID, CURVES
from teleop_core.kernels.geometry import Array

_PERIOD = 0.25  # between two drawings [s]
_NUMBERS = 66  # pixels that "-0.00025" needs beside a plot
_POINTS = 400  # in a curve: more than the panel has pixels


@dataclass(frozen=True)
class _Plot:
    """One diagram: its title with unit, columns of the history, factor to that unit, labels."""

    title: str
    columns: tuple[str, ...]
    factor: float
    labels: tuple[str, ...]


_PLOTS = (
    _Plot("place x y z [mm], dashed: wanted", ("place", "reference"), 1e3, ("x", "y", "z")),
    _Plot("force at the stylus [N]", ("force",), 1.0, ("x", "y", "z")),
    _Plot("tracking error [mm]", ("error",), 1e3, ("error",)),
    _Plot("master sample to slave command, median [ms]", ("delay",), 1e3, ("delay",)),
    _Plot("energy left to give, with passivity [mJ]", ("left",), 1e3, ("hand", "slave")),
)


class Plots:
    """Diagrams of one arm in the present container of the page.

    Args:
        gui: Where they are drawn.
        history: What they show.
    """

    def __init__(self, gui: viser.GuiApi, history: History) -> None:
        self._history, self._drawn = history, 0.0
        names = history.arm.robot.joint_names
        self._joint = gui.add_dropdown("joint", names, hint="whose reference and actual are drawn")
        self._joint_plot = self._add(gui, "joint [deg or mm], dashed: reference", 1, is_pair=True)
        self._plots = [
            self._add(gui, plot.title, len(plot.labels), is_pair=len(plot.columns) > 1, labels=plot.labels)
            for plot in _PLOTS
        ]

    @staticmethod
    def _add(
        gui: viser.GuiApi, title: str, count: int, *, is_pair: bool, labels: tuple[str, ...] = ("actual",)
    ) -> viser.GuiUplotHandle:
        series = [uplot.Series(label="t [s]")]
        for dashed in (False, True) if is_pair else (False,):
            series += [
                uplot.Series(
                    label=f"{label} wanted" if dashed else label,
                    stroke=CURVES[i],
                    width=1.5,
                    dash=(6.0, 4.0) if dashed else (),
                )
                for i, label in enumerate(labels[:count])
            ]
        grid = uplot.Axis_Grid(stroke=AXIS_GRID)
        axes = uplot.Axis(stroke=AXIS, grid=grid), uplot.Axis(stroke=AXIS, grid=grid, size=_NUMBERS)
        return gui.add_uplot(
            tuple(np.zeros(1) for _ in series),
            tuple(series),
            title=title,
            height=170,
            padding=(10, 8, 0, 0),  # the uppermost number has room under the title
            scales={"x": uplot.Scale(time=False, auto=False, range=(-SPAN, 0.0)), "y": uplot.Scale(auto=True)},
            axes=axes,
            legend=uplot.Legend(show=count > 1, live=False),
        )

    def draw(self) -> None:
        """Draw what is new, a few times a second."""
        now = time.monotonic()
        if now - self._drawn < _PERIOD:
            return
        self._drawn = now
        index = self._history.arm.robot.joint_names.index(self._joint.value)
        at, actual = self._history.read("joints")
        if not len(at):
            return
        _, wanted = self._history.read("wanted")
        factor = self._joint_factor(index)
        _show(self._joint_plot, at, [factor * actual[:, index], factor * wanted[:, index]])
        for plot, handle in zip(_PLOTS, self._plots, strict=True):
            curves = [plot.factor * self._history.read(name)[1].T for name in plot.columns]
            _show(handle, at, [curve for rows in curves for curve in rows])

    def _joint_factor(self, index: int) -> float:
        """Degrees of a joint that turns, millimetres of one that slides."""
        return 1e3 if _slides(self._history.arm.robot, index) else float(np.degrees(1.0))


def _slides(robot: object, index: int) -> bool:
    from teleop_core.robots.robot import Robot

    assert isinstance(robot, Robot)
    jacobian = robot.jacobian(robot.home)
    return bool(np.linalg.norm(jacobian[3:, index]) < 1e-9)


def _show(handle: viser.GuiUplotHandle, at: Array, curves: list[Array]) -> None:
    """Draw curves (N,) over times (N,), where all of them are known."""
    rows = np.vstack((at, *curves))
    rows = rows[:, np.isfinite(rows).all(axis=0)]
    if rows.shape[1] > 1:
        step = max(1, rows.shape[1] // _POINTS)
        handle.data = tuple(np.ascontiguousarray(row[::step]) for row in rows)
