"""Layouts for Foxglove and RViz name what recordings of ours have."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import teleop_core as tc
from teleop_core.bags.layouts import layout
from teleop_core.bags.markers import MARKERS
from teleop_core.graph import config_folder, topics

FOXGLOVE, RVIZ = config_folder() / "foxglove_layout.json", config_folder() / "teleop.rviz"
TOPIC = re.compile(r"^/[a-z_/]+")
ALSO_LIVE = {f"/{MARKERS.name}"}  # drawn while somebody looks, not recorded


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tc.Recording:
    return tc.run("coarse_box", duration=0.3, out=tmp_path_factory.mktemp("layouts") / "bag")


def texts(part: Any) -> Iterator[str]:
    """All texts and names in a document."""
    if isinstance(part, dict):
        for name, value in part.items():
            yield str(name)
            yield from texts(value)
    elif isinstance(part, list):
        for value in part:
            yield from texts(value)
    elif isinstance(part, str):
        yield part


@pytest.mark.parametrize("file", [FOXGLOVE, RVIZ], ids=["foxglove", "rviz"])
def test_every_topic_of_a_layout_is_in_a_recording(file: Path, recorded: tc.Recording) -> None:
    content = yaml.safe_load(file.read_text(encoding="utf-8"))
    named = {found.group() for text in texts(content) if (found := TOPIC.match(text))}
    assert named - ALSO_LIVE == named & {f"/{topic}" for topic in recorded.topics}
    assert len(named) > 4
    assert "/robot_description" in named


def panels(node: Any) -> list[str]:
    """Panels of the arrangement of a layout."""
    return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])


def test_every_panel_of_foxglove_is_placed_once_and_configured() -> None:
    content = json.loads(FOXGLOVE.read_text(encoding="utf-8"))
    assert sorted(panels(content["layout"])) == sorted(content["configById"])


def test_curves_of_foxglove_are_fields_of_their_messages() -> None:
    content = json.loads(FOXGLOVE.read_text(encoding="utf-8"))["configById"].values()
    curves = [path["value"] for panel in content for path in panel.get("paths", ())]
    joints, fields = tc.load_robot("rcrt1").joint_names, {"position", "orientation", "force"}
    assert curves
    for curve in curves:
        name, _, path = curve.removeprefix("/").partition(".")
        topic = topics.BY_NAME[name]
        index = re.fullmatch(r"position\[(\d+)\]", path)
        if index is not None:
            assert int(index.group(1)) < len(topic.names(joints))
            continue
        whole, part, axis = path.split(".")
        assert whole == {topics.Kind.POSE: "pose", topics.Kind.WRENCH: "wrench"}[topic.kind]
        assert part in fields
        assert axis in "xyz"
        assert layout(topic, joints).width in {6, 7}


def test_frames_that_rviz_is_fixed_to_are_those_of_the_recording() -> None:
    content = yaml.safe_load(RVIZ.read_text(encoding="utf-8"))
    assert content["Visualization Manager"]["Global Options"]["Fixed Frame"] == "world"
