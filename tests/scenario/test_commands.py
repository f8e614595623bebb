"""Every command that a user types, from end to end, with right and with wrong use."""

import json
import math
import os
import pty
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml
from numba.core import event

from one_line import COMPILING, one_line
from present import present
from teleop_core.bags.reader import Bag
from teleop_core.bags.writer import BagWriter
from teleop_core.commands import cli
from teleop_core.commands import progress as commands_progress
from teleop_core.commands.progress import Progress, say_work, shown_progress
from teleop_core.graph import topics
from teleop_core.robots import load_robot

if TYPE_CHECKING:
    from conftest import Run


def lead() -> int:
    """Ticks in which the slave moves from home to where it starts, at half of its speed limits.

    A cubic move is 1.5 times as fast in its middle as it is on average.
    """
    robot = load_robot("rcrt1")
    times = 1.5 * np.abs(robot.start - robot.home) / (0.5 * present(robot.drives).speed_limit)
    return math.ceil(times.max() / 1e-3)


# Of the recording: that move, and then twelve seconds of the hand.
TICKS = lead() + 12_000


def test_sim_records_every_stream_at_1_khz(recording: Path) -> None:
    bag = Bag(recording)
    for topic in topics.STREAMS:
        assert bag.topics[topic.name].count == TICKS


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_seed_does_not(teleop: "Run", tmp_path: Path) -> None:
    bytes_of = []
    for folder, seed in (("a", 3), ("b", 3), ("c", 4)):
        out = tmp_path / folder / "bag"
        teleop("sim", "--scenario", "coarse_box", "--duration", 2, "--seed", seed, "--out", out)
        bytes_of.append((out / "bag_0.mcap").read_bytes())
    assert bytes_of[0] == bytes_of[1]
    assert bytes_of[0] != bytes_of[2]


def test_replay_with_the_same_configuration_is_bit_identical(teleop: "Run", recording: Path, tmp_path: Path) -> None:
    teleop("replay", recording, "--out", tmp_path / "again")
    first, again = Bag(recording), Bag(tmp_path / "again")
    for topic in topics.STREAMS:
        a, b = first.read(topic), again.read(topic)
        assert np.array_equal(a.values, b.values), topic.name
        assert np.array_equal(a.stamp_ns, b.stamp_ns), topic.name


def test_replay_with_another_configuration_answers_what_if(
    teleop_again: "Run", recording: Path, tmp_path: Path
) -> None:
    teleop_again("replay", recording, "--out", tmp_path / "what_if", "--set", "fine_gain=0.5")
    first, other = Bag(recording), Bag(tmp_path / "what_if")
    assert np.array_equal(first.read(topics.MASTER_MEASURED_CP).values, other.read(topics.MASTER_MEASURED_CP).values)
    a, b = (bag.read(topics.SLAVE_MEASURED_CP).values for bag in (first, other))
    before_fine = slice(0, lead() + 5900)
    assert np.array_equal(a[before_fine], b[before_fine])
    assert np.abs(a - b).max() > 1e-3


def test_a_recording_stores_what_repeats_it(recording: Path) -> None:
    metadata = Bag(recording).metadata
    stored = yaml.safe_load(metadata["configuration"])
    assert metadata["scenario"] == "mode_switching"
    assert metadata["robot"] == "rcrt1"
    assert metadata["seed"] == "1"
    assert stored["operator"]["ros__parameters"]["buttons.fixture"] == [2.0, 11.0]


def test_state_reports_every_change_of_clutch_mode_and_box(recording: Path) -> None:
    reports = Bag(recording).reports(topics.TELEOP_STATE)
    told = [(r.stamp_ns, r.message) for r in reports]
    assert told[0][1].startswith("ALIGNING")
    begin_ns, message = told[1]
    assert message == "FOLLOWING coarse"
    assert begin_ns * 1e-9 == pytest.approx(lead() * 1e-3, abs=5e-3)
    at = {round((stamp_ns - begin_ns) * 1e-9, 1): message for stamp_ns, message in told}
    assert "box on" in at[2.0]
    assert at[4.0].startswith("CLUTCHED")
    assert at[5.0].startswith("FOLLOWING")
    assert "fine" in at[6.0]
    assert "coarse" in at[9.0]
    assert "box" not in at[11.0]


def test_evaluate_prints_a_table_and_writes_json_and_page(teleop_again: "Run", recording: Path, tmp_path: Path) -> None:
    scores, page = tmp_path / "scores.json", tmp_path / "page.html"
    done = teleop_again("evaluate", recording, "--json", scores, "--html", page)
    assert "position, RMS mm" in done.stdout
    assert "ideal plant" in done.stdout
    assert "0.338" not in done.stdout  # no machine beside an ideal arm
    text = scores.read_text()
    assert "NaN" not in text
    assert "rms" in text
    json.loads(text)
    assert "<html" in page.read_text()[:500].lower()


