"""Choices: what the start page offers is what a session takes, as does the command it shows."""

import math
import os
import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from teleop_console import choices
from teleop_console.choices import FIELDS, OWN, START, Chosen
from teleop_core.base.errors import ParameterError
from teleop_core.commands.cli import parse
from teleop_core.commands.options import SessionOptions
from teleop_core.session.api import configuration
from teleop_core.session.configuration import Configuration

URDF = Path(__file__).parents[2] / "examples" / "any_arm.urdf"
CHOICES: tuple[Chosen, ...] = (
    START,
    {"scenario": "coarse_box", "operator": "remote", "robot": "puma560"},
    {"scenario": "wall", "operator": "human", "network": "delay_300", "passivity": "wave"},
    {"scenario": "point", "network": "loss_10"},
    {"scenario": "point"},
    {"scenario": "human", "operator": "bag", "followed": "bags/example"},
)


def by_command(line: str) -> Configuration:
    """Session that a command line starts, by the program's own parser."""
    words = shlex.split(line)
    assert words[:2] == ["teleop", "console"]
    call = parse(words[1:])
    assert call is not None
    told = call.arguments.arguments
    settings = told.get("settings", SessionOptions())
    return configuration(told.get("scenario"), files=settings.config, texts=[*OWN, *settings.texts])


@pytest.mark.parametrize("chosen", CHOICES, ids=lambda chosen: "-".join(chosen.values()))
def test_command_line_that_is_shown_starts_the_session_that_is_chosen(chosen: Chosen) -> None:
    assert not choices.refusal(chosen)
    made = by_command(choices.command_line(chosen))
    kind = made.groups["operator"].kind.kind
    scenario = configuration(chosen.get("scenario"))
    assert kind == chosen.get("operator", scenario.groups["operator"].kind.kind)
    if "robot" in chosen:
        assert made.groups["slave"].robot == chosen["robot"]
    if "network" in chosen:
        assert made.groups["network"].preset == chosen["network"]
    assert set(scenario.groups["teleop"].stages) <= set(made.groups["teleop"].stages)


def test_simulated_operator_ends_with_its_scenario_and_a_person_when_the_page_is_left() -> None:
    assert by_command(choices.command_line({"scenario": "point"})).groups["teleop"].duration == 40.0
    asked = {"scenario": "point", "operator": "remote"}
    assert by_command(choices.command_line(asked)).groups["teleop"].duration == 86400.0


@pytest.mark.parametrize("name", ["operator", "task", "passivity"])
def test_what_is_greyed_is_refused_by_the_configuration_and_nothing_else_is(name: str) -> None:
    field = next(field for field in FIELDS if field.name == name)
    chosen = {"scenario": "coarse_box", "operator": "remote"}
    for option in choices.options(field, chosen):
        said = choices.texts({**chosen, name: option.word})
        texts = ["operator=remote", *(one for one in said if "duration" not in one)]
        try:
            configuration("coarse_box", texts=texts)
            reason = ""
        except ParameterError as error:
            reason = str(error)
        assert option.reason == reason
        assert not option.reason or "must be" in option.reason


def test_operator_that_needs_a_task_is_free_as_soon_as_there_is_one() -> None:
    field = FIELDS[1]
    reasons = [
        {one.word: one.reason for one in choices.options(field, chosen)}["observer"]
        for chosen in ({"scenario": "coarse_box"}, {"scenario": "coarse_box", "task": "point"})
    ]
    assert "task" in str(reasons[0])
    assert reasons[1] == ""


def test_robot_that_cannot_be_loaded_is_refused_before_anything_starts() -> None:
    urdf = {"operator": "remote", "robot": str(URDF)}
    assert "tool0" in choices.refusal(urdf)  # the links to choose from
    assert not choices.refusal({**urdf, "tip": "tool0"})
    assert choices.refusal({**urdf, "robot": "nowhere.urdf"})


def test_tip_of_a_urdf_does_not_hinder_the_next_robot() -> None:
    chosen = {"operator": "remote", "robot": "rcrt1", "tip": "tool0"}
    assert not choices.refusal(chosen)
    assert "tool0" not in choices.command_line(chosen)
    field = next(field for field in FIELDS if field.name == "robot")
    assert not any(option.reason for option in choices.options(field, chosen))


def test_pipe_is_refused_and_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "arm.urdf")
    assert "a file or a folder" in choices.refusal({"operator": "remote", "robot": str(tmp_path / "arm.urdf")})


def test_choice_that_is_wrong_as_a_whole_greys_nothing_so_that_one_finds_out_of_it() -> None:
    wrong = {"scenario": "coarse_box", "operator": "points"}
    assert choices.refusal(wrong)
    robots = next(field for field in FIELDS if field.name == "robot")
    assert not any(option.reason for option in choices.options(robots, wrong))


def test_what_was_not_tried_in_time_is_told_as_not_known() -> None:
    field = replace(FIELDS[0], options=lambda: {"wall": "a wall"})
    found = choices.options(field, {"operator": "remote", "plant": "ideal"}, -math.inf)
    assert [option.reason for option in found] == [None, None]


def test_command_line_quotes_what_a_shell_would_read() -> None:
    line = choices.command_line({"operator": "remote", "robot": "$(reboot).urdf; `id`"})
    assert shlex.split(line)[-1] == "robot=$(reboot).urdf; `id`"
