"""Importing tables: whatever the form of the file, the same motion comes out."""

import bz2
import gzip
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import teleop_core as tc
import teleop_exchange
from teleop_core.kernels.geometry import Array
from teleop_exchange import names
from teleop_exchange.times import ordered

COUNT, RATE = 400, 100.0
TIMES = np.arange(COUNT) / RATE
PLACES = np.column_stack((0.03 * np.sin(2.0 * TIMES), 0.02 * np.cos(3.0 * TIMES), 0.1 + 0.01 * TIMES))
TURNS = Rotation.from_rotvec(np.column_stack((0.5 * np.sin(TIMES), 0.4 * np.cos(2.0 * TIMES), 0.6 * TIMES)))
WXYZ = TURNS.as_quat(scalar_first=True)
HEAD = ["t", "x", "y", "z", "qw", "qx", "qy", "qz"]
TABLE = np.column_stack((TIMES, PLACES, WXYZ))
RADIANS = 1e-7
"""Rounding of an angle between two rotations: the square root of that of a cosine."""


def frame(columns: list[str] = HEAD, rows: Array = TABLE) -> Any:
    return pd.DataFrame(rows, columns=columns)


def imported(path: Path, tmp_path: Path, **options: Any) -> Any:
    """Report and stream of an import."""
    out = tmp_path / f"out_{len(list(tmp_path.iterdir()))}"
    report = teleop_exchange.import_recording(path, out, **options)
    return report, report.recording["master/measured_cp"]


def brought(tmp_path: Path, table: pd.DataFrame | None = None, **options: Any) -> Any:
    """Report and stream of a table that was written as text."""
    (frame() if table is None else table).to_csv(tmp_path / "a.csv", index=False)
    return imported(tmp_path / "a.csv", tmp_path, **options)


def assert_same_motion(
    stream: tc.Stream, places: Array = PLACES, turns: Rotation = TURNS, times: Array = TIMES, metres: float = 1e-15
) -> None:
    assert np.allclose(stream[["x", "y", "z"]], places, rtol=0, atol=metres)
    got = Rotation.from_quat(stream[["qw", "qx", "qy", "qz"]], scalar_first=True)
    assert (turns.inv() * got).magnitude().max() < RADIANS
    assert np.abs((stream.stamp_ns - stream.stamp_ns[0]) * 1e-9 - (times - times[0])).max() < 1e-9


FORMS: dict[str, dict[str, Any]] = {
    "comma.csv": {"sep": ","},
    "semicolon.csv": {"sep": ";"},
    "decimal_comma.csv": {"sep": ";", "decimal": ","},
    "tab.tsv": {"sep": "\t"},
    "blank.txt": {"sep": " "},
    "bar.dat": {"sep": "|"},
    "quoted.csv": {"quoting": 2},
    "windows.csv": {"lineterminator": "\r\n"},
    "marked.csv": {"encoding": "utf-8-sig"},
    "wide.csv": {"encoding": "utf-16"},
    "wide_little.csv": {"encoding": "utf-16-le", "lineterminator": "\r\n"},
    "wide_big.csv": {"encoding": "utf-16-be"},
    "wide_blank.txt": {"encoding": "utf-16", "sep": " "},
    "wide_tab.tsv": {"encoding": "utf-16", "sep": "\t", "decimal": ","},
    "wider.csv": {"encoding": "utf-32"},
}


@pytest.mark.parametrize("name", FORMS)
def test_every_form_of_text_gives_the_same_motion(name: str, tmp_path: Path) -> None:
    frame().to_csv(tmp_path / name, index=False, **FORMS[name])
    report, stream = imported(tmp_path / name, tmp_path)
    assert_same_motion(stream)
    assert report.counts.samples == report.counts.rows == COUNT


