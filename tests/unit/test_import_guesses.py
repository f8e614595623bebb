"""What an import guesses from names and numbers: it is right, or the file is refused with the option that says it."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import teleop_core as tc
import teleop_exchange
from teleop_core.kernels.geometry import Array

COUNT, RATE = 300, 60.0
T = np.arange(COUNT) / RATE
PLACES = np.column_stack((0.04 * np.sin(T), 0.03 * np.sin(1.3 * T), 0.14 + 0.01 * np.cos(1.7 * T)))
TURNS = Rotation.from_rotvec(np.column_stack((0.3 * np.sin(T), 0.1 * np.sin(2.0 * T), 0.5 * np.sin(0.7 * T))))
OTHER_PLACES = PLACES[:, ::-1] + 0.25
OTHER_TURNS = Rotation.from_rotvec(np.column_stack((0.8 * np.sin(T), 0.0 * T, 0.2 * T)))
XYZW, OTHER_XYZW = TURNS.as_quat(), OTHER_TURNS.as_quat()


def written(tmp_path: Path, head: str, *columns: Array, ending: str = "csv") -> Path:
    table = pd.DataFrame(np.column_stack(columns), columns=head.split())
    path = tmp_path / f"hand.{ending}"
    table.to_csv(path, index=False) if ending == "csv" else table.to_parquet(path)
    return path


def imported(path: Path, tmp_path: Path, **options: Any) -> tuple[teleop_exchange.ImportReport, tc.Stream]:
    report = teleop_exchange.import_recording(path, tmp_path / f"out{len(list(tmp_path.iterdir()))}", **options)
    return report, report.recording["master/measured_cp"]


def refusal(path: Path, tmp_path: Path, **options: Any) -> str:
    with pytest.raises(tc.TeleopError) as error:
        teleop_exchange.import_recording(path, tmp_path / "out", **options)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()
    return str(error.value)


def assert_motion(stream: tc.Stream, places: Array = PLACES, turns: Rotation = TURNS) -> None:
    assert np.allclose(stream[["x", "y", "z"]], places, rtol=0, atol=1e-12)
    got = Rotation.from_quat(stream[["qw", "qx", "qy", "qz"]], scalar_first=True)
    assert (turns.inv() * got).magnitude().max() < 1e-6


# Which columns.


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ("time x y z x.1 y.1 z.1 w", (PLACES, XYZW)),
        ("time x y z w x.1 y.1 z.1", (XYZW, PLACES)),
        ("time w x y z x.1 y.1 z.1", (XYZW[:, 3:], XYZW[:, :3], PLACES)),
        ("time pos_x pos_y pos_z x y z w", (PLACES, XYZW)),
        ("time x y z rx ry rz w", (PLACES, XYZW)),
    ],
)
def test_of_the_columns_x_y_z_those_of_unit_length_with_w_are_the_quaternion(
    head: str, columns: tuple[Array, ...], tmp_path: Path
) -> None:
    assert_motion(imported(written(tmp_path, head, T, *columns), tmp_path)[1])


def test_a_quaternion_that_two_sets_of_columns_could_be_is_asked_for(tmp_path: Path) -> None:
    small = 1e-3 * PLACES
    still = np.tile([0.0, 0.0, 0.0, 1.0], (COUNT, 1))
    path = written(tmp_path, "time x y z x.1 y.1 z.1 w", T, small, still)
    text = refusal(path, tmp_path)
    assert "--quaternion" in text
    assert "x.1 y.1 z.1" in text
    position, quaternion = ("x", "y", "z"), ("w", "x.1", "y.1", "z.1")
    for said in ({"position": position}, {"position": position, "quaternion": quaternion}, {"quaternion": quaternion}):
        assert_motion(imported(path, tmp_path, **said)[1], small, Rotation.identity(COUNT))


@pytest.mark.parametrize("head", ["time x y z w", "time qx qy qz qw"])
def test_a_quaternion_is_never_a_position(head: str, tmp_path: Path) -> None:
    assert "no columns that look like x, y, z" in refusal(written(tmp_path, head, T, XYZW), tmp_path)


def test_without_a_head_a_quaternion_before_the_place_is_asked_for(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "hand.txt", np.column_stack((T, XYZW, PLACES)))
    assert "columns 2 to 5" in refusal(tmp_path / "hand.txt", tmp_path)


BODIES = {
    "left_pos_x left_pos_y left_pos_z right_pos_x right_pos_y right_pos_z right_rot_x right_rot_y right_rot_z "
    "right_rot_w left_rot_x left_rot_y left_rot_z left_rot_w": ("left_pos_", "right_pos_"),
    "LeftHandPosX LeftHandPosY LeftHandPosZ RightHandPosX RightHandPosY RightHandPosZ RightHandRotX RightHandRotY "
    "RightHandRotZ RightHandRotW LeftHandRotX LeftHandRotY LeftHandRotZ LeftHandRotW": ("LeftHandPos", "RightHandPos"),
    "pos.a.x pos.a.y pos.a.z pos.b.x pos.b.y pos.b.z quat.b.x quat.b.y quat.b.z quat.b.w quat.a.x quat.a.y quat.a.z "
    "quat.a.w": ("pos.a.", "pos.b."),
    "x y z x.1 y.1 z.1 qx.1 qy.1 qz.1 qw.1 qx qy qz qw": ("x y z", "x.1 y.1 z.1"),
}  # fmt: skip


@pytest.mark.parametrize("head", BODIES)
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_place_and_turn_are_of_the_same_body_or_the_bodies_are_listed(head: str, ending: str, tmp_path: Path) -> None:
    path = written(tmp_path, f"time {head}", T, PLACES, OTHER_PLACES, OTHER_XYZW, XYZW, ending=ending)
    text = refusal(path, tmp_path)
    assert "--position" in text
    assert all(stem in text for stem in BODIES[head])
    known = head.split()
    assert_motion(imported(path, tmp_path, position=known[:3])[1])
    assert_motion(imported(path, tmp_path, position=known[3:6])[1], OTHER_PLACES, OTHER_TURNS)
    if "." not in head or "pos" in head:  # else any body may be meant
        assert_motion(imported(path, tmp_path, quaternion=known[10:14], quaternion_order="xyzw")[1])


def test_the_only_place_brings_the_turn_of_its_body(tmp_path: Path) -> None:
    head = "time head_qx head_qy head_qz head_qw tool_px tool_py tool_pz tool_qx tool_qy tool_qz tool_qw"
    assert_motion(imported(written(tmp_path, head, T, OTHER_XYZW, PLACES, XYZW), tmp_path)[1])


def test_a_turn_of_another_body_alone_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, "time tool_x tool_y tool_z head_qx head_qy head_qz head_qw", T, PLACES, OTHER_XYZW)
    assert "another body" in refusal(path, tmp_path)
    assert imported(path, tmp_path, orientation="none")[0].rotation == 0.0


@pytest.mark.parametrize("head", ["lx ly lz rx ry rz", "a_x a_y a_z b_x b_y b_z"])
def test_bodies_of_one_letter_are_two_places(head: str, tmp_path: Path) -> None:
    path = written(tmp_path, f"t {head}", T, PLACES, OTHER_PLACES)
    assert all(name in refusal(path, tmp_path) for name in head.split())


@pytest.mark.parametrize("other", ["hand_v{}", "hand_vel_{}", "hand_f{}", "hand_acc_{}", "a{}"])
def test_speeds_and_forces_of_a_hand_are_no_places(other: str, tmp_path: Path) -> None:
    head = " ".join(["t hand_tx hand_ty hand_tz", *(other.format(axis) for axis in "xyz")])
    stream = imported(written(tmp_path, head, T, PLACES, OTHER_PLACES), tmp_path)[1]
    assert_motion(stream, PLACES, Rotation.identity(COUNT))


@pytest.mark.parametrize("name", ["r{}", "rot_{}", "Rot{}", "angle_{}", "r{} [deg]", "tool.rotation.{}"])
@pytest.mark.parametrize("is_degrees", [True, False])
def test_three_angles_that_do_not_say_their_kind_are_asked_for(name: str, is_degrees: bool, tmp_path: Path) -> None:
    angles = TURNS.as_euler("xyz", degrees=is_degrees)
    table = pd.DataFrame(np.column_stack((T, PLACES, angles)))
    turned = [name.format(axis.upper() if name == "Rot{}" else axis) for axis in "xyz"]
    table.columns = pd.Index(["time", "x", "y", "z", *turned])
    table.to_csv(tmp_path / "hand.csv", index=False)
    text = refusal(tmp_path / "hand.csv", tmp_path)
    assert all(option in text for option in ("--euler", "--rotation-vector", "--orientation none"))
    if not is_degrees and "deg" in name:
        return
    said = {"euler": ("xyz", *turned), "angles": "deg" if is_degrees else "rad"}
    assert_motion(imported(tmp_path / "hand.csv", tmp_path, **said)[1])


@pytest.mark.parametrize("head", ["time x y z rotvec_x rotvec_y rotvec_z", "t x y z rx ry rz"])
def test_rotation_vectors_are_taken_in_radians_and_asked_for_in_degrees(head: str, tmp_path: Path) -> None:
    assert_motion(imported(written(tmp_path, head, T, PLACES, TURNS.as_rotvec()), tmp_path)[1])
    with warnings.catch_warnings():  # a table of an operator is no guess, and needs no note
        warnings.simplefilter("error" if head.startswith("t ") else "ignore")
        assert tc.replay(tmp_path / "hand.csv")["master/measured_cp"].values.any()
    path = written(tmp_path, head, T, PLACES, TURNS.as_rotvec(degrees=True))
    assert "--euler" in refusal(path, tmp_path)
    with pytest.raises(tc.TeleopError, match=r"--euler.*an option of `teleop import"):
        tc.replay(path)


# Which times.


@pytest.mark.parametrize("name", ["frame", "Index", "sample_number", "", "#", "seq", "value"])
@pytest.mark.parametrize("first", [0, 1, 5000])
def test_a_counter_is_no_time(name: str, first: int, tmp_path: Path) -> None:
    table = pd.DataFrame(PLACES, columns=["x", "y", "z"])
    table.insert(0, name, np.arange(COUNT) + first)
    table.to_csv(tmp_path / "hand.csv", index=False)
    text = refusal(tmp_path / "hand.csv", tmp_path)
    assert "--rate" in text
    assert "counts the rows" in text
    assert imported(tmp_path / "hand.csv", tmp_path, rate=RATE)[0].duration == pytest.approx(T[-1], abs=1e-6)


def test_a_counter_without_a_head_or_with_holes_is_no_time_either(tmp_path: Path) -> None:
    rows = np.column_stack((np.arange(COUNT), PLACES))
    pd.DataFrame(rows).astype({0: int}).to_csv(tmp_path / "bare.csv", index=False, header=False)
    assert "--rate" in refusal(tmp_path / "bare.csv", tmp_path)
    path = written(tmp_path, "frame x y z", np.cumsum(1 + 2 * (np.arange(COUNT) % 3 == 0)), PLACES)
    assert "counts the rows" in refusal(path, tmp_path)


EPOCHS = {"dotnet": "0001-01-01", "filetime": "1601-01-01", "excel": "1899-12-30", "matlab": "0000-12-31"}
"""Days at which these clocks begin, as their vendors write; MATLAB's day 366 is the last of the year 0."""


