"""Robots from files in recordings: what is replayed and scored is the arm that moved."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.bags import arms, kept_files
from teleop_core.base.errors import ParameterError
from teleop_core.session.runner import recorded_configuration

URDF = (Path(__file__).parents[2] / "examples" / "any_arm.urdf").read_text()
XACRO = (
    URDF.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    .replace(
        '<link name="base"/>', '<link name="base"/><xacro:arg name="lift" default="0"/><!-- <xacro:arg/> ${1 / 0} -->'
    )
    .replace('xyz="0 0 0.42"', 'xyz="0 0 ${0.4 + $(arg lift)}"')
)


def longer(path: Path) -> None:
    path.write_text(re.sub(r"\b0\.(3|4)\b", r"0.\g<1>3", path.read_text()))
    assert path.read_text() != URDF


def recorded(folder: Path, **more: list[str] | Mapping[str, str | list[object]]) -> tuple[tc.Recording, Path]:
    """Recording of a session with the robot of a URDF, and that file."""
    path = folder / "arm.urdf"
    path.write_text(URDF)
    options: dict[str, Any] = {"robot": str(path), "geometry": ["tip=tool0"], **more}
    return tc.run("coarse_box", duration=0.6, out=folder / "bag", **options), path


def test_an_arm_of_a_name_has_no_file_of_the_arm_beside_it(tmp_path: Path) -> None:
    right: Any = {"right/robot": "puma560", "right/geometry": []}
    recording, path = recorded(tmp_path, arms=["left", "right"], settings=right)
    assert kept_files.recorded_files(arms.of_arm(recording.bag, "left").metadata) == {str(path): str(path)}
    assert kept_files.recorded_files(arms.of_arm(recording.bag, "right").metadata) == {}


def test_a_file_that_says_what_it_said_is_read_where_it_lies(tmp_path: Path) -> None:
    recording, path = recorded(tmp_path)
    assert kept_files.recorded_files(recording.metadata) == {str(path): str(path)}
    assert recording.metadata["robot_file"] == URDF
    assert recorded_configuration(recording.bag)[0]["slave"]["robot"] == str(path)
    longer(path)
    copy = kept_files.recorded_files(recording.metadata)[str(path)]
    assert Path(copy).name == path.name
    assert Path(copy).read_text() == URDF
    assert recorded_configuration(recording.bag)[0]["slave"]["robot"] == copy


def test_nothing_of_a_recording_is_expanded(tmp_path: Path) -> None:
    kept = {"robot": str(tmp_path / "arm.xacro"), "robot_file": XACRO}
    with pytest.raises(ParameterError, match="must be without macros"):
        tc.load_robot(kept_files.recorded_files(kept)[kept["robot"]], tip="tool0")


def test_of_a_xacro_the_urdf_is_kept_that_its_arguments_made(tmp_path: Path) -> None:
    path, urdf, kept = tmp_path / "arm.xacro", tmp_path / "arm.urdf", kept_files.KeptFiles()
    path.write_text(XACRO)
    kept.add_robot(str(path), ["xacro.lift=0.05"])
    urdf.write_text(kept.texts()["robot_file"])
    assert 'xyz="0 0 0.45"' in urdf.read_text()
    one = tc.load_robot(str(path), **{"xacro.lift": "0.05"}, tip="tool0")
    np.testing.assert_array_equal(one.fk(one.home), tc.load_robot(str(urdf), tip="tool0").fk(one.home))


def test_robots_of_a_name_store_no_file(tmp_path: Path) -> None:
    recording = tc.run("coarse_box", duration=0.1, out=tmp_path / "bag")
    assert not [key for key in recording.metadata if key.endswith("robot_file")]
