"""Exports hold what the recording holds: read back by pandas, pyarrow and LeRobot's rules."""

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from pyarrow.lib import ChunkedArray, Table

import teleop_core as tc
import teleop_exchange
from teleop_core.bags.writer import BagWriter
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_MEASURED_CP
from teleop_core.kernels.geometry import Array
from teleop_exchange.joining import Streams

STATE_TOPIC = "teleop/state"


@pytest.fixture(scope="module")
def session() -> tc.Recording:
    """Six seconds with clutch, both modes and the box, in memory."""
    buttons = {"buttons.clutch": [1.0, 2.0], "buttons.mode": [2.5], "buttons.fixture": [3.0]}
    return tc.run("mode_switching", duration=3.0, settings=buttons)


@pytest.fixture(scope="module")
def saved(session: tc.Recording, tmp_path_factory: pytest.TempPathFactory) -> tc.Recording:
    return session.save(tmp_path_factory.mktemp("bags") / "session")


READERS = {"a.csv": pd.read_csv, "a.csv.gz": pd.read_csv, "a.parquet": pd.read_parquet}


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("place", ["memory", "disk"])
def test_table_is_the_frame_of_the_recording(
    name: str, place: str, session: tc.Recording, saved: tc.Recording, tmp_path: Path
) -> None:
    recording = session if place == "memory" else saved
    topics = ("slave/measured_cp", "slave/measured_js", "master/buttons")
    report = teleop_exchange.export_recording(recording, tmp_path / name, topics=topics)
    got = READERS[name](tmp_path / name).set_index("time")
    expected = recording.frame(*topics)
    assert list(got.columns) == list(expected.columns)
    assert np.array_equal(got.to_numpy(), expected.to_numpy())
    assert np.array_equal(got.index, expected.index)
    assert report.rows == len(expected)
    assert not list(tmp_path.glob(".*"))


def test_without_topics_all_numbers_are_there_and_states_are_held(saved: tc.Recording, tmp_path: Path) -> None:
    teleop_exchange.export_recording(saved, tmp_path / "all.parquet")
    got = pd.read_parquet(tmp_path / "all.parquet")
    for name in saved.topics:
        if name not in {"diagnostics", "robot_description", "tf"}:
            assert {f"{name}.{column}" for column in saved[name].columns} <= set(got.columns)
    state = saved[STATE_TOPIC]
    held = np.searchsorted(state.time, got["time"], side="right") - 1
    expected = np.where(held >= 0, state["is_clutched"][held], np.nan)
    assert np.array_equal(got[f"{STATE_TOPIC}.is_clutched"], expected, equal_nan=True)
    assert 0 < np.nansum(got[f"{STATE_TOPIC}.is_clutched"]) < len(got)


def test_a_report_alone_has_a_row_for_each_message(saved: tc.Recording, tmp_path: Path) -> None:
    teleop_exchange.export_recording(saved, tmp_path / "state.csv", topics=[STATE_TOPIC])
    got = pd.read_csv(tmp_path / "state.csv")
    assert np.array_equal(got[f"{STATE_TOPIC}.gain"], saved[STATE_TOPIC]["gain"])


def test_rows_at_a_rate_hold_the_newest_message(saved: tc.Recording, tmp_path: Path) -> None:
    teleop_exchange.export_recording(saved, tmp_path / "a.csv", topics=["slave/measured_cp"], rate=125.0)
    got = pd.read_csv(tmp_path / "a.csv")
    stream = saved["slave/measured_cp"]
    assert np.allclose(got["time"], np.arange(len(got)) / 125.0, rtol=0, atol=1e-9)
    assert np.array_equal(got["slave/measured_cp.x"], stream["x"][::8][: len(got)])
    assert len(got) == int(saved.duration * 125.0) + 1


