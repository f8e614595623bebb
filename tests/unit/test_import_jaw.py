"""Import of a jaw: a column closes the slave's jaw, whatever its unit and its direction."""

from pathlib import Path

import numpy as np
import pytest

import teleop_core as tc
import teleop_exchange
from teleop_core.base.errors import RecordingError
from teleop_core.kernels.geometry import Array

TIMES = np.arange(0.0, 4.0, 0.02)
CLOSING = 0.5 - 0.5 * np.cos(np.pi * TIMES)  # closes, opens, closes, opens


def file_of(path: Path, jaw: Array) -> Path:
    """A table of a hand at rest with a column of its jaw."""
    place = np.zeros((len(TIMES), 3))
    np.savetxt(path, np.column_stack((TIMES, place, jaw)), delimiter=",", header="t,x,y,z,grip", comments="")
    return path


@pytest.mark.parametrize(("opened", "closed"), [(0.08, 0.0), (0.0, 100.0), (-1.0, 2.5)])
def test_column_closes_the_hand_by_its_share_from_open_to_closed(opened: float, closed: float, tmp_path: Path) -> None:
    path = file_of(tmp_path / "hand.csv", opened + (closed - opened) * CLOSING)
    words = ("grip", str(opened), str(closed))
    report = teleop_exchange.import_recording(path, tmp_path / "hand", jaw=words, unit="m")
    found = report.recording["hand/jaw"]
    np.testing.assert_allclose(found.values[:, 0], CLOSING, atol=1e-9)


def test_jaw_of_a_session_follows_the_column(tmp_path: Path) -> None:
    path = file_of(tmp_path / "hand.csv", 0.08 * (1.0 - CLOSING))
    teleop_exchange.import_recording(path, tmp_path / "hand", jaw=("grip", "0.08", "0"), unit="m")
    texts = {"teleop.stages": ["jaw_command", "jaw", "jaw_sim"]}
    answer = tc.replay(tmp_path / "hand", settings=texts)
    angles = answer["slave/jaw/measured_js"].values[:, 0]
    assert angles.max() > 0.75
    assert angles.min() < 0.05


def test_missing_values_repeat_and_a_column_without_numbers_is_refused(tmp_path: Path) -> None:
    jaw = 1.0 - CLOSING
    jaw[100] = np.nan
    path = file_of(tmp_path / "hand.csv", jaw)
    report = teleop_exchange.import_recording(path, tmp_path / "hand", jaw=("grip", "1", "0"), unit="m")
    closing = report.recording["hand/jaw"].values[:, 0]
    assert closing[100] == closing[99]
    path = file_of(tmp_path / "none.csv", np.full(len(TIMES), np.nan))
    with pytest.raises(RecordingError, match="--jaw holds no numbers"):
        teleop_exchange.import_recording(path, tmp_path / "none", jaw=("grip", "1", "0"), unit="m")
