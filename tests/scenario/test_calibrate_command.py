"""``teleop calibrate`` as a user types it: tables, files that sessions take, and wrong use."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from present import present
from teleop_core.bags.reader import Bag
from teleop_core.commands import cli
from teleop_core.graph.topics import SLAVE_MEASURED_CP
from teleop_core.robots import load_robot

RCRT1 = load_robot("rcrt1")


@pytest.fixture
def calibrate(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run the command in this process; what it prints."""

    def run(*arguments: str | int | Path) -> str:
        assert cli.main(["calibrate", *map(str, arguments)]) == 0
        return capsys.readouterr().out

    return run


def last_rms(text: str) -> list[float]:
    """Total RMS before and after [mm], of the last line."""
    return [float(x) for x in present(re.search(r"total RMS (\S+) -> (\S+) mm", text)).groups()]


def poses_file(path: Path, count: int = 40) -> Path:
    """Poses of an arm whose joint 3 is off by 5.5 mm, in degrees and millimetres."""
    rng = np.random.default_rng(1)
    joints = rng.uniform(RCRT1.lower, RCRT1.upper, (count, 6))
    tips = RCRT1.fk(joints + np.array([0, 0, 5.5e-3, 0, 0, 0]))[:, :3, 3]
    table = pd.DataFrame(joints, columns=RCRT1.joint_names)
    table[["x [mm]", "y [mm]", "z [mm]"]] = 1e3 * tips + rng.normal(0, 0.1, (count, 3))
    table.to_csv(path, index=False)
    return path


def test_the_published_table_comes_out_of_the_published_readings(calibrate: Callable[..., str]) -> None:
    text = calibrate("--data", "published", "--fit", "d3")
    assert re.search(r"d3 +5\.500\d +1\.1\d+ +mm", text)
    assert re.search(r"total +0\.7440 +0\.5925 +2\.0000 +0\.3515", text)


def test_a_session_takes_the_arm_that_was_found(calibrate: Callable[..., str], tmp_path: Path) -> None:
    arm, numbers, bag = tmp_path / "arm.yaml", tmp_path / "c.json", tmp_path / "bag"
    text = calibrate("--poses", 20, "--out", arm, "--json", numbers)
    before, after = last_rms(text.rsplit("numbers:", 1)[0])
    assert before == pytest.approx(5.5, rel=0.02)
    assert after < 0.2
    found = json.loads(numbers.read_text())
    assert found["found"]["d3"]["value"] == pytest.approx(5.5e-3, abs=1e-4)
    written = yaml.safe_load(arm.read_text())["rows"][2]["d"]
    assert written == f"q + {found['found']['d3']['value']}"
    sim = ["sim", "--duration", "1", "--out", str(bag), "--set", f"robot={arm}"]
    assert cli.main(sim) == 0
    assert np.isfinite(Bag(bag).read(SLAVE_MEASURED_CP).values).all()


def test_a_file_of_poses_gives_the_offset_it_was_made_with(calibrate: Callable[..., str], tmp_path: Path) -> None:
    text = calibrate("--data", poses_file(tmp_path / "poses.csv"), "--fit", "offsets")
    value, half = map(float, present(re.search(r"d3 +(\S+) +(\S+) +mm", text)).groups())
    assert abs(value - 5.5) < 2.0 * half < 0.2
    assert last_rms(text)[1] < 0.25
    assert "without its fifth" in text


def test_a_tracker_of_unknown_place_gives_it_too(calibrate: Callable[..., str], tmp_path: Path) -> None:
    text = calibrate("--data", poses_file(tmp_path / "p.csv"), "--fit", "d3", "--frame", "unknown")
    assert re.search(r"d3 +5\.[45]\d+ ", text)
    assert "frame_rz" in text


@pytest.mark.parametrize("robot", ["puma560", "config/robots/scara.yaml"])
def test_other_chains_and_choices_are_taken(calibrate: Callable[..., str], robot: str) -> None:
    text = calibrate("--robot", robot, "--errors", "prototype", "theta1=2e-3", "--choose", "random", "--seed", 3)
    assert re.search(r"theta1 +[12]\.\d+ ", text)
    before, after = last_rms(text)
    assert after < 0.2 * before