@pytest.mark.parametrize(("name", "pack"), [("a.csv.gz", gzip.compress), ("a.bz2", bz2.compress)])
def test_packed_text_is_read_by_what_it_is_not_how_it_is_called(
    name: str, pack: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(pack(frame().to_csv(index=False).encode()))
    assert_same_motion(imported(tmp_path / name, tmp_path)[1])
    (tmp_path / name).rename(tmp_path / "plain")
    assert_same_motion(imported(tmp_path / "plain", tmp_path)[1])


def test_parquet_gives_the_same_motion_in_any_groups_of_rows(tmp_path: Path) -> None:
    frame().to_parquet(tmp_path / "a.parquet", row_group_size=77)
    assert_same_motion(imported(tmp_path / "a.parquet", tmp_path)[1], metres=0.0)


def test_lists_in_parquet_are_columns_with_numbers(tmp_path: Path) -> None:
    table = pd.DataFrame({"time": TIMES, "pose": list(TABLE[:, 1:])})
    table.to_parquet(tmp_path / "lists.parquet")
    places = [f"pose.{i}" for i in range(7)]
    options = {"position": places[:3], "quaternion": places[3:]}
    assert_same_motion(imported(tmp_path / "lists.parquet", tmp_path, **options)[1])


@pytest.mark.parametrize("sep", [",", " ", "\t"])
def test_without_a_head_columns_go_by_number_from_one(sep: str, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(size=(COUNT, 3))
    pd.DataFrame(np.hstack((noise, TABLE))).to_csv(tmp_path / "bare.txt", sep=sep, header=False, index=False)
    options: dict[str, Any] = {"time": 4, "position": "5-7", "quaternion": ("8", "9", 10, "11")}
    assert_same_motion(imported(tmp_path / "bare.txt", tmp_path, **options)[1])


def test_eight_columns_without_a_head_are_time_place_and_quaternion_with_w_last(tmp_path: Path) -> None:
    rows = np.column_stack((TIMES, PLACES, TURNS.as_quat()))
    np.savetxt(tmp_path / "trajectory.txt", rows, fmt="%.17g")
    report, stream = imported(tmp_path / "trajectory.txt", tmp_path)
    assert_same_motion(stream)
    assert any("xyzw" in text for text in report.told)


def test_rows_of_many_blanks_with_a_rate_and_a_matrix_are_read(tmp_path: Path) -> None:
    # 76 columns without a head at 30 Hz, as of a surgical robot.
    rows = np.random.default_rng(2).normal(size=(COUNT, 76))
    rows[:, 38:41], rows[:, 41:50] = PLACES, TURNS.as_matrix().reshape(-1, 9)
    np.savetxt(tmp_path / "kinematics.txt", rows, fmt="  %16.12f")
    options: dict[str, Any] = {"rate": 30.0, "position": "39-41", "matrix": "42-50"}
    report, stream = imported(tmp_path / "kinematics.txt", tmp_path, **options)
    assert_same_motion(stream, times=np.arange(COUNT) / 30.0, metres=1e-12)
    assert report.rate == pytest.approx(30.0, abs=1e-6)


def test_comments_and_a_line_of_units_stand_before_the_numbers(tmp_path: Path) -> None:
    text = "# recorded by hand\n# x is to the right\n\nt,x,y,z\n(s),(mm),(mm),(mm)\n"
    rows = np.column_stack((TIMES, 1e3 * PLACES))
    (tmp_path / "a.csv").write_text(text + "\n".join(",".join(map(repr, r)) for r in rows.tolist()))
    report, stream = imported(tmp_path / "a.csv", tmp_path)
    assert np.allclose(stream[["x", "y", "z"]], PLACES, rtol=0, atol=1e-12)
    assert any("mm" in text for text in report.told)


def test_a_comment_may_hold_the_names_and_lines_can_be_skipped(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "a.txt", TABLE, fmt="%.17g", header=" ".join(HEAD))
    assert_same_motion(imported(tmp_path / "a.txt", tmp_path)[1])
    (tmp_path / "a.csv").write_text("Motion capture 3.1\n1,2\n" + frame().to_csv(index=False))
    assert_same_motion(imported(tmp_path / "a.csv", tmp_path, skip=2)[1])


# Orientation, against SciPy.


def turned(
    path: Path, tmp_path: Path, columns: list[str], values: Array, **options: str | Sequence[str]
) -> tuple[teleop_exchange.ImportReport, tc.Stream]:
    rows = np.column_stack((TIMES, PLACES, values))
    frame(["t", "x", "y", "z", *columns], rows).to_csv(path, index=False)
    return imported(path, tmp_path, **options)


NINE, FOUR = [f"m{i}" for i in range(9)], ["a", "b", "c", "d"]
MATRICES = TURNS.as_matrix()
ANGLES = {"rad": False, "deg": True}
ORIENTATIONS: dict[str, tuple[list[str], Array, dict[str, Any]]] = {
    "rows": (NINE, MATRICES.reshape(-1, 9), {"matrix": NINE, "matrix_order": "row"}),
    "columns": (NINE, MATRICES.transpose(0, 2, 1).reshape(-1, 9), {"matrix": NINE, "matrix_order": "column"}),
    "wxyz": (FOUR, WXYZ, {"quaternion": FOUR, "quaternion_order": "wxyz"}),
    "xyzw": (FOUR, TURNS.as_quat(), {"quaternion": FOUR, "quaternion_order": "xyzw"}),
    "names": (["qx", "qy", "qz", "qw"], TURNS.as_quat(), {"quaternion": ["qx", "qy", "qz", "qw"]}),
    **{
        f"{order} {unit}": (
            FOUR[:3],
            TURNS.as_euler(order, degrees=is_deg),
            {"euler": (order, *FOUR[:3]), "angles": unit},
        )
        for order in ("xyz", "ZYX", "zxz", "YXZ")
        for unit, is_deg in ANGLES.items()
    },
    **{
        f"vector {unit}": (FOUR[:3], TURNS.as_rotvec(degrees=is_deg), {"rotation_vector": FOUR[:3], "angles": unit})
        for unit, is_deg in ANGLES.items()
    },
}


@pytest.mark.parametrize("case", ORIENTATIONS)
def test_orientations_mean_what_they_do_in_scipy(case: str, tmp_path: Path) -> None:
    columns, values, options = ORIENTATIONS[case]
    assert_same_motion(turned(tmp_path / "a.csv", tmp_path, columns, values, **options)[1])


def test_quaternions_of_any_sign_and_nearly_unit_length_give_a_continuous_one(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    values = WXYZ * rng.choice([-1.0, 1.0], COUNT)[:, None] * rng.uniform(0.95, 1.05, COUNT)[:, None]
    _, stream = turned(tmp_path / "a.csv", tmp_path, HEAD[4:], values)
    assert_same_motion(stream)
    got = stream[HEAD[4:]]
    assert (np.sum(got[1:] * got[:-1], axis=1) > 0.9).all()
    assert np.allclose(np.linalg.norm(got, axis=1), 1.0, rtol=0, atol=1e-15)


@pytest.mark.parametrize(("count", "options"), [(4, {}), (8, {"orientation": "none"})])
def test_without_an_orientation_it_is_constant(count: int, options: dict[str, str], tmp_path: Path) -> None:
    report, stream = brought(tmp_path, frame(HEAD[:count], TABLE[:, :count]), **options)
    assert np.array_equal(stream[HEAD[4:]], np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1)))
    assert options or any("constant" in text for text in report.told)


# Times.


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
@pytest.mark.parametrize("start", [0.0, 1_700_000_000.0])
def test_unit_of_the_time_is_guessed_from_its_size_or_its_steps(
    unit: str, factor: float, start: float, tmp_path: Path
) -> None:
    rows = TABLE.copy()
    stamps = np.round((start + TIMES) * 1e6).astype(np.int64)  # [us]
    whole = pd.DataFrame(rows, columns=HEAD)
    exact = unit in {"us", "ns"}
    whole["t"] = stamps * (1000 if unit == "ns" else 1) if exact else stamps / (1e6 / factor)
    report, stream = brought(tmp_path, whole)
    assert any(f"times in {unit}" in text for text in report.told)
    first = 1_000_000_000 if start == 0.0 else round(start * 1e9)
    # A float of seconds since 1970 has steps of 0.24 µs.
    assert np.abs(stream.stamp_ns - (first + np.round(TIMES * 1e9))).max() <= (0 if exact else 300)


def test_given_unit_of_the_time_is_taken_and_without_buttons_none_are_recorded(tmp_path: Path) -> None:
    report, _ = brought(tmp_path, time_unit="ms")
    assert report.recording.topics == ("master/measured_cp",)
    assert report.duration == pytest.approx(TIMES[-1] * 1e-3, abs=1e-9)


def test_seconds_and_nanoseconds_may_stand_in_two_columns(tmp_path: Path) -> None:
    stamps = 1_700_000_000_999_000_000 + np.arange(COUNT) * 10_000_000
    table = frame().drop(columns="t")
    table["stamp.sec"], table["stamp.nanosec"] = np.divmod(stamps, 1_000_000_000)
    assert np.array_equal(brought(tmp_path, table)[1].stamp_ns, stamps)


def test_dates_are_times(tmp_path: Path) -> None:
    table = frame()
    table["t"] = stamps = pd.date_range("2026-01-02T03:04:05.678", periods=COUNT, freq="10ms")
    table.to_parquet(tmp_path / "a.parquet")
    for _, stream in (brought(tmp_path, table), imported(tmp_path / "a.parquet", tmp_path)):
        assert np.array_equal(stream.stamp_ns, stamps.as_unit("ns").astype("int64"))


@pytest.mark.parametrize(("start", "first"), [(-5.0, 1.0), (0.0, 1.0), (3.25, 3.25)])
def test_stamps_that_begin_near_zero_begin_at_a_second_and_others_stay(
    start: float, first: float, tmp_path: Path
) -> None:
    report, _ = brought(tmp_path, frame(rows=TABLE + start * np.eye(8)[0]))
    assert report.start_ns == round(first * 1e9)


def test_irregular_times_stay_as_they_are(tmp_path: Path) -> None:
    rows = TABLE.copy()
    rows[:, 0] = 10.0 + np.cumsum(np.random.default_rng(4).exponential(0.01, COUNT))
    report, stream = brought(tmp_path, frame(rows=rows))
    assert np.abs(stream.stamp_ns - rows[:, 0] * 1e9).max() < 2.0
    steps = np.diff(rows[:, 0])
    assert report.period_ms == pytest.approx(1e3 * np.percentile(steps, (50, 5, 95)), abs=1e-5)


# Places.


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("cm", 0.01), ("mm", 1e-3), ("in", 0.0254)])
def test_unit_of_the_place_is_given_or_stands_in_the_names(unit: str, metres: float, tmp_path: Path) -> None:
    rows = np.column_stack((TIMES, PLACES / metres))
    named = ["t", *(f"{a} [{unit}]" for a in "xyz")]
    for _, stream in (brought(tmp_path, frame(HEAD[:4], rows), unit=unit), brought(tmp_path, frame(named, rows))):
        assert np.allclose(stream[["x", "y", "z"]], PLACES, rtol=0, atol=1e-15)


