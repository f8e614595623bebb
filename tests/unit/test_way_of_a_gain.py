"""Way of a gain: one declaration, and one name from a file to the kernel."""

import re
import sys
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from teleop_core.base import values_of
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.graph import STAGES
from teleop_core.graph.layers import load_file, parse_setting
from teleop_core.hand.master.haptic_master import HapticMasterParameters
from teleop_core.session.configuration import Configuration
from teleop_core.slave.parameters import SlaveParameters

PAGE = Path(__file__).parents[2] / "docs" / "parameters.md"
STEP = re.compile(r"^\| \d+ \| `([\w/]+)\.py`, `([\w.]+)`", re.MULTILINE)
GAINS: list[tuple[type[Any], str, str, float]] = [
    (MotionScalingParameters, "motion_scaling", "fixture.damping", 12.345),
    (HapticMasterParameters, "haptic_master", "device.peak_force", 2.345),
    (SlaveParameters, "slave", "operation.overspeed", 1.345),
]


def of_file(path: Path, stage: str, name: str, value: float) -> Configuration:
    path.write_text(f"{stage}:\n  ros__parameters:\n    {name}: {value}\n", encoding="utf-8")
    return Configuration.from_layers([load_file(path)])


@pytest.mark.parametrize(("kind", "stage", "name", "value"), GAINS, ids=[gain[2] for gain in GAINS])
def test_a_gain_has_one_name_in_the_file_the_group_and_the_record(
    kind: type[Any], stage: str, name: str, value: float, tmp_path: Path
) -> None:
    of_name = attrgetter(name)
    given = of_file(tmp_path / "gain.yaml", stage, name, value).of(kind)
    running: Any = STAGES.find(stage).run(given)
    usual = Configuration.from_layers([]).of(kind)
    assert of_name(given) == value
    assert of_name(running.parameters) == value
    running.retune(usual)
    assert of_name(running.parameters) == of_name(usual) != value


def test_all_numbers_of_a_stage_are_in_its_record_under_their_own_names() -> None:
    stages = ["tremor_filter", "network", "remote_centre", "jaw_command", "jaw", "jaw_sim"]
    groups = Configuration.from_layers([parse_setting(f"stages=[{','.join(stages)}]")]).groups
    found = 0
    for name in (*stages, "operator", "haptic_master", "motion_scaling", "inverse_kinematics", "slave"):
        record = STAGES.find(name).run(groups[name]).arguments[0]
        for key, value in values_of(groups[name]).items():
            if not isinstance(value, bool | int | float) or _is_of_part(groups[name], key):
                continue
            assert attrgetter(key)(record) == value, (name, key)
            found += 1
    assert found > 90


def _is_of_part(group: object, key: str) -> bool:
    """Whether a parameter is that of a part of a registry, which gives its numbers to the stage itself."""
    try:
        attrgetter(key)(group)
    except AttributeError:
        return True
    return False


def test_the_way_in_the_documents_is_the_way_that_a_gain_takes_and_is_short(tmp_path: Path) -> None:
    drawn = STEP.findall(PAGE.read_text(encoding="utf-8"))
    called: list[tuple[str, str]] = []

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            file = frame.f_code.co_filename.rpartition("/teleop_core/teleop_core/")[2]
            called.append((file.removesuffix(".py"), frame.f_code.co_qualname))

    sys.setprofile(note)
    try:
        given = of_file(tmp_path / "gain.yaml", "motion_scaling", "fixture.damping", 12.345)
        STAGES.find("motion_scaling").run(given.of(MotionScalingParameters))
    finally:
        sys.setprofile(None)
    places = [called.index(step) for step in drawn if step in called]
    assert places == sorted(places)
    assert len(places) == 5
    for file, name in drawn:
        assert attrgetter(name)(import_module("teleop_core." + file.replace("/", ".")))
    assert len(drawn) <= 9
    assert len({file for file, _ in drawn}) <= 5
