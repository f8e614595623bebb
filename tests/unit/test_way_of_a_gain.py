"""A gain has one name on its way from a file to the record that kernels read, as docs/parameters.md draws it."""

import re
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from teleop_core.base.plain_yaml import written
from teleop_core.graph.signals import DT
from teleop_core.graph.stage import STAGES
from teleop_core.session.configuration import configure

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize(
    ("stage", "name", "value"),
    [
        ("motion_scaling", "fixture.damping", 7.5),
        ("motion_scaling", "coarse_gain", 0.4),
        ("slave", "command_timeout", 0.07),
    ],
)
def test_a_gain_of_a_file_has_the_same_name_in_the_group_and_in_the_record(
    stage: str, name: str, value: float, tmp_path: Path
) -> None:
    file = tmp_path / "gain.yaml"
    nested: Any = value
    for part in reversed(name.split(".")):
        nested = {part: nested}
    file.write_text(written({stage: {"ros__parameters": nested}}))
    group = configure("coarse_box", [file]).groups[stage]
    runner: Any = STAGES.find(stage).run(group, DT)
    record = getattr(runner, "parameters", None)
    record = runner._parameters if record is None else record
    assert reduce(getattr, name.split("."), group) == value
    assert reduce(lambda row, part: row[part], name.split("."), record) == value


def test_the_way_that_is_drawn_has_at_most_nine_steps_in_five_files_through_functions_that_exist() -> None:
    text = (DOCS / "parameters.md").read_text()
    steps = re.findall(r"^\| \d \| `([\w/]+)\.py`, `([\w.]+)` \|", text, re.MULTILINE)
    assert 5 <= len(steps) <= 9
    assert len({module for module, _ in steps}) <= 5
    for module, name in steps:
        assert reduce(getattr, name.split("."), import_module(f"teleop_core.{module.replace('/', '.')}"))  # type: ignore[arg-type]
