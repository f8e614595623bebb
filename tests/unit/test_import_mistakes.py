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


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (None, "hand.csv: does not exist"),
        (b"", "is empty"),
        (b"\n \n", "is empty"),
        (b"t,x,y,z\n", "contains no rows of numbers"),
        (b"t,x,y,z\n0,1,2,3\n", "a motion needs two"),
        (b"a,b\nc,d\ne,f\n", "contains text, not numbers"),
        (bytes(range(256)), "is no text"),
        (b"\x1f\x8b broken", "cannot be read"),
        (b"PAR1 broken", "no sound Parquet file"),
    ],
)
def test_what_is_no_table_is_refused(content: bytes | None, text: str, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "hand.csv").write_bytes(content)
    assert text in refusal(tmp_path / "hand.csv", tmp_path)


BESIDE = pd.concat((GOOD, QUATERNION), axis=1)
BACK, LOST = GOOD.copy(), GOOD.astype(object)
BACK.loc[100, "t"], LOST.loc[150, "y"] = 0.5, "lost"
MISTAKEN: dict[str, tuple[pd.DataFrame, dict[str, Any], tuple[str, ...]]] = {
    "a column that is not there": (GOOD, {"position": ("x", "y", "depth")}, ("--position", "'depth'", "t, x, y, z")),
    "no time": (GOOD[["x", "y", "z"]], {}, ("--rate", "x, y, z")),
    "no place": (GOOD.rename(columns={"x": "a", "y": "b", "z": "c"}), {}, ("--position", "t, a, b, c")),
    "a step back": (BACK, {"backwards": "refuse"}, ("goes back in 1 rows", "--backwards")),
    "text among numbers": (LOST, {}, ("'y'", "'lost'")),
    "no quaternion": (BESIDE, {"quaternion": ("t", "qx", "qy", "qz")}, ("order",)),
    "names of another order": (
        BESIDE,
        {"quaternion": ("qx", "qy", "qz", "qw"), "quaternion_order": "wxyz"},
        ("must be xyzw",),
    ),
    "a mirror": (pd.concat((GOOD, ROTATION.assign(r33=-1.0)), axis=1), {}, ("mirror",)),
    **{
        f"a quaternion of length {scale}": (pd.concat((GOOD, scale * QUATERNION), axis=1), {}, (told,))
        for scale, told in ((0.0, "no orientation"), (0.5, "unit length"), (2.0, "unit length"))
    },
}


@pytest.mark.parametrize("case", MISTAKEN)
def test_a_table_that_holds_no_motion_is_refused_with_what_it_lacks(case: str, tmp_path: Path) -> None:
    table, options, told = MISTAKEN[case]
    text = refusal(written(tmp_path, table), tmp_path, **options)
    assert all(word in text for word in told), text


def test_a_number_beyond_the_columns_is_told(tmp_path: Path) -> None:
    GOOD.to_csv(tmp_path / "hand.csv", index=False, header=False)
    text = refusal(tmp_path / "hand.csv", tmp_path, position=(2, 3, 5), time=1)
    assert "'5'" in text
    assert "1 to 4" in text


@pytest.mark.parametrize(
    ("column", "values", "text"),
    [
        ("y", np.nan, "column y holds no numbers"),
        ("t", 5.0, "the time is 5 in every row"),
        ("t", np.nan, "the column of the time contains no numbers"),
        ("t", np.arange(COUNT) // 3 * 0.01, "does not change in 66.5 % of the rows"),
        ("t", np.where(np.arange(COUNT) < 100, T, T - 0.5), "goes back in 49 rows (24.5 %)"),
    ],
)
def test_columns_that_say_nothing_are_refused(column: str, values: float | Array, text: str, tmp_path: Path) -> None:
    assert text in refusal(written(tmp_path, GOOD.assign(**{column: values})), tmp_path)


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
        ({"matrix": "1-9", "euler": ("xyz", "a", "b", "c")}, "only option"),
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