def make_foreign(path: Path) -> None:
    with BagWriter(path, [topics.MASTER_BUTTONS], ()) as writer:
        stamps = np.array([1, 2])
        writer.write_block({topics.MASTER_BUTTONS: (stamps, np.zeros((2, 3)), stamps)})


def test_replay_and_evaluate_name_what_a_bag_lacks(teleop_again: "Run", tmp_path: Path) -> None:
    make_foreign(tmp_path / "foreign")
    replay, evaluate = ("replay", "--out", tmp_path / "out"), ("evaluate",)
    for command, lacking in ((replay, "no topic of poses"), (evaluate, "measured_cp")):
        line = one_line(teleop_again(command[0], tmp_path / "foreign", *command[1:], code=2))
        assert lacking in line
        assert "master/buttons" in line
    assert not (tmp_path / "out").exists()


def test_lookups_answer_without_a_session(teleop_again: "Run") -> None:
    assert "coarse_box" in teleop_again("scenarios").stdout
    assert "motion_scaling.fine_gain" in teleop_again("parameters").stdout
    assert "slave_sim" not in teleop_again("parameters", "motion_scaling").stdout
    assert teleop_again("parameters", "--markdown").stdout.startswith("| parameter")
    assert "rcrt1" in teleop_again("robot").stdout
    assert "theta2" in teleop_again("robot", "rcrt1").stdout


def test_help_imports_no_command_and_nothing_that_takes_long(teleop: "Run") -> None:
    code = "import sys; from teleop_core.commands import cli; cli.main(['--help'])"
    done = subprocess.run([sys.executable, "-X", "importtime", "-c", code], capture_output=True, text=True, check=False)
    assert "COMMAND" in done.stdout
    for module in ("numba", "numpy", "rich", "cyclopts", "yaml", "teleop_core.commands.sessions", "teleop_lab"):
        assert f" {module}\n" not in done.stderr


def test_words_become_typed_options_in_any_order() -> None:
    words = (
        "--parts mine.py sim --set a=1 b=[1,-2] --config x.yaml --set c=-3 --config y.yaml --robot puma560 --out new"
    )
    call = cli.parse([*words.split(), "--geometry", "d1=0.1", "--parts", "more.py", "--duration", "-1"])
    assert call is not None
    settings = call.arguments.arguments["settings"]
    assert call.parts == (Path("mine.py"), Path("more.py"))
    assert call.arguments.arguments["duration"] == -1.0
    assert settings.config == (Path("x.yaml"), Path("y.yaml"))
    assert settings.texts == [
        "robot=puma560", "geometry=[]", "slave.start=[]", 'geometry=["d1=0.1"]', "a=1", "b=[1,-2]", "c=-3"
    ]  # fmt: skip


@pytest.mark.slow
def test_progress_shows_on_a_terminal_and_not_in_a_pipe(teleop: "Run", tmp_path: Path) -> None:
    piped = teleop("sim", "--duration", 1, "--out", tmp_path / "piped")
    assert "simulating" not in piped.stderr
    reader, terminal = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "teleop_core.commands.cli", "sim", "--duration", "1", "--out", str(tmp_path / "seen")],
        stderr=terminal,
        stdout=subprocess.DEVNULL,
    )
    os.close(terminal)
    shown = b""
    try:
        while part := os.read(reader, 4096):
            shown += part
    except OSError:  # the terminal closed with the process
        pass
    assert process.wait(timeout=60) == 0
    assert b"simulating" in shown


def test_compiling_is_told_while_something_compiles_and_at_no_other_time(capsys: pytest.CaptureFixture[str]) -> None:
    assert not say_work()
    assert capsys.readouterr().err == ""
    with event.trigger_event("numba:compile"):  # what numba itself does around its compiler
        assert say_work()
    assert capsys.readouterr().err == f"{COMPILING}, once …\n"


def test_long_work_without_a_terminal_says_how_far_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with shown_progress("study") as progress:
        progress(1, 4)
    monkeypatch.setattr(commands_progress, "EVERY", 0.0)
    with shown_progress("study") as progress:
        progress(1, 4)
    assert capsys.readouterr().err == "study: 25 % after 0 s\n"


def test_sessions_of_an_experiment_are_counted() -> None:
    progress = Progress()
    for done in (1, 5, 10, 1, 10, 3):
        progress(done, 10)
    assert progress.sessions == 3


def test_the_shell_completes_commands_and_options(tmp_path: Path) -> None:
    script = tmp_path / "teleop"
    script.write_text(cli.application().generate_completion(shell="bash"), encoding="utf-8")
    for line, expected in (("teleop ev", "evaluate"), ("teleop import --uni", "--unit")):
        last = len(line.split()) - 1
        ask = f"source {script}; COMP_WORDS=({line}); COMP_CWORD={last}; _teleop; echo ${{COMPREPLY[@]}}"
        done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True, timeout=60)
        assert expected in done.stdout.split()
