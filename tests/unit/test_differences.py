"""Differences: the table of several recordings shows what differs, the largest change first."""

import io
import re
from pathlib import Path

import pytest
from rich.console import Console

import teleop_core as tc
from teleop_core.base.errors import ParameterError
from teleop_core.evaluation.command import evaluate_bags


def told(*paths: Path) -> str:
    """What ``teleop evaluate --differences`` prints."""
    shown = io.StringIO()
    evaluate_bags(paths, None, None, Console(width=160, file=shown), differences=True)
    return shown.getvalue()


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("pair")
    for gain in (0.5, 1.0):
        texts = {"operator": "human", "motion_scaling.coarse_gain": gain}
        tc.run(duration=1.0, out=folder / str(gain), **texts)  # type: ignore[arg-type]
    return [folder / "0.5", folder / "1.0"]


def test_recordings_that_are_equal_have_no_rows_that_differ(pair: list[Path]) -> None:
    text = told(pair[0], pair[0])
    equal, count = re.findall(r"(\d+) of (\d+) rows are equal", text)[0]
    assert equal == count
    assert "%)" not in text


def test_a_change_is_that_of_the_printed_numbers_and_the_largest_stands_first(pair: list[Path]) -> None:
    text = told(*pair)
    found = re.findall(r" (\d+\.?\d*) +(\d+\.?\d*) \(([+-]\d+)%\)", text)
    assert len(found) > 3
    for first, other, change in found:
        assert float(other) / float(first) - 1.0 == pytest.approx(float(change) / 100.0, abs=0.0051)
    sizes = [abs(int(change)) for *_, change in found]
    assert sizes == sorted(sizes, reverse=True)
    assert not re.search(r" (\d+\.\d+) +\1\b", text)


def test_differences_of_one_recording_are_refused(pair: list[Path]) -> None:
    with pytest.raises(ParameterError, match="two recordings or more"):
        told(pair[0])
