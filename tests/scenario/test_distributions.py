"""Distributions: the core works alone; the others add their commands and robots to it."""

import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path

import pytest

from teleop_core.commands import cli
from teleop_core.robots import ROBOTS

ALONE = """
import importlib.metadata, sys

for name in ("teleop_machines", "teleop_console", "teleop_exchange", "teleop_scene", "teleop_lab", "teleop_drill"):
    sys.modules[name] = None  # cannot be imported
entries = (entry for found in importlib.metadata.distributions() for entry in found.entry_points)
others = [entry for entry in entries if not entry.group.startswith("teleop_")]
importlib.metadata.entry_points = importlib.metadata.EntryPoints(others).select
from teleop_core.commands import cli

sys.exit(cli.main(sys.argv[1:]))
"""
"""Command of the core, as if none of the others were installed."""


def alone(*words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    done = subprocess.run([sys.executable, "-c", ALONE, *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    return done


@pytest.fixture
def entries(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Replace the installed commands: ``entries(polish="module:polish")``."""

    def replace(**places: str) -> None:
        found = [EntryPoint(name, place, cli.GROUP) for name, place in places.items()]
        monkeypatch.setattr(
            "importlib.metadata.entry_points",
            lambda **which: found if which == {"group": cli.GROUP} else entry_points(**which),
        )

    return replace


@pytest.mark.slow
def test_core_alone_runs_replays_and_scores_a_session(tmp_path: Path) -> None:
    alone("sim", "--duration", 1, "--out", tmp_path / "bag")
    alone("replay", tmp_path / "bag", "--out", tmp_path / "again")
    scores = tmp_path / "scores.json"
    alone("evaluate", tmp_path / "bag", tmp_path / "again", "--json", scores)
    assert "position_error_mm" in scores.read_text()


OTHERS = [
    (name, package)
    for module, commands in cli.COMMANDS.items()
    for name in commands
    if (package := module.partition(".")[0]) != "teleop_core"
]


@pytest.mark.parametrize(("name", "distribution"), OTHERS)
def test_command_of_a_missing_distribution_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str, distribution: str
) -> None:
    monkeypatch.setattr(cli, "find_spec", lambda package: None if package == distribution else find_spec(package))
    assert cli.main([name, "--list"]) == 2
    text = f"teleop {name}: install {distribution}, which has this command\n"
    assert capsys.readouterr().err == text


def test_robot_of_a_missing_distribution_says_what_to_install() -> None:
    text = "robot 'stewart' must be installed; it is in the distribution teleop_machines"
    assert alone("robot", "stewart", code=2).stderr == f"teleop robot: {text}\n"
    assert "stewart" not in alone("robot").stdout


def test_scene_without_its_distribution_says_what_to_install() -> None:
    text = "reader of scenes 'scene' must be installed; it is in the distribution teleop_scene"
    assert alone("robot", "cubes.xml", code=2).stderr == f"teleop robot: {text}\n"


def test_robots_of_the_machines_are_those_that_the_core_knows_to_be_there() -> None:
    found = {entry.name for entry in entry_points(group=ROBOTS.group)}
    assert found == set(ROBOTS.elsewhere)
    assert set(ROBOTS.elsewhere.values()) == {"teleop_machines"}


def test_the_list_of_commands_shows_the_first_line_of_each_docstring() -> None:
    app = cli.application()
    for commands in cli.COMMANDS.values():
        for name, text in commands.items():
            assert app[name].help.splitlines()[0] == f"{text}."


def test_core_alone_names_what_reads_recordings_of_others(tmp_path: Path) -> None:
    (tmp_path / "hand.csv").write_text("t,x,y,z\n0,0,0,0\n1,0,0,0\n", encoding="utf-8")
    done = alone("replay", tmp_path / "hand.csv", "--out", tmp_path / "out", code=2)
    assert "install teleop_exchange" in done.stderr


def test_core_alone_names_what_makes_pages(tmp_path: Path) -> None:
    done = alone("evaluate", "bags/example", "--html", tmp_path / "page.html", code=2)
    assert done.stderr == "teleop evaluate: --html needs the distribution teleop_console: install it\n"


def test_commands_of_this_project_ask_no_installed_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "installed", lambda: pytest.fail("looked for installed commands"))
    assert cli.main(["scenarios"]) == 0
    assert "coarse_box" in capsys.readouterr().out


POLISH = '''
def polish(cloth: str, /, *, strokes: int = 3) -> int:
    """Polish the arm.

    Args:
        cloth: The cloth.
        strokes: Number of strokes.
    """
    print(f"{strokes} strokes with {cloth}")
    return 4
'''


def test_function_of_an_installed_package_is_a_command(
    entries: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "polishing.py").write_text(POLISH, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    entries(polish="polishing:polish", broken="no_such_module:run")
    assert cli.main(["polish", "silk", "--strokes", "7"]) == 4
    assert cli.main(["--help"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("7 strokes with silk\n")
    assert re.search(r"^  polish +Polish the arm$", told, re.MULTILINE)
    assert re.search(r"^  broken +cannot be loaded from no_such_module:run", told, re.MULTILINE)


def test_command_that_cannot_be_loaded_is_named_and_the_others_work(
    entries: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    entries(broken="no_such_module:run")
    assert cli.main(["drill", "--list"]) == 0
    captured = capsys.readouterr()
    assert "kill_motion_scaling" in captured.out
    assert captured.err == ""
    assert cli.main(["broken"]) == 2
    assert capsys.readouterr().err == (
        "teleop broken: cannot be loaded from no_such_module:run: "
        "ModuleNotFoundError: No module named 'no_such_module'\n"
    )


def test_installed_command_does_not_replace_one_of_the_project(
    entries: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    entries(scenarios="no_such_module:run", drill="no_such_module:run")
    assert cli.main(["scenarios"]) == 0
    assert cli.main(["drill", "--list"]) == 0
    assert capsys.readouterr().err == ""
