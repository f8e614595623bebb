"""What a session tells of parts of one's own: NaN, misspelt fields, answers that nobody reads."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.graph import TICK_NS, topics
from teleop_core.session import configuration, virtual

if TYPE_CHECKING:
    from conftest import Run

ANSWER = tc.Topic("test/answer", tc.Kind.POSE, topics.passed_on("slave/servo_cp"))


def stage(step: Callable[[object, object, object, float], None]) -> tc.Stage:
    """Stage that answers every pose commanded; always the same graph, compiled once."""
    made = tc.Stage("own", tc.NoParameters, (topics.SLAVE_SERVO_CP,), (ANSWER,), step, trigger=topics.SLAVE_SERVO_CP)
    return tc.register_stage(made)


def session(step: Callable[[object, object, object, float], None]) -> virtual.VirtualTime:
    return virtual.VirtualTime(configuration.configure(settings=[f"teleop.stages=[{stage(step).name}]"]))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_stage_that_writes_no_number_ends_the_session_with_topic_and_time(own_parts: None, value: float) -> None:
    def fails(p: Any, s: Any, row: Any, dt: float) -> None:
        row.test_answer[2] = value if row.now_ns > 5 * TICK_NS else 0.0

    told = "^stage 'own' must be one that writes finite numbers; test/answer at 0.006 s is not"
    with pytest.raises(tc.PartError, match=told):
        session(fails).run(10)


def test_misspelt_field_in_a_plain_stage_is_told_with_the_near_one_and_the_line(own_parts: None) -> None:
    def misspells(p: Any, s: Any, row: Any, dt: float) -> None:
        row.test_answer[0] = row.slave_servo_pc[0]

    line = misspells.__code__.co_firstlineno + 1
    told = rf"'slave_servo_pc'; did you mean 'slave_servo_cp'\?.*_sessions\.py:{line}\)$"
    with pytest.raises(tc.PartError, match=told):
        session(misspells).run(1)


def copies(p: Any, s: Any, row: Any, dt: float) -> None:
    row.test_answer[:] = row.slave_servo_cp


FORGETFUL = """
import teleop_core as tc
from beside import NAME
from teleop_core.graph.topics import SLAVE_SERVO_CP, passed_on


def copies(p, s, row, dt):
    row.test_answer[:] = row.slave_servo_cp


TOPIC = tc.Topic("test/answer", tc.Kind.POSE, passed_on("slave/servo_cp"))
tc.register_stage(
    tc.Stage(NAME, tc.NoParameters, (SLAVE_SERVO_CP,), (TOPIC,), copies, trigger=SLAVE_SERVO_CP)
)
"""


@pytest.fixture
def forgetful(tmp_path: Path) -> Path:
    """File with a stage, which takes its name from a file beside it."""
    (tmp_path / "beside.py").write_text("NAME = 'own'\n")
    (tmp_path / "parts.py").write_text(FORGETFUL)
    return tmp_path / "parts.py"


def test_file_of_parts_takes_what_stands_beside_it_before_and_after_the_command(
    teleop_again: "Run", forgetful: Path, tmp_path: Path
) -> None:
    text = "import teleop_core as tc\n\ntc.register_operator('still', lambda t: 0.0 * t)\n"
    (tmp_path / "more.py").write_text(text)
    first, second = forgetful, tmp_path / "more.py"
    for arguments in (
        ["--parts", first, "--parts", second, "parts"],
        ["--parts", first, "parts", "--parts", second],
        ["parts", "--parts", first, "--parts", second],
    ):
        listed = teleop_again(*arguments).stdout.split()
        assert {"own", "still"} <= {name.strip(",") for name in listed}
        assert {"tremor_filters", "world_objects", "metrics"} <= set(listed)


@pytest.mark.slow
def test_command_notes_an_answer_that_nobody_reads_and_scores_without_its_file(
    teleop: "Run", forgetful: Path, tmp_path: Path
) -> None:
    out, scores = tmp_path / "bag", tmp_path / "scores.json"
    done = teleop("sim", "--parts", forgetful, "--duration", 0.5, "--out", out, "--set", "stages=[own]")
    notes = [line for line in done.stderr.splitlines() if not line.startswith("compiling kernels")]
    (note,) = notes
    assert note.startswith("note: stage 'own' writes test/answer, which no stage reads; with replaces=")
    teleop("evaluate", out, "--json", scores)
    assert "own" not in json.loads(scores.read_text())[0]["latency_ms"]
