"""Fixtures as parts: the sphere beside the box, own shapes, and what is refused."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from teleop_core.base.errors import PartError
from teleop_core.base.parameters import build, parameter
from teleop_core.chain.fixtures import FIXTURES, Fixture, register_fixture
from teleop_core.chain.fixtures.sphere import SphereParameters, sphere_depth, sphere_outline
from teleop_core.chain.mapping.parameters import FixtureParameters
from teleop_core.kernels import kernel
from teleop_core.kernels.geometry import Array
from teleop_core.kernels.parts import numbers_of

# Quotients of numbers below one.
ROUNDING = 1e-15
places = st.tuples(*[st.floats(-0.1, 0.1)] * 3).map(np.array)


def own(name: str = "own", **more: Callable[..., object] | type[object] | None) -> Any:
    parts: dict[str, Any] = {
        "parameters": SphereParameters,
        "depth": sphere_depth,
        "outline": sphere_outline,
    }
    return Fixture(name, **{**parts, **more})


@given(places, st.floats(1e-3, 0.1))
def test_depth_of_a_sphere_leads_to_its_nearest_point(offset: Any, diameter: float) -> None:
    out = np.full(3, math.nan)
    length = sphere_depth(offset, np.array([diameter]), out)
    distance: Any = np.linalg.norm(offset)
    assert math.isclose(length, max(distance - 0.5 * diameter, 0.0), abs_tol=ROUNDING)
    nearest = offset * min(1.0, 0.5 * diameter / distance) if distance else offset
    assert np.allclose(offset - out, nearest, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("name", ["box", "sphere"])
def test_outline_lies_on_the_walls_and_depth_begins_there(name: str) -> None:
    part = FIXTURES.find(name)
    parameters = part.parameters()
    points, shape = part.outline(parameters), numbers_of(parameters)
    points = points[np.isfinite(points).all(axis=1)]
    assert not part.depths(0.999 * points, shape).any()
    assert (part.depths(1.001 * points, shape) > 0.0).all()
    assert np.allclose(part.size(parameters), 0.03, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("name", ["box", "sphere"])
def test_middle_of_every_fixture_is_inside(name: str) -> None:
    part = FIXTURES.find(name)
    assert not part.depths(np.zeros((1, 3)), numbers_of(part.parameters())).any()


def test_own_fixture_is_chosen_by_its_name_and_has_its_parameters(own_parts: None) -> None:
    @dataclass(frozen=True, kw_only=True)
    class ConeParameters:
        height: float = parameter(0.04, unit="m", lower=0.01, upper=0.5, doc="tip to base")
        widths: tuple[float, ...] = parameter((0.02, 0.03), unit="m", length=2, doc="of the base")

    def depth(offset: Array, shape: Array, out: Array) -> float:
        out[:] = 0.0
        return 0.0

    def outline(parameters: Any) -> Array:
        return np.array([(0.0, 0.0, 0.0), (parameters.widths[0], 0.0, parameters.height)])

    register_fixture(Fixture("my_cone", ConeParameters, depth, outline))
    chosen = build(FixtureParameters, {"kind": "my_cone", "my_cone.height": 0.05}).kind
    assert chosen.parameters == ConeParameters(height=0.05)
    assert np.array_equal(numbers_of(chosen.parameters), (0.05, 0.02, 0.03))


def writes_four(offset: Any, shape: Any, out: Any) -> float:
    for i in range(4):
        out[i] = 0.0
    return 0.0


def reads_beyond(offset: Any, shape: Any, out: Any) -> Any:
    return offset[0] - shape[3]


def fills(value: float | ArrayLike, length: float = 0.0) -> Callable[[Array, Array, Array], float]:
    def depth(offset: Array, shape: Array, out: Array) -> float:
        out[:] = value
        return length

    return depth


BAD = {
    "depth takes two arguments": ({"depth": lambda offset, out: 0.0}, "depth(offset, shape, out)"),
    "kernel takes two arguments": (
        {"depth": kernel(lambda offset, out: 0.0)}, "depth(offset, shape, out)",
    ),
    "depth gives a vector": ({"depth": lambda o, s, out: np.zeros(3)}, "-> float"),
    "depth gives nothing": ({"depth": lambda o, s, out: None}, "-> float"),
    "depth is no number": ({"depth": lambda o, s, out: math.nan}, "finite and >= 0"),
    "depth is negative inside": ({"depth": lambda o, s, out: -1.0}, "finite and >= 0"),
    "vector is no number": ({"depth": fills(math.nan)}, "finite and >= 0"),
    "vector has another shape": ({"depth": fills(np.zeros(4))}, "depth(offset, shape, out)"),
    "kernel writes beyond the vector": ({"depth": kernel(writes_four)}, "three numbers"),
    "kernel reads beyond the numbers": ({"depth": kernel(reads_beyond)}, "finite and >= 0"),
    "middle is outside": ({"depth": fills((1.0, 0.0, 0.0), 1.0)}, "middle is inside"),
    "vector is shorter than the depth": (
        {"depth": lambda o, s, out: float(np.linalg.norm(o))}, "out is as long as its depth",
    ),
    "depth is none": ({"depth": None}, "depth can be called"),
    "outline is flat": ({"outline": lambda p: np.zeros((4, 2))}, "outline (N, 3)"),
    "outline has no points": ({"outline": lambda p: np.full((4, 3), np.nan)}, "finite points"),
    "outline takes nothing": ({"outline": lambda: None}, "outline(parameters)"),
    "parameters are no dataclass": ({"parameters": dict}, "dataclass"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_fixture_that_cannot_work_is_refused_before_anything_runs(
    own_parts: None, case: str
) -> None:
    values: Any
    values, expected = BAD[case]
    with pytest.raises(PartError) as error:
        register_fixture(own(**values))
    assert (error.value.kind, error.value.name) == ("fixture", "own")
    assert expected in error.value.expected
    assert "\n" not in str(error.value)
    assert "own" not in FIXTURES.names()