@pytest.mark.parametrize("clock", EPOCHS)
@pytest.mark.parametrize("date", ["2001-02-03T04:05:06", "2026-05-17T15:30:00", "2037-12-31T00:00:01"])
@pytest.mark.parametrize("name", ["ticks", "time", "stamp"])
def test_clocks_of_other_epochs_are_known_by_their_size(clock: str, date: str, name: str, tmp_path: Path) -> None:
    at = np.datetime64(date, "us") + np.round(T * 1e6).astype("timedelta64[us]")
    begin = np.datetime64("0001-01-01" if clock == "matlab" else EPOCHS[clock], "us")
    since = (at - begin).astype(np.int64)
    is_ticks = clock in {"dotnet", "filetime"}
    values = since * 10 if is_ticks else since / 86_400e6 + (367.0 if clock == "matlab" else 0.0)
    table = pd.DataFrame(PLACES, columns=["x", "y", "z"])
    table.insert(0, name, values)
    table.to_csv(tmp_path / "hand.csv", index=False)
    for options in ({}, {"time_unit": clock}):
        report, stream = imported(tmp_path / "hand.csv", tmp_path, **options)
        off = np.abs(stream.stamp_ns - at.astype("datetime64[ns]").astype(np.int64)).max()
        assert off <= (0 if is_ticks else 10_000)  # a double of days has steps of 10 µs
        assert options or any(f"times in {clock}" in text for text in report.told)


