"""Grading of episodes: the odd one is found, and what is not known is said."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import teleop_core as tc
from teleop_core.commands.cli import main
from teleop_lab.grading import ODD, REASON, WORST, grade, usual

RATE, ODD_ONE = 50.0, 4


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight episodes of nearly the same motion; one is three times as fast."""
    rng, frames = np.random.default_rng(1), []
    for episode in range(8):
        fast = 3.0 if episode == ODD_ONE else 1.0
        t = np.arange(200) / RATE
        rate = 2.0 * np.pi * 0.4 * fast * (1.0 + 0.02 * rng.standard_normal())
        place = 0.03 * np.sin(np.outer(t, [1.0, 0.7, 0.5]) * rate)
        frame = pd.DataFrame(place, columns=["x", "y", "z"])
        frame.insert(0, "timestamp", t)
        frame.insert(0, "episode_index", episode)
        frames.append(frame)
    path = tmp_path_factory.mktemp("grading") / "set.csv"
    pd.concat(frames).to_csv(path, index=False)
    return path


def test_the_odd_episode_comes_first_and_names_why(table: Path) -> None:
    found = grade(table)
    assert found.index[0] == ODD_ONE
    assert "speed" in found.iloc[0][WORST] or "path" in found.iloc[0][WORST]
    assert found[ODD].is_monotonic_decreasing
    assert ODD_ONE not in usual(found)
    assert len(usual(found, np.inf)) == 8


def test_figures_are_those_of_each_episode_alone(table: Path, tmp_path: Path) -> None:
    found = grade(table)
    alone = pd.read_csv(table).query("episode_index == 2")
    length = np.linalg.norm(np.diff(alone[["x", "y", "z"]], axis=0), axis=1).sum()
    assert found.loc[2, "path_mm"] == pytest.approx(1e3 * length, rel=0.01)
    assert found.loc[2, "time_s"] == pytest.approx(len(alone) / RATE, abs=0.05)


def test_an_episode_that_cannot_be_read_says_why_and_is_not_among_the_usual(table: Path, tmp_path: Path) -> None:
    broken = pd.read_csv(table)
    broken.loc[broken.episode_index == 6, ["x", "y", "z"]] = np.nan
    file = tmp_path / "broken.csv"
    broken.to_csv(file, index=False)
    found = grade(file)
    assert found.loc[6, REASON]
    assert np.isnan(found.loc[6, "speed_median_mm_s"])
    assert 6 not in usual(found)
    assert set(found.index) == set(range(8))


def test_all_alike_nothing_is_odd(table: Path, tmp_path: Path) -> None:
    one = pd.read_csv(table).query("episode_index == 0")
    copies = pd.concat([one.assign(episode_index=i) for i in range(4)])
    copies.to_csv(tmp_path / "same.csv", index=False)
    found = grade(tmp_path / "same.csv")
    assert (found[ODD] == 0.0).all()


def lasting(tmp_path: Path, seconds: list[float]) -> Path:
    """Episodes of nearly the same motion that last some times."""
    frames = []
    for episode, duration in enumerate(seconds):
        t = np.arange(round(duration * RATE)) / RATE
        rate = 2.0 * np.pi * 0.4 * (1.0 + 0.02 * np.cos(7.0 * episode))
        frame = pd.DataFrame(0.03 * np.sin(np.outer(t, [1.0, 0.7, 0.5]) * rate), columns=["x", "y", "z"])
        frames.append(frame.assign(timestamp=t, episode_index=episode))
    pd.concat(frames).to_csv(tmp_path / "set.csv", index=False)
    return tmp_path / "set.csv"


@pytest.mark.parametrize("count", [4, 5, 12])
@pytest.mark.parametrize("duration", [2.0, 9.0])
def test_the_only_episode_that_does_not_share_a_figure_with_all_others_is_odd(
    count: int, duration: float, tmp_path: Path
) -> None:
    path = lasting(tmp_path, [*[5.0] * (count - 2), duration, 5.0])
    assert count - 2 not in usual(grade(path))
    found = grade(path, figures=("time_s", "speed_median_mm_s"))
    assert usual(found) == [number for number in range(count) if number != count - 2]
    assert found.iloc[0][WORST] == "time_s"


def test_the_command_takes_what_a_refusal_asks_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = lasting(tmp_path, [5.0, 5.0, 5.0, 5.0])
    table = pd.read_csv(path).drop(columns="timestamp").rename(columns={"episode_index": "take"})
    table["set"], table["take"], table["rx"] = table["take"] // 2, table["take"] % 2, 0.0
    for axis in "yz":
        table[f"r{axis}"] = 0.0
    table.to_csv(path, index=False)
    words = ["grade", str(path), "--rate", str(RATE), "--numbered-by", "set", "take"]
    assert main(words[:4]) == 2
    assert "--episode" in capsys.readouterr().err
    assert main(words) == 0
    assert "4 of 4 episodes" in capsys.readouterr().out


def test_a_frame_more_or_less_than_most_others_have_is_usual(tmp_path: Path) -> None:
    found = grade(lasting(tmp_path, [5.0, 5.0, 5.0, 5.02, 5.0, 5.0, 4.98, 5.0]), figures=("time_s", "reversals"))
    assert len(usual(found)) == 8


@pytest.mark.parametrize(("figures", "said"), [((), "at least one"), (("speed",), "motion.hand")])
def test_wrong_figures_are_refused(table: Path, figures: tuple[str, ...], said: str) -> None:
    with pytest.raises(tc.TeleopError, match=said):
        grade(table, figures=figures)


def test_the_command_prints_and_writes_what_the_function_finds(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keep, page, csv = (tmp_path / name for name in ("keep.txt", "page.html", "grades.csv"))
    words = ["grade", str(table), "--usual", str(keep), "--html", str(page), "--csv", str(csv)]
    assert main(words) == 0
    found = grade(table)
    assert [int(line) for line in keep.read_text().split()] == usual(found)
    assert pd.read_csv(csv)["episode"].tolist() == found.index.tolist()
    assert 'class="odd"' in page.read_text()
    assert f"{8 - len(usual(found))} of 8" in page.read_text()
    assert "robust standard deviations" in page.read_text()
    assert "<th>time [s]</th>" in page.read_text()
    assert f"{len(usual(found))} of 8 episodes" in capsys.readouterr().out
    assert main(["grade", str(tmp_path / "nothing.csv")]) == 2
