"""Curves of a page: what its figures say to it, the sketches, and the time that was spent."""

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from present import present
from teleop_core.evaluation.bands import Band
from teleop_core.evaluation.figure import (
    Figure,
    is_against_time,
    is_long,
    line,
    stacked_axes,
    time_axis,
    time_spent,
)
from teleop_core.evaluation.preview import preview
from teleop_core.kernels.geometry import Array


def against_time(values: Array, layout: Any = None) -> Figure:
    x = np.arange(len(values)) * 1e-3
    axes = {"xaxis": time_axis(), "yaxis": {"title": {"text": "force [N]"}}}
    return Figure("Force", "It pushes.", [line(x, values, "force", "#000", 1, "N")], layout or axes)


def points(svg: str) -> list[Array]:
    root = ElementTree.fromstring(present(re.search(r"<svg.*</svg>", svg)).group())
    return [
        np.array(
            [[float(n) for n in pair.split(",")] for pair in present(shape.get("points")).split()]
        )
        for shape in root.iter("polyline")
    ]


# -- axes of time ----------------------------------------------------------------------------------


def test_axes_of_time_are_known_by_how_they_are_made() -> None:
    assert is_against_time(against_time(np.zeros(5)))
    assert is_against_time(against_time(np.zeros(5), stacked_axes("xyz", "mm")))
    turned = {"xaxis": {**time_axis(), "range": [0, 1]}}
    assert is_against_time(against_time(np.zeros(5), turned))
    assert not is_against_time(against_time(np.zeros(5), {"xaxis": {"title": {"text": "time"}}}))
    assert not is_against_time(Figure("Nothing", "", []))


# -- sketches --------------------------------------------------------------------------------------


def test_sketch_keeps_peaks_and_stays_small() -> None:
    values = np.random.default_rng(1).normal(size=100_000)
    values[50_000], values[70_000] = 40.0, -40.0
    svg = preview(against_time(values), [])
    (curve,) = points(svg)
    assert len(svg) < 10_000
    assert np.isclose(curve[curve[:, 1].argmin(), 0], 500.0, atol=10.0)
    assert np.isclose(curve[curve[:, 1].argmax(), 0], 700.0, atol=10.0)
    assert "0.0 … 100.0 s" in svg
    assert "force [N]: -40 … 40" in svg


def test_sketch_shows_bands_behind_curves() -> None:
    band = Band("<speed> limit", "#123456", np.array([[1.0, 2.0], [5.0, 5.5]]))
    svg = preview(against_time(np.sin(np.arange(10_000))), [band])
    root = ElementTree.fromstring(present(re.search(r"<svg.*</svg>", svg)).group())
    shapes = [(shape.tag, float(shape.get("x", 0)), float(shape.get("width", 0))) for shape in root]
    assert [shape[0] for shape in shapes] == ["rect", "rect", "polyline"]
    assert np.allclose([shape[1:] for shape in shapes[:2]], [(100, 100), (500, 50)], atol=0.1)


def test_sketch_of_rows_has_a_curve_in_each() -> None:
    x = np.arange(1000) * 1e-3
    traces = [
        {**line(x, np.sin(9 * x), name, "#000", 1), "yaxis": axis}
        for name, axis in (("x", "y"), ("y", "y2"), ("z", "y3"))
    ]
    figure = Figure("Position", "", traces, stacked_axes("xyz", "mm"))
    heights = [curve[:, 1] for curve in points(preview(figure, []))]
    for row, height in enumerate(heights):
        assert height.min() >= 100 * row
        assert height.max() <= 100 * (row + 1)
    assert len(heights) == 3


@pytest.mark.parametrize("values", [np.full(100, np.nan), np.empty(0), np.zeros(100)])
def test_sketch_of_nothing_or_of_a_constant_is_valid(values: Array) -> None:
    svg = preview(against_time(values), [])
    assert "nan" not in svg
    assert "inf" not in svg


def test_plot_without_a_time_has_no_sketch() -> None:
    axes = {"xaxis": {"title": {"text": "delay [ms]"}}}
    assert preview(against_time(np.ones(10), axes), []) == ""


# -- density ---------------------------------------------------------------------------------------


def test_time_spent_is_that_of_the_recording() -> None:
    rng = np.random.default_rng(2)
    across, up = rng.normal(size=(2, 5000))
    across[:100] = np.nan
    ranges = ([-5.0, 5.0], [-5.0, 5.0])
    trace = time_spent(across, up, ranges, 0.01)
    cells = np.array([[np.nan if z is None else z for z in row] for row in trace["z"]], float)
    # Cells hold two decimals of a logarithm.
    assert np.isclose(np.nansum(10.0**cells), 49.0, rtol=0.02)
    expected, *_ = np.histogram2d(up[100:], across[100:], bins=cells.shape, range=ranges[::-1])
    assert np.array_equal(np.isnan(cells), expected == 0)


def test_path_that_crosses_itself_often_is_long() -> None:
    t = np.linspace(0.0, 1.0, 50_000)[:, None]
    once = np.hstack((np.cos(6 * t), np.sin(6 * t), t))
    often = np.hstack((np.cos(600 * t), np.sin(600 * t), t))
    assert not is_long(once)
    assert is_long(often)
    assert not is_long(np.zeros((1000, 3)))
    assert not is_long(np.full((1000, 3), np.nan))