def test_ticks_of_an_unknown_clock_are_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, "ticks x y z", 81_234_567_890 + np.round(1e7 * T), PLACES)
    assert "--time-unit" in refusal(path, tmp_path)
    assert imported(path, tmp_path, rate=RATE)[0].duration == pytest.approx(T[-1], abs=1e-6)


def test_times_whose_unit_no_rate_explains_are_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, "time x y z", 1e-5 * np.arange(COUNT, dtype=np.float64), PLACES)
    text = refusal(path, tmp_path)
    assert "--time-unit" in text
    assert "--rate" in text


# Which rows.


def numbered(tmp_path: Path, head: str, order: list[tuple[int, int]]) -> Path:
    """Recordings of 100 rows that two columns number, 12 s apart, each 0.1 m beside the one before."""
    parts = []
    for number, pair in enumerate(order):
        part = np.column_stack((np.tile(pair, (100, 1)), 12.0 * number + T[:100], PLACES[:100] + 0.1 * number))
        parts.append(part)
    return written(tmp_path, f"{head} time x y z", np.concatenate(parts))


@pytest.mark.parametrize("head", ["stage trial", "session episode_index", "person demo"])
def test_an_episode_whose_rows_are_apart_is_not_one_recording(head: str, tmp_path: Path) -> None:
    order = [(stage, trial) for stage in (1, 2) for trial in (1, 2, 3)]
    path = numbered(tmp_path, head, order)
    text = refusal(path, tmp_path, episode=2)
    assert "2 places" in text
    assert f"--numbered-by {head}" in text
    found = teleop_exchange.import_episodes(path, tmp_path / "all", numbered_by=head.split())
    assert sorted(found.made) == list(range(6))
    assert not found.refused
    for number, report in found.made.items():
        places = report.recording["master/measured_cp"][["x", "y", "z"]]
        assert np.allclose(places, PLACES[:100] + 0.1 * number, rtol=0, atol=1e-12)
        assert report.duration == pytest.approx(T[99], abs=1e-6)


