"""A recording of others on its way through the commands: import, replay, follow, export."""

import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from present import present
from teleop_core.bags.reader import Bag
from teleop_core.graph.topics import MASTER_MEASURED_CP, SLAVE_MEASURED_CP

if TYPE_CHECKING:
    from conftest import Run

pytestmark = pytest.mark.slow

COUNT = 300
T = 5.0 + np.arange(COUNT) / 30.0
PLACES = 0.02 * np.column_stack((np.sin(T), np.cos(1.3 * T), np.sin(0.7 * T)))
TURNS = Rotation.from_rotvec(0.2 * np.column_stack((np.sin(T), np.cos(T), 0.0 * T)))


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten seconds at 30 Hz with a pedal, as another program would write them."""
    names = ["time", "x", "y", "z", "qx", "qy", "qz", "qw"]
    table = pd.DataFrame(np.column_stack((T, PLACES, TURNS.as_quat())), columns=names)
    table["clutch"] = ((T > 8.0) & (T < 9.0)).astype(int)
    path = tmp_path_factory.mktemp("files") / "hand.csv"
    table.to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def imported(teleop: "Run", hand: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The recording, and what the command said."""
    out = tmp_path_factory.mktemp("bags") / "hand"
    return out, teleop("import", hand, "--out", out).stdout


def next_command(text: Any) -> list[str]:
    return present(re.search(r"next: teleop (.*)", text))[1].split()


def test_import_says_what_it_took_and_what_to_do_next(imported: Any) -> None:
    out, text = imported
    assert "300 of 300 rows" in text
    assert "button clutch" in text
    assert f"{out}: 10.0 s imported" in text
    assert next_command(text)[0] == "replay"


def test_a_motion_goes_in_through_the_graph_and_out_unchanged(
    teleop_again: "Run", imported: Any, tmp_path: Path
) -> None:
    _, text = imported
    teleop_again(*next_command(text))
    answer = next_command(text)[-1]
    teleop_again("export", answer, "--out", tmp_path / "a.csv", "--topics", "master/measured_cp",
           "slave/measured_cp", "teleop/state")  # fmt: skip
    table = pd.read_csv(tmp_path / "a.csv")
    columns = [f"master/measured_cp.{axis}" for axis in "xyz"]
    played = Bag(answer).read(MASTER_MEASURED_CP)
    at = np.searchsorted(played.stamp_ns, np.rint(T * 1e9).astype(np.int64))
    assert np.array_equal(played.stamp_ns[at], np.rint(T * 1e9).astype(np.int64))
    assert np.allclose(table[columns].dropna().to_numpy()[at], PLACES, rtol=0, atol=1e-15)
    following = table["teleop/state.is_following"] == 1.0
    clutched = table["teleop/state.is_clutched"] == 1.0
    assert clutched.sum() == pytest.approx(1000, abs=70)
    tip = table.loc[following & ~clutched, [f"slave/measured_cp.{axis}" for axis in "xyz"]]
    assert np.ptp(tip.to_numpy(), axis=0).min() > 0.01


def test_replaying_the_file_itself_gives_the_same_motion(
    teleop_again: "Run", hand: Path, imported: Any, tmp_path: Path
) -> None:
    out, text = imported
    if not (out.parent / "hand_replayed").exists():
        teleop_again(*next_command(text))
    said = teleop_again("replay", hand, "--out", tmp_path / "direct").stderr
    assert "note: hand.csv: x, y, z" in said
    a, b = (Bag(p).read(SLAVE_MEASURED_CP).values for p in (next_command(text)[-1], tmp_path / "direct"))
    assert np.array_equal(a, b)


def test_import_is_repeated_by_what_its_metadata_say(
    teleop_again: "Run", hand: Path, imported: Any, tmp_path: Path
) -> None:
    out, _ = imported
    about = Bag(out).metadata
    assert about["imported_from"] == "hand.csv"
    words = about["imported_by"].split()
    done = subprocess.run(
        [sys.executable, "-m", "teleop_core.commands.cli", *words[1:-1], str(tmp_path / "again")],
        cwd=hand.parent,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    again = Bag(tmp_path / "again")
    assert again.metadata["imported_sha256"] == about["imported_sha256"]
    one, two = (bag.read(MASTER_MEASURED_CP) for bag in (Bag(out), again))
    assert np.array_equal(one.values, two.values)
    assert np.array_equal(one.stamp_ns, two.stamp_ns)


def test_axes_with_a_minus_are_values_not_options(teleop_again: "Run", hand: Path, tmp_path: Path) -> None:
    for number, axes in enumerate((("-y", "+x", "+z"), ("+y", "-x", "+z"), ("z", "x", "y"))):
        out = tmp_path / str(number)
        teleop_again("import", hand, "--out", out, "--axes", *axes, "--scale", "0.5")
        turn = np.zeros((3, 3))
        for row, axis in enumerate(axes):
            turn[row, "xyz".index(axis[-1])] = -1.0 if axis[0] == "-" else 1.0
        got = Bag(out).read(MASTER_MEASURED_CP).values[:, :3]
        assert np.allclose(got, 0.5 * PLACES @ turn.T, rtol=0, atol=1e-15)
