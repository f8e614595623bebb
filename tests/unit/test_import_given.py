"""Import: the options that were given stand in the report, and a wrong order of a quaternion is noticed."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import teleop_core as tc
import teleop_exchange
from teleop_core.kernels.geometry import Array
from teleop_exchange import ImportOptions

RATE = 100.0


def turns(largest: float, count: int = 300) -> Array:
    """Quaternions x, y, z, w of a hand that turns by at most some angle [rad]."""
    t = np.linspace(0.0, 3.0, count)
    axis = np.column_stack((np.sin(t), np.cos(2.0 * t), np.ones(count)))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    return np.asarray(Rotation.from_rotvec(largest * np.sin(t)[:, None] * axis).as_quat())


def file_of(path: Path, quaternions: Array) -> Path:
    """File without names: three places and four numbers of an orientation."""
    places = 0.01 * quaternions[:, :3]
    np.savetxt(path, np.column_stack((places, quaternions)), fmt="%.9f")
    return path


def named(folder: Path, further: str = "") -> Path:
    """A table of times and places, and of further columns of zeros, whose names stand in its head."""
    rows = np.zeros((300, 4 + further.count(",")))
    rows[:, :4] = np.column_stack((np.arange(300) / RATE, turns(0.3)[:, :3]))
    np.savetxt(folder / "named.csv", rows, header=f"t,x,y,z{further}", comments="", delimiter=",")
    return folder / "named.csv"


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
def test_wrong_order_of_a_quaternion_is_noticed_although_the_speed_of_turning_is_the_same(
    order: str, tmp_path: Path
) -> None:
    rows = turns(0.6) if order == "xyzw" else np.roll(turns(0.6), 1, axis=1)
    path, reports = file_of(tmp_path / "hand.txt", rows), {}
    for said in ("xyzw", "wxyz"):
        reports[said] = teleop_exchange.import_recording(
            path, tmp_path / said, rate=RATE, position=("1-3",), quaternion=("4-7",), quaternion_order=said, unit="m"
        )
    wrong = "wxyz" if order == "xyzw" else "xyzw"
    assert not reports[order].warnings
    (warning,) = reports[wrong].warnings
    assert f"--quaternion-order {order}" in warning
    expected = np.linalg.norm(np.diff(rows, axis=0), axis=1) * 2.0 * RATE  # |w| = 2 |dq/dt|, in any order
    for report in reports.values():
        assert report.turning[0] == pytest.approx(np.median(expected), rel=0.1)


def test_turns_about_all_axes_cause_no_doubt(tmp_path: Path) -> None:
    path = file_of(tmp_path / "hand.txt", turns(3.0))
    for said in ("xyzw", "wxyz"):
        report = teleop_exchange.import_recording(
            path, tmp_path / said, rate=RATE, position=("1-3",), quaternion=("4-7",), quaternion_order=said, unit="m"
        )
        assert not [text for text in report.warnings if "order" in text]


def test_hand_that_turns_faster_than_a_wrist_can_is_told(tmp_path: Path) -> None:
    path = file_of(tmp_path / "hand.txt", turns(2.0)[::20])
    report = teleop_exchange.import_recording(
        path, tmp_path / "out", rate=RATE, position=("1-3",), quaternion=("4-7",), quaternion_order="xyzw", unit="m"
    )
    assert [text for text in report.warnings if "rad/s" in text]


def test_options_that_were_given_stand_in_the_report(tmp_path: Path) -> None:
    path = file_of(tmp_path / "hand.txt", turns(0.3))
    report = teleop_exchange.import_recording(
        path, tmp_path / "out", rate=RATE, axes=("+y", "-x", "+z"), scale=2.0, unit="cm", center="mean", gap=9.0
    )
    text = str(report)
    (given,) = [line for line in text.splitlines() if line.startswith("given")]
    for words in ("--rate 100.0", "--axes +y -x +z", "--scale 2.0", "--unit cm", "--center mean", "--gap 9.0"):
        assert words in given
    assert "given" not in str(teleop_exchange.import_recording(named(tmp_path), tmp_path / "plain"))


def test_an_existing_directory_is_never_touched(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "precious").write_text("1")
    with pytest.raises(tc.RecordingError, match="exists already"):
        teleop_exchange.import_recording(named(tmp_path), out)
    assert (out / "precious").read_text() == "1"


def test_columns_that_are_left_unused_are_told(tmp_path: Path) -> None:
    report = teleop_exchange.import_recording(named(tmp_path, ",PedalDown,grip"), tmp_path / "out")
    assert "left unused: 'PedalDown', 'grip'" in report.told


def test_options_say_what_they_are_on_the_command_line() -> None:
    options = ImportOptions(position="2-4", unit="mm", euler=("xyz", "a", "b", "c"), rate=30.0)  # type: ignore[arg-type]
    assert options.as_arguments() == [
        "--rate", "30.0", "--position", "2", "3", "4", "--unit", "mm", "--euler", "xyz", "a", "b",
        "c",
    ]  # fmt: skip