@pytest.mark.parametrize("head", ["trial stage", "episode take", "demo_id repetition"])
def test_an_episode_in_which_another_number_changes_where_the_time_jumps_is_not_one(head: str, tmp_path: Path) -> None:
    order = [(trial, stage) for trial in (1, 2, 3) for stage in (1, 2)]
    path = numbered(tmp_path, head, order)
    assert f"--numbered-by {' '.join(reversed(head.split()))}" in refusal(path, tmp_path, episode=2)
    found = teleop_exchange.import_episodes(path, tmp_path / "all", numbered_by=head.split())
    assert sorted(found.made) == list(range(6))


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize("head", ["session take", "subject trial"])
def test_recordings_that_nothing_called_an_episode_numbers_are_not_one(head: str, ending: str, tmp_path: Path) -> None:
    first, second = head.split()
    table = pd.read_csv(numbered(tmp_path, head, [(1, 1), (1, 2), (2, 1), (2, 2)]))
    if first == "subject":
        table["subject"] = table["subject"].map({1: "Anna", 2: "Ben"})
    path = tmp_path / f"more.{ending}"
    table.to_csv(path, index=False) if ending == "csv" else table.to_parquet(path)
    text = refusal(path, tmp_path, **({"episode": 1} if second == "trial" else {}))
    assert f"--numbered-by {head}" in text
    assert second == "trial" or "--numbered-by none" in text
    assert imported(path, tmp_path, numbered_by="none")[0].counts.samples == 400
    found = teleop_exchange.import_episodes(path, tmp_path / "all", numbered_by=head.split())
    assert sorted(found.made) == list(range(4))
    name = "Ben" if first == "subject" else "2"
    assert f"episode 2 of 4 ({first} {name}, {second} 1)" in found.made[2].told


def test_parts_of_one_recording_are_told_and_stay_together(tmp_path: Path) -> None:
    rows = np.column_stack((np.ones(COUNT), np.floor(T), T, PLACES))
    report, stream = imported(written(tmp_path, "episode_index phase time x y z", rows), tmp_path, episode=1)
    assert_motion(stream, PLACES, Rotation.identity(COUNT))
    assert any("--numbered-by phase episode_index" in text for text in report.told)
