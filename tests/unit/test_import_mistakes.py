"""Files and options that cannot be imported: one clear line each, and nothing is left behind."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import teleop_core as tc
import teleop_exchange
from teleop_core.kernels.geometry import Array
from teleop_exchange import ImportOptions

COUNT = 200
T = np.arange(COUNT) * 0.01
GOOD = pd.DataFrame({"t": T, "x": 0.01 * np.sin(T), "y": 0.01 * np.cos(T), "z": 0.0 * T})
QUATERNION = pd.DataFrame({"qw": np.cos(T), "qx": np.sin(T), "qy": 0.0 * T, "qz": 0.0 * T})
ROTATION = pd.DataFrame(np.tile(np.eye(3).reshape(-1), (COUNT, 1)),
                        columns=[f"r{i}{j}" for i in "123" for j in "123"])  # fmt: skip


def refusal(path: Path, tmp_path: Path, **options: Any) -> str:
    """Text of the error, after which there must be nothing at the place of the recording."""
    out = tmp_path / "out"
    before = set(tmp_path.iterdir())
    with pytest.raises(tc.TeleopError) as error:
        teleop_exchange.import_recording(path, out, **options)
    assert set(tmp_path.iterdir()) == before
    text = str(error.value)
    assert "\n" not in text
    return text


def written(tmp_path: Path, table: pd.DataFrame) -> Path:
    table.to_csv(tmp_path / "hand.csv", index=False)
    return tmp_path / "hand.csv"


def test_missing_file_is_told(tmp_path: Path) -> None:
    assert "no.csv: does not exist" in refusal(tmp_path / "no.csv", tmp_path)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"", "is empty"),
        (b"\n \n", "is empty"),
        (b"t,x,y,z\n", "holds no rows of numbers"),
        (b"t,x,y,z\n0,1,2,3\n", "a motion needs two"),
        (b"a,b\nc,d\ne,f\n", "holds text, not numbers"),
        (bytes(range(256)), "is no text"),
        (b"\x1f\x8b broken", "cannot be read"),
        (b"PAR1 broken", "no sound Parquet file"),
    ],
)
def test_what_is_no_table_is_refused(content: bytes, text: str, tmp_path: Path) -> None:
    (tmp_path / "hand.csv").write_bytes(content)
    assert text in refusal(tmp_path / "hand.csv", tmp_path)


def test_a_column_that_is_not_there_is_told_with_those_that_are(tmp_path: Path) -> None:
    text = refusal(written(tmp_path, GOOD), tmp_path, position=("x", "y", "depth"))
    assert "--position" in text
    assert "'depth'" in text
    assert "t, x, y, z" in text


def test_a_number_beyond_the_columns_is_told(tmp_path: Path) -> None:
    GOOD.to_csv(tmp_path / "hand.csv", index=False, header=False)
    text = refusal(tmp_path / "hand.csv", tmp_path, position=(2, 3, 5), time=1)
    assert "'5'" in text
    assert "1 to 4" in text


def test_without_a_time_a_rate_is_asked_for(tmp_path: Path) -> None:
    text = refusal(written(tmp_path, GOOD[["x", "y", "z"]]), tmp_path)
    assert "--rate" in text
    assert "x, y, z" in text


def test_without_a_place_columns_are_asked_for(tmp_path: Path) -> None:
    table = GOOD.rename(columns={"x": "a", "y": "b", "z": "c"})
    text = refusal(written(tmp_path, table), tmp_path)
    assert "--position" in text
    assert "t, a, b, c" in text


@pytest.mark.parametrize(
    ("column", "values", "text"),
    [
        ("y", np.nan, "column y holds no numbers"),
        ("t", 5.0, "the time is 5 in every row"),
        ("t", np.nan, "the column of the time holds no numbers"),
        ("t", np.arange(COUNT) // 3 * 0.01, "stands still in 66.5 % of the rows"),
        ("t", np.where(np.arange(COUNT) < 100, T, T - 0.5), "goes back in 49 rows (24.5 %)"),
    ],
)
def test_columns_that_say_nothing_are_refused(column: str, values: float | Array, text: str, tmp_path: Path) -> None:
    assert text in refusal(written(tmp_path, GOOD.assign(**{column: values})), tmp_path)


def test_a_single_step_back_is_refused_on_request(tmp_path: Path) -> None:
    table = GOOD.copy()
    table.loc[100, "t"] = 0.5
    text = refusal(written(tmp_path, table), tmp_path, backwards="refuse")
    assert "goes back in 1 rows" in text
    assert "--backwards" in text


def test_text_among_numbers_is_told_with_its_column(tmp_path: Path) -> None:
    table = GOOD.astype(object)
    table.loc[150, "y"] = "lost"
    text = refusal(written(tmp_path, table), tmp_path)
    assert "'y'" in text
    assert "'lost'" in text


@pytest.mark.parametrize("scale", [0.0, 0.5, 2.0])
def test_quaternions_of_another_length_are_refused(scale: float, tmp_path: Path) -> None:
    table = pd.concat((GOOD, scale * QUATERNION), axis=1)
    text = refusal(written(tmp_path, table), tmp_path)
    assert "no orientation" in text if scale == 0.0 else "unit length" in text


def test_columns_that_are_no_quaternion_are_refused_with_a_hint(tmp_path: Path) -> None:
    table = pd.concat((GOOD, QUATERNION), axis=1)
    options = {"quaternion": ("t", "qx", "qy", "qz")}
    text = refusal(written(tmp_path, table), tmp_path, **options)
    assert "order" in text


def test_a_named_order_that_the_option_contradicts_is_refused(tmp_path: Path) -> None:
    table = pd.concat((GOOD, QUATERNION), axis=1)
    options: dict[str, Any] = {"quaternion": ("qx", "qy", "qz", "qw"), "quaternion_order": "wxyz"}
    assert "must be xyzw" in refusal(written(tmp_path, table), tmp_path, **options)


def test_a_mirror_is_no_rotation(tmp_path: Path) -> None:
    table = pd.concat((GOOD, ROTATION.assign(r33=-1.0)), axis=1)
    text = refusal(written(tmp_path, table), tmp_path)
    assert "mirror" in text


def test_an_existing_directory_is_never_touched(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "precious").write_text("1")
    with pytest.raises(tc.RecordingError, match="exists already"):
        teleop_exchange.import_recording(written(tmp_path, GOOD), out)
    assert (out / "precious").read_text() == "1"


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"axes": ("+x", "+y", "-z")}, "mirror"),
        ({"axes": ("+x", "+x", "+z")}, "mirror"),
        ({"axes": ("x", "up", "z")}, "--axes"),
        ({"unit": "km"}, "one of: m, auto, cm, mm, in"),
        ({"time_unit": "h"}, "one of: auto, s, ms, us, ns"),
        ({"center": "top"}, "keep"),
        ({"scale": 0.0}, "--scale"),
        ({"scale": math.nan}, "--scale"),
        ({"rate": -1.0}, "--rate"),
        ({"rate": 100.0, "time": "t"}, "--rate"),
        ({"position": ("x", "y")}, "3 columns"),
        ({"quaternion": ("x", "y", "z")}, "4 columns"),
        ({"euler": ("xxz", "a", "b", "c")}, "xyz or ZYX"),
        ({"euler": ("xYz", "a", "b", "c")}, "xyz or ZYX"),
        ({"matrix": "1-9", "euler": ("xyz", "a", "b", "c")}, "only one"),
        ({"buttons": "clutch"}, "clutch=0,mode=2"),
        ({"colour": "red"}, "colour"),
        ({"skip": -1}, "--skip"),
        ({"topic": "/pose"}, "columns"),
    ],
)
def test_options_that_mean_nothing_are_refused(
    options: Mapping[str, str | float | tuple[str, ...]], text: str, tmp_path: Path
) -> None:
    assert text in refusal(written(tmp_path, GOOD), tmp_path, **options)


@pytest.mark.parametrize(
    ("columns", "options", "text"),
    [
        (["t", "x (mm)", "y (mm)", "z (mm)"], {"unit": "m"}, "--unit is 'm', must be mm"),
        (["t_ms", "x", "y", "z"], {"time_unit": "s"}, "--time-unit is 's', must be ms"),
        (["t", "x", "y", "z", "roll [deg]", "pitch [deg]", "yaw [deg]"], {"angles": "rad"},
         "--angles is 'rad', must be deg"),
    ],
)  # fmt: skip
def test_a_unit_that_the_names_contradict_is_refused(
    columns: list[str], options: Mapping[str, str], text: str, tmp_path: Path
) -> None:
    table = GOOD.assign(**dict.fromkeys(columns[4:], 0.0))
    table.columns = pd.Index(columns)
    assert text in refusal(written(tmp_path, table), tmp_path, **options)


@pytest.mark.parametrize("column", ["t", "x"])
def test_numbers_that_nothing_physical_has_are_refused(column: str, tmp_path: Path) -> None:
    table = GOOD.copy()
    table[column] += 1.7e12
    text = refusal(written(tmp_path, table), tmp_path, unit="m", time_unit="s")
    assert ("--time-unit" if column == "t" else "between -1e+07 and 1e+07 m") in text


def test_columns_that_are_left_unused_are_told(tmp_path: Path) -> None:
    table = GOOD.assign(PedalDown=0, grip=0.5)
    report = teleop_exchange.import_recording(written(tmp_path, table), tmp_path / "out")
    assert "left unused: 'PedalDown', 'grip'" in report.told


def test_who_scores_a_table_is_told_to_import_it(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    with pytest.raises(tc.RecordingError, match=rf"`teleop import {re.escape(str(path))} --out"):
        tc.open_recording(path)


def test_options_say_what_they_are_on_the_command_line() -> None:
    options = ImportOptions(position="2-4", unit="mm", euler=("xyz", "a", "b", "c"), rate=30.0)  # type: ignore[arg-type]
    assert options.as_arguments() == [
        "--rate", "30.0", "--position", "2", "3", "4", "--unit", "mm", "--euler", "xyz", "a", "b",
        "c",
    ]  # fmt: skip