def test_units_stand_in_the_metadata_and_on_request_in_the_names(saved: tc.Recording, tmp_path: Path) -> None:
    topics = ["slave/measured_cp", "slave/measured_js", "master/measured_cf"]
    for name, units in (("plain.parquet", False), ("named.parquet", True)):
        teleop_exchange.export_recording(saved, tmp_path / name, topics=topics, units=units)
    schema = pq.read_schema(tmp_path / "plain.parquet")
    found = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert found["time"] == "s"
    assert found["slave/measured_cp.x"] == "m"
    assert found["slave/measured_js.theta1.velocity"] == "rad/s or m/s"
    assert found["master/measured_cf.fx"] == "N"
    names = pq.read_schema(tmp_path / "named.parquet").names
    assert {"time [s]", "slave/measured_cp.x [m]", "master/measured_cf.fz [N]"} <= set(names)


def sparse(path: Path, chunks: int) -> tc.Recording:
    """Recording of poses at 100 Hz and buttons at 3 Hz, chunk by chunk."""
    with BagWriter(path, [MASTER_MEASURED_CP, MASTER_BUTTONS], ()) as writer:
        for begin in range(chunks):
            stamps = 1_000_000_000 * (begin + 1) + np.arange(100) * 10_000_000
            poses = np.tile([float(begin), 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (100, 1))
            poses[:, 1] = np.arange(100)
            presses = stamps[::33] + 1_000_000
            pressed = np.tile([begin % 2, 0.0, 1.0], (len(presses), 1))
            writer.write_block(
                {MASTER_MEASURED_CP: (stamps, poses, stamps), MASTER_BUTTONS: (presses, pressed, presses)}
            )
    return tc.open_recording(path)


def test_streams_of_different_rates_are_joined_and_newest_values_held_over_many_chunks(tmp_path: Path) -> None:
    recording = sparse(tmp_path / "bag", 40)
    teleop_exchange.export_recording(recording, tmp_path / "a.parquet")
    got = pd.read_parquet(tmp_path / "a.parquet").set_index("time")
    expected = recording.frame("master/measured_cp", "master/buttons").sort_index()
    assert np.array_equal(got[expected.columns].to_numpy(), expected.to_numpy(), equal_nan=True)
    pieces = list(Streams(recording).joined())
    assert len(pieces) > 5
    assert all(a.time_ns[-1] < b.time_ns[0] for a, b in pairwise(pieces))

    teleop_exchange.export_recording(recording, tmp_path / "held.parquet", rate=50.0)
    got = pd.read_parquet(tmp_path / "held.parquet")
    buttons = recording["master/buttons"]
    held = np.searchsorted(buttons.time, got["time"] + 1e-9, side="right") - 1
    expected = np.where(held >= 0, buttons["clutch"][held], np.nan)
    assert np.array_equal(got["master/buttons.clutch"], expected, equal_nan=True)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"topics": ["slave/nowhere"]}, "slave/nowhere"),
        ({"format": "xlsx"}, "csv, parquet, lerobot"),
        ({"rate": 0.0}, "--rate"),
        ({"format": "lerobot", "action": "wish"}, "joints, "),
        ({"format": "lerobot", "rate": 33.3}, "whole number"),
        ({"out": "a.xlsx"}, ".parquet"),
    ],
)
def test_wrong_exports_are_refused_and_leave_nothing(
    options: Any, text: str, session: tc.Recording, tmp_path: Path
) -> None:
    out = tmp_path / options.pop("out", "a.csv")
    with pytest.raises(tc.TeleopError) as error:
        teleop_exchange.export_recording(session, out, **options)
    assert text in str(error.value)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


