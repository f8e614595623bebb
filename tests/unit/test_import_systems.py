"""Importing files of known systems, as these write them: Qualisys, JIGSAWS, Unity, da Vinci kit."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import teleop_core as tc
import teleop_exchange
from teleop_core.commands import cli
from teleop_core.kernels.geometry import Array
from teleop_exchange import ImportOptions

COUNT = 300
T = np.arange(COUNT) / 100.0
PLACES = 0.05 * np.column_stack((np.sin(T), np.cos(T), 0.3 * T))
TURNS = Rotation.from_rotvec(np.column_stack((0.2 * np.sin(T), 0.1 * T, 0.3 * np.cos(T))))
HEAD = ["NO_OF_FRAMES\t300", "NO_OF_CAMERAS\t4", "NO_OF_BODIES\t1", "FREQUENCY\t100",
        "NO_OF_ANALOG\t0", "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--",
        "TIME_STAMP\t2020-01-22, 17:47:17\t22107.99179716", "DATA_INCLUDED\t6D",
        "BODY_NAMES\tStylus"]  # fmt: skip
NAMES = ["Frame", "Time", "Stylus X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{i}]" for i in range(9))]

QUALISYS: dict[str, Any] = {
    "unit": "mm",
    "time_unit": "s",
    "matrix_order": "column",
    "matrix": tuple(f"Rot[{i}]" for i in range(9)),
}
JIGSAWS: dict[str, Any] = {
    "rate": 30.0,
    "unit": "m",
    "arms": {"left": {"position": "1-3", "matrix": "4-12"}, "right": {"position": "20-22", "matrix": "23-31"}},
}
UNITY: dict[str, Any] = {"unit": "m", "handedness": "left", "axes": ("+z", "-x", "+y"), "quaternion_order": "xyzw"}


def poses(recording: tc.Recording, topic: str = "master/measured_cp") -> tuple[Array, Array]:
    """Places (N, 3) [m] and rotation matrices (N, 3, 3)."""
    values = recording[topic].values
    return values[:, :3], Rotation.from_quat(values[:, 3:], scalar_first=True).as_matrix()


def qualisys(path: Path, end: str = "") -> Path:
    """Rigid body of Track Manager: eleven lines before the numbers, lengths in mm."""
    angles = TURNS.as_euler("XYZ", degrees=True)
    rows = [[n + 1, T[n], *(1e3 * PLACES[n]), *angles[n], 0.4, *TURNS[n].as_matrix().T.ravel()] for n in range(COUNT)]
    lines = [*HEAD, "\t".join(NAMES) + end]
    lines += ["\t".join(f"{value:.6f}" for value in row) for row in rows]
    path.write_text("\r\n".join(lines) + "\r\n")
    return path


@pytest.mark.parametrize("end", ["", "\t"])
def test_a_rigid_body_of_qualisys_is_what_it_was(tmp_path: Path, end: str) -> None:
    report = teleop_exchange.import_recording(qualisys(tmp_path / "hand.tsv", end), tmp_path / "bag", **QUALISYS)
    assert report.counts.samples == report.counts.rows == COUNT
    places, matrices = poses(report.recording)
    np.testing.assert_allclose(places, PLACES, atol=1e-8)
    np.testing.assert_allclose(matrices, TURNS.as_matrix(), atol=1e-5)
    assert report.rate == pytest.approx(100.0)


def test_places_far_beyond_a_hand_are_refused_until_somebody_says_their_unit(tmp_path: Path) -> None:
    file = qualisys(tmp_path / "hand.tsv")
    with pytest.raises(tc.TeleopError, match=r"up to 50 m from the origin.*--unit mm, or --unit m"):
        teleop_exchange.import_recording(file, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()
    assert teleop_exchange.import_recording(file, tmp_path / "said", unit="m").range[0] > 5.0


def jigsaws(path: Path) -> Path:
    """Kinematics of JIGSAWS: 76 columns, four arms of place, matrix, velocities and gripper."""
    arms = []
    for number in range(4):
        turned = TURNS.as_matrix().reshape(COUNT, 9)
        arms += [PLACES + 0.1 * number, turned, np.zeros((COUNT, 6)), np.full((COUNT, 1), -0.4)]
    np.savetxt(path, np.hstack(arms), fmt="%.6f", delimiter="     ")
    return path


def test_both_masters_of_jigsaws_are_two_arms_that_replay(tmp_path: Path) -> None:
    report = teleop_exchange.import_recording(jigsaws(tmp_path / "a.txt"), tmp_path / "bag", **JIGSAWS)
    assert [one.arm for one in (report, *report.others)] == ["left", "right"]
    assert report.rate == pytest.approx(30.0, rel=1e-3)
    for number, topic in enumerate(("master/measured_cp", "right/master/measured_cp")):
        places, matrices = poses(report.recording, topic)
        np.testing.assert_allclose(places, PLACES + 0.1 * number, atol=1e-6)
        np.testing.assert_allclose(matrices, TURNS.as_matrix(), atol=1e-5)
    answer = tc.replay(report.recording)
    assert answer.arms == ("left", "right")
    assert len(answer["right/slave/measured_cp"]) == len(answer["slave/measured_cp"])


def unity(path: Path) -> Path:
    """A table as a script of Unity writes it: left-handed, y up, quaternions, True and False."""
    x, y, z, w = TURNS.as_quat().T
    table = pd.DataFrame(
        {
            "Time": T, "PosX": -PLACES[:, 1], "PosY": PLACES[:, 2], "PosZ": PLACES[:, 0],
            "RotX": y, "RotY": -z, "RotZ": -x, "RotW": w, "Clutch": (T > 1.0) & (T < 2.0),
        }
    )  # fmt: skip
    table.to_csv(path, index=False)
    return path


def test_left_handed_axes_of_unity_are_mirrored_with_their_turns(tmp_path: Path) -> None:
    report = teleop_exchange.import_recording(unity(tmp_path / "hand.csv"), tmp_path / "bag", **UNITY)
    places, matrices = poses(report.recording)
    np.testing.assert_allclose(places, PLACES, atol=1e-12)
    np.testing.assert_allclose(matrices, TURNS.as_matrix(), atol=1e-12)


def test_a_left_handed_map_must_mirror_and_a_right_handed_one_must_not() -> None:
    with pytest.raises(tc.ParameterError, match="mirror, for --handedness left"):
        ImportOptions(handedness="left")
    with pytest.raises(tc.ParameterError, match="do not mirror"):
        ImportOptions(axes=("+z", "-x", "+y"))


@pytest.mark.parametrize("separator", [",", " ", "\t"])
def test_a_clutch_of_true_and_false_is_taken(tmp_path: Path, separator: str) -> None:
    table = pd.read_csv(unity(tmp_path / "hand.csv"))
    table.to_csv(tmp_path / "again.csv", index=False, sep=separator)
    report = teleop_exchange.import_recording(tmp_path / "again.csv", tmp_path / "bag", **UNITY)
    buttons = report.recording["master/buttons"]
    assert buttons["clutch"].tolist() == [0.0, 1.0, 0.0]
    np.testing.assert_allclose(np.diff(buttons.stamp_ns) * 1e-9, [1.01, 0.99])


def test_a_column_that_is_called_clutch_and_is_no_button_is_told(tmp_path: Path) -> None:
    table = pd.read_csv(unity(tmp_path / "hand.csv")).assign(Clutch=0.7)
    table.to_csv(tmp_path / "hand.csv", index=False)
    report = teleop_exchange.import_recording(tmp_path / "hand.csv", tmp_path / "bag", **UNITY)
    assert any("no button clutch: 'Clutch' holds more than 0 and 1" in text for text in report.told)


def test_two_hands_of_a_table_are_said_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = pd.DataFrame({"t": T, "press": T > 1.0})
    for hand, sign in (("l", 1.0), ("r", -1.0)):
        for axis, column in zip("xyz", PLACES.T, strict=True):
            table[f"{hand}{axis}"] = 1e3 * sign * column
    table.to_csv(tmp_path / "two.csv", index=False)
    words = ["import", tmp_path / "two.csv", "--out", tmp_path / "bag", "--time", "t",
             "--unit", "mm", "--arm", "one", "--position lx ly lz --clutch press",
             "--arm", "two", "--position rx ry rz"]  # fmt: skip
    assert cli.main(list(map(str, words))) == 0
    assert "arm       two" in capsys.readouterr().out
    recording = tc.open_recording(tmp_path / "bag")
    np.testing.assert_allclose(poses(recording)[0], PLACES)
    np.testing.assert_allclose(poses(recording, "two/master/measured_cp")[0], -PLACES)
    assert "master/buttons" in recording
    assert "two/master/buttons" not in recording
    for wrong in ("--positoin lx ly lz", "--position '", "--unit miles"):
        words[-1] = wrong
        words[3] = tmp_path / "wrong"
        assert cli.main(list(map(str, words))) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
