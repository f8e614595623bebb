"""Meshes of arms in recordings: what is drawn is the arm that was recorded, wherever it is read."""

import base64
import os
import shutil
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import teleop_core as tc
from present import present
from teleop_console.recorded_arms import configuration_of, recorded_arms
from teleop_core.bags import kept_files, reader
from teleop_core.robots.bodies.looks import Look, looks_of

URDF = (Path(__file__).parents[2] / "examples" / "any_arm.urdf").read_text()
LINKS = ("column", "upper_arm", "forearm", "wrist_1")


def arm(folder: Path, size: float = 1.0, lift: str = "0.42") -> Path:
    """A package whose links have meshes, by a name of each form; path of its URDF.

    Its last link has a mesh in two places, which is one file.
    """
    for part in ("urdf", "meshes"):
        (folder / "some_arm" / part).mkdir(parents=True)
    meshes = folder / "some_arm" / "meshes"
    names = ("package://some_arm/meshes/0.stl", "../meshes/1.stl", f"file://{meshes}/2.STL", "package://meshes/3.obj")
    text = URDF.replace('xyz="0 0 0.42"', f'xyz="0 0 {lift}"')
    for k, (link, name) in enumerate(zip(LINKS, names, strict=True)):
        trimesh.creation.box(size * np.array((0.1, 0.05 + 0.01 * k, 0.03))).export(meshes / name.rpartition("/")[2])
        shape = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{shape}')
    path = folder / "some_arm" / "urdf" / "arm.urdf"
    path.write_text(text)
    return path


def recorded(folder: Path, path: Path, **more: list[str] | Mapping[str, str | list[str]]) -> tc.Recording:
    options: dict[str, Any] = {"robot": str(path), "geometry": ["tip=tool0"], "duration": 0.3, **more}
    return tc.run("coarse_box", out=folder / "bag", **options)


def drawn(path: Path) -> list[dict[int, tuple[Look, ...]]]:
    """Looks of each arm as the page of a recording draws them."""
    bag = reader.Bag(path)
    arms, _ = recorded_arms(bag, configuration_of(bag))
    return [looks_of(one.arm.robot) for one in arms]


def assert_same_looks(found: list[dict[int, tuple[Look, ...]]], expected: list[dict[int, tuple[Look, ...]]]) -> None:
    assert [list(looks) for looks in found] == [list(looks) for looks in expected]
    for one, other in zip(found, expected, strict=True):
        pairs = [
            (a.mesh, b.mesh)
            for own, theirs in zip(one.values(), other.values(), strict=True)
            for a, b in zip(own, theirs, strict=True)
        ]
        for (vertices, faces), (points, corners) in pairs:
            np.testing.assert_array_equal(vertices, points)
            np.testing.assert_array_equal(faces, corners)


def kept(metadata: dict[str, str]) -> list[str]:
    return [key for key in metadata if key.startswith("sha256:")]


@pytest.mark.slow
def test_a_moved_recording_is_replayed_scored_and_drawn_as_ever_once_the_arms_folder_is_gone(tmp_path: Path) -> None:
    recording = recorded(tmp_path, arm(tmp_path / "mine"), settings={"world": "button"})
    before = tc.replay(present(recording.path))["slave/setpoint_js"].values
    looks, score = drawn(present(recording.path)), recording.score()
    assert score.value("touch.presses") == 0  # what is scored needs the arm
    assert len(looks[0]) == len(LINKS)
    elsewhere: Any = tmp_path / "elsewhere" / "copy"
    shutil.copytree(present(recording.path), elsewhere)
    shutil.rmtree(tmp_path / "mine")
    shutil.rmtree(present(recording.path))
    assert_same_looks(drawn(elsewhere), looks)
    again: Any = tc.open_recording(elsewhere).score()
    for key in ("touch.presses", "position_error_mm.rms"):
        assert again.value(key) == score.value(key)
    again = tc.replay(elsewhere, out=tmp_path / "again")
    np.testing.assert_array_equal(again["slave/setpoint_js"].values, before)
    assert kept(again.metadata) == kept(recording.metadata)
    assert_same_looks(drawn(again.path), looks)


def test_the_recorded_mesh_is_drawn_where_it_is_another_by_now(tmp_path: Path) -> None:
    path = arm(tmp_path)
    recording = recorded(tmp_path, path)
    looks = drawn(present(recording.path))
    trimesh.creation.icosphere().export(path.parents[1] / "meshes" / "1.stl")
    assert_same_looks(drawn(present(recording.path)), looks)