def test_existing_files_are_never_touched_and_a_table_holds_one_recording(
    session: tc.Recording, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text("precious")
    with pytest.raises(tc.RecordingError, match="exists already"):
        teleop_exchange.export_recording(session, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text() == "precious"
    with pytest.raises(tc.ParameterError, match="lerobot takes several"):
        teleop_exchange.export_recording([session, session], tmp_path / "b.csv")


# Data sets.


@pytest.fixture(scope="module")
def data_set(
    session: tc.Recording, saved: tc.Recording, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, teleop_exchange.ExportReport]:
    out = tmp_path_factory.mktemp("sets") / "cut"
    report = teleop_exchange.export_recording([saved, session], out, task="follow the edge")
    return out, report


def frames_of(out: Path) -> Table:
    return pq.read_table(out / "data/chunk-000/file-000.parquet")


def vectors(column: ChunkedArray) -> Array:
    return np.array(column.to_pylist())


def test_a_data_set_has_the_newest_values_fifty_times_a_second(
    data_set: tuple[Path, teleop_exchange.ExportReport], saved: tc.Recording
) -> None:
    out, report = data_set
    frames = frames_of(out)
    one = frames.filter(np.array(frames["episode_index"]) == 1)
    assert report.rows == len(frames) == 2 * len(one)
    info = json.loads((out / "meta/info.json").read_text())
    names = info["features"]["observation.state"]["names"]
    state = vectors(one["observation.state"])
    at = np.rint(np.array(one["timestamp"]) * 1000).astype(int)
    for topic, column, name in (
        ("slave/measured_js", "theta1.position", "theta1"),
        ("slave/measured_cp", "z", "tip.z"),
    ):
        expected = saved[topic][column][at].astype(np.float32)
        assert np.array_equal(state[:, names.index(name)], expected)
    joints = info["features"]["action"]["names"]
    action = saved["slave/servo_jp"][joints][at].astype(np.float32)
    assert np.array_equal(vectors(one["action"]), action)
    assert np.allclose(np.diff(np.array(one["timestamp"])), 0.02, rtol=0, atol=1e-4)


def test_counters_of_a_data_set_count(data_set: tuple[Path, teleop_exchange.ExportReport]) -> None:
    frames = frames_of(data_set[0])
    count = len(frames) // 2
    assert np.array_equal(frames["index"], np.arange(2 * count))
    assert np.array_equal(frames["frame_index"], np.tile(np.arange(count), 2))
    assert np.array_equal(frames["episode_index"], np.repeat([0, 1], count))
    assert not np.any(frames["task_index"])


def test_descriptions_of_a_data_set_agree_with_its_frames(data_set: tuple[Path, teleop_exchange.ExportReport]) -> None:
    out, _ = data_set
    frames, info = frames_of(out), json.loads((out / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert info["total_frames"] == len(frames)
    assert info["total_episodes"] == 2
    assert info["splits"] == {"train": "0:2"}
    assert set(info["features"]) == set(frames.column_names)
    for key, feature in info["features"].items():
        kind = frames.schema.field(key).type
        if feature["shape"] != [1]:
            assert kind.list_size == feature["shape"][0] == len(feature["names"])
    episodes = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [e["length"] for e in episodes] == [len(frames) // 2] * 2
    assert episodes[1]["dataset_from_index"] == episodes[0]["dataset_to_index"]
    assert episodes[0]["tasks"] == ["follow the edge"]
    tasks = pd.read_parquet(out / "meta/tasks.parquet")
    assert tasks.loc["follow the edge", "task_index"] == 0
    stats = json.loads((out / "meta/stats.json").read_text())
    state = vectors(frames["observation.state"])
    for name, expected in (
        ("min", state.min(0)),
        ("max", state.max(0)),
        ("mean", state.mean(0)),
        ("std", state.std(0)),
        ("q90", np.quantile(state, 0.9, axis=0)),
    ):
        assert np.allclose(stats["observation.state"][name], expected, rtol=1e-6, atol=1e-9)


def test_actions_may_be_poses_of_the_tip(session: tc.Recording, tmp_path: Path) -> None:
    teleop_exchange.export_recording(session, tmp_path / "set", action="tip", rate=10.0)
    info = json.loads((tmp_path / "set/meta/info.json").read_text())
    names = info["features"]["action"]["names"]
    assert names == [f"tip.{c}" for c in ("x", "y", "z", "qw", "qx", "qy", "qz")]
    at = np.rint(100 * np.arange(len(frames_of(tmp_path / "set")))).astype(int)
    expected = session["slave/servo_cp"].values[at].astype(np.float32)
    assert np.array_equal(vectors(frames_of(tmp_path / "set")["action"]), expected)
    assert info["fps"] == 10


def test_goal_and_object_are_the_state_of_the_environment_if_every_recording_has_them(
    session: tc.Recording, tmp_path: Path
) -> None:
    key = "observation.environment_state"
    picked, aimed = tc.run("pick", duration=3.0), tc.run("point", duration=3.0)
    for recording, topic, names in (
        (picked, "slave/jaw/object_cp", ["object.x", "object.y", "object.z"]),
        (aimed, "task/state", ["goal_x", "goal_y", "goal_z"]),
    ):
        folder = tmp_path / names[0]
        teleop_exchange.export_recording(recording, folder, "lerobot")
        info = json.loads((folder / "meta/info.json").read_text())
        assert info["features"][key]["names"][:3] == names
        found = vectors(frames_of(folder)[key])
        assert found.shape[1] == len(info["features"][key]["names"]) >= 7
        stream = recording[topic]
        at = [list(stream.columns).index(name.removeprefix("object.")) for name in names]
        last = stream.values[-1, at]
        assert np.abs(last).max() > 1e-3
        assert np.allclose(found[-1, :3], last.astype(np.float32))
    for recordings in (session, [picked, session]):
        folder = tmp_path / f"without_{isinstance(recordings, list)}"
        teleop_exchange.export_recording(recordings, folder, "lerobot")
        assert key not in json.loads((folder / "meta/info.json").read_text())["features"]


def test_recordings_of_other_arms_do_not_mix_and_one_without_a_slave_makes_no_data_set(
    session: tc.Recording, tmp_path: Path
) -> None:
    other, bare = tc.run("coarse_box", duration=0.1, robot="puma560"), sparse(tmp_path / "bag", 2)
    for recordings, told in (([session, other], "other joints"), (bare, "slave/measured_js")):
        with pytest.raises(tc.RecordingError, match=told):
            teleop_exchange.export_recording(recordings, tmp_path / "set")
        assert not (tmp_path / "set").exists()


_LOADER = """
import json, sys
import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
found = LeRobotDataset("own/set", root=sys.argv[1])
rows = np.array([found[i]["observation.state"].numpy() for i in range(len(found))])
actions = np.array([found[i]["action"].numpy() for i in range(len(found))])
print(json.dumps([len(found), found.num_episodes, found[0]["task"],
                  rows.astype(float).tolist(), actions.astype(float).tolist()]))
"""


def test_the_loader_of_lerobot_reads_the_same_numbers(data_set: tuple[Path, teleop_exchange.ExportReport]) -> None:
    """LEROBOT_PYTHON names a Python that has the lerobot package; else that of the tests."""
    python = os.environ.get("LEROBOT_PYTHON", sys.executable)
    tried = subprocess.run([python, "-c", "import lerobot.datasets.lerobot_dataset"], capture_output=True, check=False)
    if tried.returncode:
        pytest.skip("the lerobot package is not installed")
    out = str(Path(data_set[0]))
    done = subprocess.run(
        [python, "-c", _LOADER, out],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env=os.environ | {"HF_HUB_OFFLINE": "1"},
    )
    assert done.returncode == 0, done.stderr
    count, episodes, task, states, actions = json.loads(done.stdout.splitlines()[-1])
    frames = frames_of(data_set[0])
    assert (count, episodes, task) == (len(frames), 2, "follow the edge")
    assert np.array_equal(np.float32(states), vectors(frames["observation.state"]))
    assert np.array_equal(np.float32(actions), vectors(frames["action"]))