def test_axes_turn_places_and_attitudes_alike(tmp_path: Path) -> None:
    _, stream = brought(tmp_path, axes=("+y", "-x", "+z"), scale=0.5)
    turn = Rotation.from_matrix([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert_same_motion(stream, 0.5 * turn.apply(PLACES), turn * TURNS)


@pytest.mark.parametrize("center", ["mean", "middle", "start"])
def test_the_chosen_middle_comes_to_zero(center: str, tmp_path: Path) -> None:
    _, stream = brought(tmp_path, center=center, scale=2.0)
    got = stream[["x", "y", "z"]]
    middle = {"mean": got.mean(axis=0), "start": got[0], "middle": got.min(axis=0) + got.max(axis=0)}[center]
    assert np.abs(middle).max() < 1e-15
    assert np.allclose(np.diff(got, axis=0), 2.0 * np.diff(PLACES, axis=0), rtol=0, atol=1e-15)


def test_buttons_are_recorded_where_they_change(tmp_path: Path) -> None:
    table = frame()
    table["pedal"] = np.where((TIMES > 1.0) & (TIMES < 2.0), 3.3, 0.2)
    table["mode"] = (TIMES > 3.0).astype(int)
    report, stream = brought(tmp_path, table, clutch="pedal", threshold=1.5)
    buttons = report.recording["master/buttons"]
    held = np.searchsorted(buttons.stamp_ns, stream.stamp_ns, side="right") - 1
    assert np.array_equal(buttons["clutch"][held], table["pedal"] > 1.5)
    assert np.array_equal(buttons["mode"][held], table["mode"])
    assert not buttons["fixture"].any()
    assert len(buttons) == 4


# Rows that are damaged.


def test_missing_rows_are_dropped_and_make_a_gap(tmp_path: Path) -> None:
    rows = TABLE.copy()
    rows[100:120, 2] = np.nan
    rows[200, 5] = np.inf
    report, stream = brought(tmp_path, frame(rows=rows))
    kept = np.isfinite(rows).all(axis=1)
    assert report.counts.missing == 21
    assert_same_motion(stream, PLACES[kept], TURNS[kept], TIMES[kept])
    assert report.gaps == ((pytest.approx(0.99), pytest.approx(0.21)),)


def test_holes_of_a_file_are_not_messages_that_are_missing_in_its_session(tmp_path: Path) -> None:
    report, _ = brought(tmp_path, frame(rows=np.delete(TABLE, slice(100, 171), axis=0)))
    session = tc.replay(report.recording)
    for recording in (session, tc.replay(session)):
        assert {topic.gaps for topic in recording.score().topics.values()} <= {0, None}


def test_doubled_times_keep_the_first_row(tmp_path: Path) -> None:
    rows = np.repeat(TABLE, 2, axis=0)[: 2 * COUNT - 30]
    rows[1::2, 1] += 1.0
    report, stream = brought(tmp_path, frame(rows=rows[: COUNT // 2 * 2]))
    assert report.counts.doubled == COUNT // 2
    assert np.allclose(stream["x"], PLACES[: COUNT // 2, 0], rtol=0, atol=1e-15)
    assert any("doubled" in text for text in report.warnings)


def test_a_few_rows_that_go_back_are_dropped_and_counted(tmp_path: Path) -> None:
    rows = TABLE.copy()
    rows[[50, 60, 70], 0] -= 0.105
    report, stream = brought(tmp_path, frame(rows=rows))
    kept = np.delete(np.arange(COUNT), [50, 60, 70])
    assert report.counts.backwards == 3
    assert_same_motion(stream, PLACES[kept], TURNS[kept], TIMES[kept])


def test_shuffled_rows_are_sorted_on_request(tmp_path: Path) -> None:
    order = np.random.default_rng(5).permutation(COUNT)
    assert_same_motion(brought(tmp_path, frame(rows=TABLE[order]), backwards="sort")[1])


@pytest.mark.parametrize("ahead", [3.0, 1e6, 1e12, 1e300])
def test_a_stamp_from_the_future_costs_its_own_row_alone(ahead: float, tmp_path: Path) -> None:
    rows = TABLE.copy()
    rows[123, 0] += ahead
    report, stream = brought(tmp_path, frame(rows=rows), time_unit="s")
    kept = np.delete(np.arange(COUNT), 123)
    left_out = (report.counts.backwards, report.counts.missing)
    assert left_out == ((1, 0) if ahead < 1e9 else (0, 1))
    assert_same_motion(stream, PLACES[kept], TURNS[kept], TIMES[kept])


def test_no_fewer_rows_could_be_left_out_for_the_others_to_rise() -> None:
    rng = np.random.default_rng(2)
    for _ in range(300):
        stamps = np.sort(rng.integers(0, 60, rng.integers(1, 40)))
        wrong = rng.integers(0, len(stamps), 4)
        stamps[wrong] = rng.integers(0, 60, 4)
        longest = np.ones(len(stamps), np.int64)
        for i in range(len(stamps)):
            before = longest[:i][stamps[:i] <= stamps[i]]
            longest[i] = 1 + before.max(initial=0)
        order = ordered(stamps)
        assert (np.diff(stamps[order.rows]) > 0).all()
        assert order.backwards == len(stamps) - longest.max()
        assert len(order.rows) + order.doubled == longest.max()


@pytest.mark.parametrize("policy", ["auto", "refuse", "drop", "sort"])
def test_a_time_that_begins_anew_is_never_one_motion(policy: str, tmp_path: Path) -> None:
    frame(rows=np.vstack((TABLE[:100], TABLE, TABLE[:250]))).to_csv(tmp_path / "a.csv")
    with pytest.raises(tc.RecordingError, match=r"3 recordings.* row 101, 501"):
        imported(tmp_path / "a.csv", tmp_path, backwards=policy)
    frame().to_csv(tmp_path / "a.csv")  # of which no episode can be taken
    with pytest.raises(tc.ParameterError, match="--episode"):
        imported(tmp_path / "a.csv", tmp_path, episode=1)


@pytest.mark.parametrize("name", ["episode_index", "Episode", "trial_id"])
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_of_a_table_of_episodes_one_is_taken(name: str, ending: str, tmp_path: Path) -> None:
    table = frame(rows=np.vstack((TABLE[:100], TABLE, TABLE[:250])))
    table[name] = np.repeat([0, 1, 5], [100, COUNT, 250])
    path = tmp_path / f"a.{ending}"
    table.to_csv(path) if ending == "csv" else table.to_parquet(path)
    for policy in ("auto", "drop", "sort"):
        with pytest.raises(tc.RecordingError, match=r"3 episodes.*0, 1, 5.*--episode"):
            imported(path, tmp_path, backwards=policy)
    with pytest.raises(tc.UnknownNameError, match=r"--episode is 2.*0, 1, 5"):
        imported(path, tmp_path, episode=2)
    report, stream = imported(path, tmp_path, episode=1)
    assert_same_motion(stream)
    assert "episode 1 of 3" in report.told
    assert report.counts.rows == COUNT


@pytest.mark.parametrize(("missing", "count"), [("nan", 1), ("inf", 5), ("null", 1)])
def test_a_table_may_begin_with_missing_rows(missing: str, count: int, tmp_path: Path) -> None:
    rows = TABLE.copy()
    rows[:count, 1:] = np.nan
    frame(rows=rows).to_csv(tmp_path / "a.csv", index=False, na_rep=missing)
    report, stream = imported(tmp_path / "a.csv", tmp_path)
    assert (report.counts.rows, report.counts.missing) == (COUNT, count)
    assert_same_motion(stream, PLACES[count:], TURNS[count:], TIMES[count:])


@pytest.mark.parametrize("name", ["hand.csv", "hand.txt"])
def test_a_hand_that_rests_at_whole_numbers_is_read_on(name: str, tmp_path: Path) -> None:
    count = 1300
    moved = np.maximum(0, np.arange(count) - 1000)[:, None] * [1e-4, -1e-4, 5e-5]
    cells = np.column_stack((np.arange(count) * 0.01, moved))
    sep = "," if name.endswith("csv") else " "
    lines = ["t,x,y,z".replace(",", sep), *(sep.join(f"{c:.10g}" for c in r) for r in cells)]
    (tmp_path / name).write_text("\n".join(lines))
    _, stream = imported(tmp_path / name, tmp_path)
    assert np.allclose(stream[["x", "y", "z"]], moved, rtol=0, atol=1e-15)


@pytest.mark.parametrize(("ending", "sep"), [("Z", ","), ("+02:00", " "), ("-0330", ","), ("", " ")])
def test_dates_keep_to_their_zone(ending: str, sep: str, tmp_path: Path) -> None:
    zone = pd.Timestamp(f"2025-04-17T15:00:08{ending}")
    at = pd.date_range("2025-04-17T15:00:08", periods=COUNT, freq="10ms")
    table = frame()
    table["t"] = [f"{one.isoformat(timespec='milliseconds')}{ending}" for one in at]
    table.to_csv(tmp_path / "a.csv", index=False, sep=sep)
    _, stream = imported(tmp_path / "a.csv", tmp_path)
    assert stream.stamp_ns[0] == zone.value
    assert_same_motion(stream)


DATES = {
    "slashes": "%Y/%m/%d %H:%M:%S.%f",
    "dots": "%Y.%m.%dT%H:%M:%S.%f",
    "days first between dots": "%d.%m.%Y %H:%M:%S,%f",
    "hours of a zone": "%Y-%m-%d %H:%M:%S.%f+00",
    "another zone": "%Y/%m/%d %H:%M:%S.%f-0000",
    "a named zone": "%Y-%m-%d %H:%M:%S.%f UTC",
    "decimal commas": "%Y-%m-%dT%H:%M:%S,%fZ",
    "underscores": "%Y-%m-%d_%H:%M:%S.%f",
    "usual": "%Y-%m-%d %H:%M:%S.%f",
    "names of months": "%d-%b-%Y %H:%M:%S.%f",
    "colons before the fraction": "%Y-%m-%d %H:%M:%S:%f",
    "a dash before the time": "%Y/%m/%d-%H:%M:%S.%f",
    "without signs": "%Y%m%dT%H%M%S.%fZ",
    "a day without signs": "%Y%m%d %H:%M:%S.%f",
}


@pytest.mark.parametrize("form", DATES)
@pytest.mark.parametrize("sep", [";", "\t"])
def test_dates_of_every_unambiguous_form_are_times(form: str, sep: str, tmp_path: Path) -> None:
    at = pd.date_range("2025-04-02T09:59:58.250", periods=COUNT, freq="10ms")  # beyond a full hour
    table = frame()
    table["t"] = at.strftime(DATES[form])
    table.to_csv(tmp_path / "a.csv", index=False, sep=sep)
    report, stream = imported(tmp_path / "a.csv", tmp_path)
    assert np.array_equal(stream.stamp_ns, at.as_unit("ns").astype("int64"))
    assert report.counts.samples == COUNT


def test_times_of_a_day_and_short_dates_are_times(tmp_path: Path) -> None:
    at = pd.date_range("2025-04-02T09:30:00", periods=COUNT, freq="250ms")
    table = frame()
    table["t"] = [f"{one.hour}:{one.minute:02}:{one.second:02}.{one.microsecond // 1000:03}" for one in at]
    _, stream = brought(tmp_path, table)
    assert np.array_equal(stream.stamp_ns, (at - at[0].normalize()).astype("timedelta64[ns]").astype(np.int64))
    table["t"] = [f"2025/4/2 {one.hour}:{one.minute:02}:{one.second}.{one.microsecond // 1000:03}" for one in at]
    table.loc[7, "t"] = ""
    report, stream = brought(tmp_path, table)
    assert report.counts.missing == 1
    assert abs(stream.stamp_ns[-1] - at[-1].as_unit("ns").value) < 256  # a column with holes has floats


@pytest.mark.parametrize("kind", ["text", "time of the day", "since the start"])
def test_times_of_every_type_of_parquet_are_times(kind: str, tmp_path: Path) -> None:
    at = pd.date_range("2025-04-02T09:59:58.250", periods=COUNT, freq="10ms")
    own: dict[str, Any] = {"text": at.strftime("%Y/%m/%d %H:%M:%S.%f"), "time of the day": at.time}
    frame().assign(t=own.get(kind, at - at[0])).to_parquet(tmp_path / "a.parquet")
    report, stream = imported(tmp_path / "a.parquet", tmp_path)
    assert_same_motion(stream)
    assert stream.stamp_ns[0] == {
        "text": at[0].as_unit("ns").value, "time of the day": (at[0] - at[0].normalize()).as_unit("ns").value,
    }.get(kind, 1_000_000_000)  # fmt: skip
    assert report.counts.samples == COUNT


@pytest.mark.parametrize("cell", ["04/02/2025 09:30:00", "Apr 2, 2025 9:30:00 AM", "2025-04-02"])
def test_a_date_that_may_mean_two_days_says_which_are_read(cell: str, tmp_path: Path) -> None:
    with pytest.raises(tc.RecordingError, match=r"2025-04-02T09:30:00"):
        brought(tmp_path, frame().assign(t=cell))


@pytest.mark.parametrize("empty", [["x", "y", "z"], ["qw", "qx", "qy", "qz"], ["t"]])
def test_rows_that_are_never_whole_say_what_is_missing_in_which_share(empty: list[str], tmp_path: Path) -> None:
    table = pd.concat([frame(), frame()]).sort_values("t", kind="stable").reset_index(drop=True)
    others = [name for name in HEAD[1:] if name not in empty] if empty != ["t"] else ["y"]
    table.loc[::2, empty] = np.nan
    table.loc[1::2, others] = np.nan
    with pytest.raises(tc.RecordingError, match=rf"0 usable rows of {2 * COUNT}") as error:
        brought(tmp_path, table)
    text = str(error.value)
    assert "in 50 %" in text
    assert all(name in text for name in empty)
    if empty != ["t"]:
        assert "--orientation none" in text
        assert brought(tmp_path, table, orientation="none")[0].counts.samples == COUNT


def test_our_own_export_comes_back(tmp_path: Path) -> None:
    recording = tc.run("coarse_box", duration=3.0)
    teleop_exchange.export_recording(recording, tmp_path / "bag.csv")
    topic = "master/measured_cp"
    _, stream = imported(
        tmp_path / "bag.csv",
        tmp_path,
        position=[f"{topic}.{axis}" for axis in "xyz"],
        quaternion=[f"{topic}.q{axis}" for axis in "wxyz"],
    )
    own = recording[topic]
    assert len(stream) == len(own)
    assert np.array_equal(stream[["x", "y", "z"]], own[["x", "y", "z"]])


def test_rows_of_wrong_length_are_left_out_and_counted(tmp_path: Path) -> None:
    lines = frame().to_csv(index=False).splitlines()
    lines[10], lines[20] = "1,2,3", lines[20] + ",9"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    report, _ = imported(tmp_path / "a.csv", tmp_path)
    assert (report.counts.damaged, report.counts.samples) == (2, COUNT - 2)
    assert report.counts.rows == COUNT


def test_a_long_table_gives_the_same(tmp_path: Path) -> None:
    count = 700_000
    times = np.arange(count) * 1e-3
    rows = np.column_stack((times, np.sin(times), np.cos(times), 0.0 * times))
    rows[:, 1:] *= 0.03
    pd.DataFrame(rows, columns=HEAD[:4]).to_parquet(tmp_path / "long.parquet")
    report, stream = imported(tmp_path / "long.parquet", tmp_path, center="mean")
    expected = rows[:, 1:] - rows[:, 1:].mean(axis=0)
    assert np.allclose(stream[["x", "y", "z"]], expected, rtol=0, atol=1e-12)
    assert report.counts.samples == count


# The report.


def test_report_says_what_numpy_says(tmp_path: Path) -> None:
    report, _ = brought(tmp_path)
    assert report.range == pytest.approx(np.ptp(PLACES, axis=0), abs=1e-12)
    assert report.rotation == pytest.approx((TURNS[0].inv() * TURNS).magnitude().max(), abs=1e-6)
    every_third = PLACES[::3]  # at 33 Hz, the rate nearest to 30 Hz
    speeds = np.linalg.norm(np.diff(every_third, axis=0), axis=1) / 0.03
    assert report.speed == pytest.approx(np.percentile(speeds, (50, 95)), rel=1e-6)
    assert report.rate == pytest.approx(RATE, abs=1e-6)
    assert report.duration == pytest.approx(TIMES[-1], abs=1e-9)
    text = str(report)
    assert "400 of 400 rows" in text
    assert "gaps      none" in text


@pytest.mark.parametrize(
    ("options", "text"), [({"unit": "m", "scale": 100.0}, "unit mm"), ({"rate": 5.0}, "slow"), ({"rate": 1e4}, "5 m/s")]
)
def test_what_looks_wrong_is_told(options: Mapping[str, str | float], text: str, tmp_path: Path) -> None:
    rows = PLACES if "rate" in options else np.column_stack((TIMES, PLACES))
    rows = 2.0 * rows
    report, _ = brought(tmp_path, frame(HEAD[:4][-rows.shape[1] :], rows), **options)
    assert any(text in warning for warning in report.warnings)


# Names.


@pytest.mark.parametrize(
    ("head", "time", "place", "turn"),
    [
        ("t x y z qx qy qz qw", "t", "x y z", "qw qx qy qz"),
        ("timestamp tx ty tz qx qy qz qw", "timestamp", "tx ty tz", "qw qx qy qz"),
        ("time pos_x pos_y pos_z quat_w quat_x quat_y quat_z", "time", "pos_x pos_y pos_z",
         "quat_w quat_x quat_y quat_z"),
        ("posX posY posZ rotX rotY rotZ rotW Time", "Time", "posX posY posZ",
         "rotW rotX rotY rotZ"),
        ("%time field.header.seq field.pose.position.x field.pose.position.y "
         "field.pose.position.z field.pose.orientation.x field.pose.orientation.y "
         "field.pose.orientation.z field.pose.orientation.w", "%time",
         "field.pose.position.x field.pose.position.y field.pose.position.z",
         "field.pose.orientation.w field.pose.orientation.x field.pose.orientation.y "
         "field.pose.orientation.z"),
        ("time vx vy vz x y z", "time", "x y z", ""),
        ("elapsed hand:X hand:Y hand:Z hand:QX hand:QY hand:QZ hand:QW", "elapsed",
         "hand:X hand:Y hand:Z", "hand:QW hand:QX hand:QY hand:QZ"),
        ("a b c", "", "", ""),
        ("t x y z q0 q1 q2 q3", "t", "x y z", "q0 q1 q2 q3"),
    ],
)  # fmt: skip
def test_names_of_many_recorders_are_understood(head: str, time: str, place: str, turn: str) -> None:
    columns = head.split()
    quaternions = names.quaternions(columns)
    parts = {column for group in quaternions for column in group.columns}
    places = names.positions(columns, [one for one in names.triples(columns) if not parts & set(one.columns)])
    for found, expected in (
        (names.find_time(columns), time),
        (places[0].columns if places else (), place),
        (quaternions[0].columns if quaternions else (), turn),
    ):
        assert [columns[i] for i in found] == expected.split()


def test_of_several_positions_none_is_taken_until_one_is_chosen(tmp_path: Path) -> None:
    head = ["t", *(f"{hand}.{axis}" for hand in ("left", "right") for axis in "xyz")]
    table = frame(head, np.column_stack((TIMES, PLACES, 2.0 * PLACES)))
    with pytest.raises(tc.RecordingError, match=r"left.x left.y left.z; right.x right.y right.z.*--position"):
        brought(tmp_path, table)
    _, stream = brought(tmp_path, table, position=head[4:])
    assert np.allclose(stream[["x", "y", "z"]], 2.0 * PLACES, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "unit"), [("x [mm]", "mm"), ("Time (Seconds)", "s"), ("stamp_ns", "ns"), ("roll (deg)", "deg"), ("x", "")]
)
def test_units_stand_behind_names(name: str, unit: str) -> None:
    assert names.without_unit(name)[1] == unit


def test_angles_beyond_a_turn_are_degrees(tmp_path: Path) -> None:
    values = np.degrees(TURNS.as_euler("xyz"))
    report, stream = turned(tmp_path / "a.csv", tmp_path, ["roll", "pitch", "yaw"], values)
    assert any("degrees" in text for text in report.told)
    assert_same_motion(stream)
    assert math.degrees(report.rotation) < 180.1
