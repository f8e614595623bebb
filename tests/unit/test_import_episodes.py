"""Importing all episodes: one recording each, kept when the import goes on."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import teleop_core as tc
import teleop_exchange
from teleop_core.commands.cli import main

NUMBERS, ROWS = (0, 1, 5), (120, 200, 80)


def table(numbers: tuple[int, ...] = NUMBERS) -> pd.DataFrame:
    """Episodes whose times begin at zero, each of its own motion."""
    parts = []
    for number in numbers:
        t = 0.01 * np.arange(ROWS[NUMBERS.index(number)])
        x, y = 0.02 * np.sin(t + number), 0.02 * np.cos(t)
        parts.append(pd.DataFrame({"t": t, "x": x, "y": y, "z": 0.01 * t, "episode": number}))
    return pd.concat(parts, ignore_index=True)


def data_set(folder: Path) -> Path:
    """Folder with the episodes in two files."""
    for name, numbers in (("chunk-000/file-000", (0, 5)), ("chunk-000/file-001", (1,))):
        path = folder / f"data/{name}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        table(numbers).to_parquet(path)
    return folder


@pytest.mark.parametrize("kind", ["csv", "parquet", "folder"])
def test_each_recording_is_that_of_its_episode_alone(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"a.{kind}"
    if kind == "folder":
        data_set(path)
    else:
        table().to_csv(path) if kind == "csv" else table().to_parquet(path)
    said: list[str] = []
    report = teleop_exchange.import_episodes(path, tmp_path / "out", say=said.append)
    assert (tuple(report.made), report.kept, dict(report.refused)) == (NUMBERS, (), {})
    assert [line.partition(":")[0] for line in said] == [
        f"episode_{number:06d} ({i + 1} of 3)" for i, number in enumerate(NUMBERS)
    ]
    for number, rows in zip(NUMBERS, ROWS, strict=True):
        table((number,)).to_csv(tmp_path / f"{number}.csv")
        alone = teleop_exchange.import_recording(tmp_path / f"{number}.csv", tmp_path / str(number), episode=number)
        one, other = (r.recording["master/measured_cp"] for r in (report.made[number], alone))
        assert len(one.stamp_ns) == rows
        np.testing.assert_array_equal(one.stamp_ns, other.stamp_ns)
        np.testing.assert_array_equal(one.values, other.values)


@pytest.mark.parametrize(
    "name", ["chunk-000/._file-000.parquet", ".ipynb_checkpoints/file-000.parquet", ".x/y/a.parquet"]
)
def test_files_that_a_system_hides_do_not_belong_to_a_data_set(name: str, tmp_path: Path) -> None:
    hidden = data_set(tmp_path / ".cache/set") / "data" / name  # the set itself may be in a hidden folder
    hidden.parent.mkdir(parents=True, exist_ok=True)
    hidden.write_bytes(b"\x00\x05\x16\x07 attributes of a file")
    report = teleop_exchange.import_episodes(tmp_path / ".cache/set", tmp_path / "out")
    assert (tuple(report.made), dict(report.refused)) == (NUMBERS, {})


def test_pictures_beside_the_wanted_numbers_are_not_even_read(tmp_path: Path) -> None:
    count, path = sum(ROWS), tmp_path / "a.parquet"
    rng, states = np.random.default_rng(1), table()
    picture = pa.StructArray.from_arrays(
        [pa.array([rng.bytes(5000) for _ in range(count)]), pa.array(["a.png"] * count)], ["bytes", "path"]
    )
    pixels = pa.array([list(rng.bytes(20)) for _ in range(count)], pa.list_(pa.uint8()))
    place = pa.FixedSizeListArray.from_arrays(pa.array(states[["x", "y", "z"]].to_numpy().ravel()), 3)
    columns = {"observation.state": place, "observation.images.top": picture, "observation.pixels": pixels}
    whole = pa.table({**columns, "t": states["t"], "episode": states["episode"]})
    pq.write_table(whole, path, compression="none", use_dictionary=False)
    data = bytearray(path.read_bytes())
    group = pq.ParquetFile(path).metadata.row_group(0)
    for column in map(group.column, range(group.num_columns)):
        if column.path_in_schema.endswith(".bytes") or "pixels" in column.path_in_schema:
            begin = column.data_page_offset
            data[begin : begin + column.total_compressed_size] = b"\xff" * column.total_compressed_size
    path.write_bytes(data)
    names = [f"observation.state.{i}" for i in range(3)]
    report = teleop_exchange.import_episodes(path, tmp_path / "out", position=names)
    assert (tuple(report.made), dict(report.refused)) == (NUMBERS, {})
    places = report.made[5].recording["master/measured_cp"][["x", "y", "z"]]
    np.testing.assert_array_equal(places, table((5,))[["x", "y", "z"]])
    assert any("observation.images.top.bytes" in text for text in report.made[5].told)
    with pytest.raises(tc.RecordingError, match=r"observation\.pixels holds no numbers"):
        teleop_exchange.import_recording(path, tmp_path / "x", episode=5, position=[*names[:2], "observation.pixels"])


def test_an_import_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    path, out = data_set(tmp_path / "set"), tmp_path / "out"
    teleop_exchange.import_episodes(path, out)
    whole = {file: file.read_bytes() for file in out.rglob("*.*") if file.is_file()}
    shutil.rmtree(out / "episode_000000")
    (out / "episode_000001/metadata.yaml").unlink()  # as a kill leaves it
    report = teleop_exchange.import_episodes(path, out)
    assert (tuple(report.made), report.kept) == ((0, 1), (5,))
    assert {file: file.read_bytes() for file in out.rglob("*.*") if file.is_file()} == whole


def test_a_recording_that_was_made_otherwise_is_not_taken_for_the_same(tmp_path: Path) -> None:
    path, out = data_set(tmp_path / "set"), tmp_path / "out"
    teleop_exchange.import_episodes(path, out)
    report = teleop_exchange.import_episodes(path, out, scale=2.0)
    assert (tuple(report.refused), report.kept, dict(report.made)) == (NUMBERS, (), {})
    assert "choose another --out" in report.refused[5]
    (out / "episode_000001/metadata.yaml").unlink()
    (out / "episode_000001/notes.txt").write_text("mine")
    teleop_exchange.import_episodes(path, out)
    assert (out / "episode_000001/notes.txt").read_text() == "mine"


def test_an_episode_that_cannot_be_imported_does_not_keep_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = table()
    broken.loc[broken["episode"] == 1, "x"] = np.nan
    broken.to_parquet(tmp_path / "a.parquet")
    words = ["import", str(tmp_path / "a.parquet"), "--out", str(tmp_path / "out")]
    assert main([*words, "--episode", "all"]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert [": refused: " in line for line in lines] == [False, True, False, False]
    assert lines[-1].endswith("2 episodes imported, 0 kept, 1 refused")
    assert sorted(one.name for one in (tmp_path / "out").iterdir()) == ["episode_000000", "episode_000005"]


def test_what_is_wrong_for_all_episodes_is_said_once(tmp_path: Path) -> None:
    path = data_set(tmp_path / "set")
    with pytest.raises(tc.UnknownNameError, match="import option"):
        teleop_exchange.import_episodes(path, tmp_path / "out", sclae=2.0)
    with pytest.raises(tc.ParameterError, match="`import_episodes` imports all"):
        teleop_exchange.import_recording(path, tmp_path / "out", episode="all")
    table().drop(columns="episode").to_csv(tmp_path / "one.csv")
    with pytest.raises(tc.ParameterError, match=r"--episode is 'all'.*episode_index"):
        teleop_exchange.import_episodes(tmp_path / "one.csv", tmp_path / "out")
    table((1,)).to_parquet(path / "data/again.parquet")
    with pytest.raises(tc.RecordingError, match=r"contains episode 1 twice, in .* and "):
        teleop_exchange.import_episodes(path, tmp_path / "out")
    for missing, reason in (("no", "does not exist"), ("out", "data/")):
        (tmp_path / "out").mkdir(exist_ok=True)
        with pytest.raises(tc.RecordingError, match=reason):
            teleop_exchange.import_episodes(tmp_path / missing, tmp_path / "other")
    assert main(["import", str(path), "--out", str(tmp_path / "x"), "--episode", "both"]) == 2
