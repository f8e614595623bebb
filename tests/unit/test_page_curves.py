"""Curves of a page: what its figures say to it, and the time that was spent."""

from typing import Any

import numpy as np

from teleop_core.evaluation import figure
from teleop_core.kernels.geometry import Array


def against_time(values: Array, layout: Any = None) -> figure.Figure:
    x = np.arange(len(values)) * 1e-3
    axes = {"xaxis": figure.time_axis(), "yaxis": {"title": {"text": "force [N]"}}}
    return figure.Figure("Force", "It pushes.", [figure.line(x, values, "force", "#000", 1, "N")], layout or axes)


# -- axes of time ----------------------------------------------------------------------------------


def test_axes_of_time_are_known_by_how_they_are_made() -> None:
    assert figure.is_against_time(against_time(np.zeros(5)))
    assert figure.is_against_time(against_time(np.zeros(5), figure.stacked_axes("xyz", "mm")))
    turned = {"xaxis": {**figure.time_axis(), "range": [0, 1]}}
    assert figure.is_against_time(against_time(np.zeros(5), turned))
    assert not figure.is_against_time(against_time(np.zeros(5), {"xaxis": {"title": {"text": "time"}}}))
    assert not figure.is_against_time(figure.Figure("Nothing", "", []))


# -- density ---------------------------------------------------------------------------------------


def test_time_spent_is_that_of_the_recording() -> None:
    rng = np.random.default_rng(2)
    across, up = rng.normal(size=(2, 5000))
    across[:100] = np.nan
    ranges = ([-5.0, 5.0], [-5.0, 5.0])
    trace = figure.time_spent(across, up, ranges, 0.01)
    cells = np.array([[np.nan if z is None else z for z in row] for row in trace["z"]], float)
    # Cells hold two decimals of a logarithm.
    assert np.isclose(np.nansum(10.0**cells), 49.0, rtol=0.02)
    expected, *_ = np.histogram2d(up[100:], across[100:], bins=cells.shape, range=ranges[::-1])
    assert np.array_equal(np.isnan(cells), expected == 0)


def test_path_that_crosses_itself_often_is_long() -> None:
    t = np.linspace(0.0, 1.0, 50_000)[:, None]
    once = np.hstack((np.cos(6 * t), np.sin(6 * t), t))
    often = np.hstack((np.cos(600 * t), np.sin(600 * t), t))
    assert not figure.is_long(once)
    assert figure.is_long(often)
    assert not figure.is_long(np.zeros((1000, 3)))
    assert not figure.is_long(np.full((1000, 3), np.nan))