@pytest.mark.parametrize("is_gone", [False, True])
def test_what_a_recording_has_no_room_for_is_told_in_one_line_and_again_when_it_changed(
    is_gone: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = arm(tmp_path)
    monkeypatch.setattr(kept_files, "_MOST", 1400)
    with pytest.warns(UserWarning, match=r"keeps .* of 2\.STL, 3\.obj it keeps only digests$") as told:
        recording = recorded(tmp_path, path)
    assert len(told) == 1
    assert len(kept(recording.metadata)) == 2
    looks = drawn(present(recording.path))
    assert len(looks[0]) == len(LINKS)
    mesh = path.parents[1] / "meshes" / "2.STL"
    path.write_text(path.read_text() + "<!-- other by now: the copy takes the mesh from here -->")
    assert_same_looks(drawn(present(recording.path)), looks)
    mesh.unlink() if is_gone else trimesh.creation.icosphere().export(mesh)
    said = f"2.STL: this file is {'gone' if is_gone else 'another by now'}; the recording has no"
    with pytest.warns(UserWarning, match=said):
        kept_files.recorded_files(recording.metadata)


def test_two_arms_with_the_same_meshes_keep_them_once_and_each_is_drawn_with_its_own(tmp_path: Path) -> None:
    left, right, other = (arm(tmp_path / n, size) for n, size in (("l", 1), ("r", 1), ("o", 2)))
    for one, distinct in ((right, 4), (other, 8)):
        settings = {"right/robot": str(one)}
        folder = tmp_path / str(distinct)
        recording = recorded(folder, left, arms=["left", "right"], settings=settings)
        assert len(kept(recording.metadata)) == distinct
        looks = drawn(present(recording.path))
        one.rename(one.with_suffix(".moved"))
        assert_same_looks(drawn(present(recording.path)), looks)
        assert np.abs(looks[1][1][0].mesh[0] / looks[0][1][0].mesh[0]).max() == pytest.approx(distinct / 4)


def test_a_mesh_that_is_touched_is_kept_before_those_that_are_only_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_files, "_MOST", 700)
    ball = tmp_path / "ball.stl"
    trimesh.creation.box((50.0, 50.0, 30.0)).export(ball)
    settings = {"world": "mesh", "world.mesh.file": str(ball)}
    with pytest.warns(UserWarning, match=r"of 0\.stl, 1\.stl, 2\.STL, 3\.obj it keeps only digests"):
        recording = recorded(tmp_path, arm(tmp_path), settings=settings)
    assert kept(recording.metadata) == [recording.metadata["mesh_file"]]


@pytest.mark.parametrize(
    "packed", ["", "x", "zlib, base64: x", "zlib, base64: " + base64.b64encode(zlib.compress(b"another")).decode()]
)
def test_a_kept_mesh_that_was_damaged_is_told_as_one_that_is_gone(packed: str, tmp_path: Path) -> None:
    files = kept_files.KeptFiles()
    files.add_robot(str(arm(tmp_path)))
    texts = {"robot": str(tmp_path / "gone.urdf"), **files.texts()}
    shutil.rmtree(tmp_path / "some_arm")
    texts[kept(texts)[0]] = packed
    with pytest.warns(UserWarning, match=r"0\.stl: this file is gone") as told:
        copy = kept_files.recorded_files(texts)[texts["robot"]]
    assert len(told) == 1
    assert Path(copy).read_text() == texts["robot_file"]


def test_a_recording_leads_to_no_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.stl")
    texts = {"mesh": str(tmp_path / "pipe.stl"), "mesh_file": "sha256:0"}
    with pytest.warns(UserWarning, match="gone"):
        assert kept_files.recorded_files(texts) == {}


def test_a_kept_mesh_unpacks_to_no_more_than_a_file_that_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = kept_files.KeptFiles()
    files.add_mesh(str(arm(tmp_path).parents[1] / "meshes" / "1.stl"))
    shutil.rmtree(tmp_path / "some_arm")
    assert kept_files.recorded_files(files.texts())
    monkeypatch.setattr(kept_files, "_MOST", 683)
    with pytest.warns(UserWarning, match="gone"):
        assert kept_files.recorded_files(files.texts()) == {}
