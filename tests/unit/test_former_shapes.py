"""Former shapes: recordings of before are read, files of users are refused by what is known."""

from typing import Any

import numpy as np
import pytest

from any_shape import depth_of
from teleop_core.base import build
from teleop_core.coupling.fixtures.reported_fixture import reported_fixture
from teleop_core.coupling.mapping.gains import FixtureParameters
from teleop_core.graph.former_shapes import present_layer
from teleop_core.graph.layers import parse_text
from teleop_core.session.configuration import configure

UNUSED = {
    "fixture.sphere.diameter": 0.03,
    "fixture.keep_out_sphere.diameter": 0.02,
    "fixture.keep_out_sphere.place": [0.025, 0.0, 0.0],
    "fixture.mesh.place": [0.0, 0.0, 0.01],
    "fixture.line.tolerance": 0.002,
    "fixture.cylinder.length": 0.0,
    "fixture.side": "both",
    "fixture.union.parts": [
        "keep_out_box place=[0.0, 0.02, 0.0] size=[0.01, 0.01, 0.01]",
        "cylinder diameter=0.01 length=0.05",
    ],
}
KEPT = {
    "fixture.sphere.radius": 0.015,
    "fixture.line.radius": 0.002,
    "fixture.cylinder.length": 0.0,
    "fixture.side": "both",
    "fixture.union.parts": ["not box at=[0.0, 0.02, 0.0] size=[0.01, 0.01, 0.01]", "cylinder radius=0.005 length=0.05"],
}


@pytest.mark.parametrize(
    ("kind", "more"),
    [
        ("box", {}),
        ("keep_out_sphere", {"fixture.kind": "sphere", "fixture.keep_out": True,
                             "fixture.sphere.radius": 0.01, "fixture.place": [0.025, 0.0, 0.0]}),
        ("mesh", {"fixture.place": [0.0, 0.0, 0.01]}),
    ],
)  # fmt: skip
def test_a_recording_of_before_has_the_same_shapes_under_their_names_of_today(kind: str, more: dict[str, Any]) -> None:
    found = present_layer({"motion_scaling": {"fixture.kind": kind} | UNUSED})["motion_scaling"]
    assert found == KEPT | {"fixture.kind": kind} | more
    values = {name.removeprefix("fixture."): value for name, value in found.items()}
    build(FixtureParameters, values | {"kind": "box", "place": (0.0, 0.0, 0.0), "keep_out": False})


def test_objects_of_before_and_all_names_of_today_stay_what_they_are() -> None:
    before = {"world.box.edges": [1.0], "world.cylinder.height": 1.0, "world.button.height": 1.0}
    now = {"world.box.size": [1.0], "world.cylinder.length": 1.0, "world.button.length": 1.0}
    assert present_layer({"slave_sim": before}) == {"slave_sim": now}
    text = parse_text(configure("palpation").text(), "text")
    assert present_layer(text) == text


def test_a_report_of_before_is_scored_as_it_was() -> None:
    told = {"fixture": "keep_out_sphere", "fixture.place": "(0.025, 0.0, 0.0)", "fixture.diameter": "0.03"}
    fixture = reported_fixture(told, np.ones(3))
    assert not fixture.fault
    assert fixture.kind == "keep_out_sphere"
    assert depth_of(fixture.made, (0.015, 0.0, 0.0))[0] == pytest.approx(0.005)
