"""Evaluation follows the graph that a recording was made with: its chain, topics and stamps."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from present import present
from recipes import Recipe, pose_rows, terminal
from teleop_core.base import NoParameters
from teleop_core.evaluation.command import evaluate_bags
from teleop_core.evaluation.origin import read_origin
from teleop_core.evaluation.scoring import evaluate
from teleop_core.graph import TICK_NS, Stage, build_graph, register_stage
from teleop_core.graph.topics import (
    MASTER_MEASURED_CP,
    SLAVE_MEASURED_CP,
    SLAVE_SERVO_CP,
    SLAVE_SERVO_JP,
    SLAVE_SETPOINT_JS,
    Kind,
    Topic,
    passed_on,
)

BUILT_IN = ["haptic_master", "motion_scaling", "inverse_kinematics", "slave", "slave_sim"]
SMOOTH_CP = Topic("slave/smooth_cp", Kind.POSE, passed_on("slave/servo_cp"), "slave_base")
NOISE_CV = Topic("slave/noise_cv", Kind.TWIST)
SMOOTHER = Stage(
    "smoother",
    NoParameters,
    reads=(SLAVE_SERVO_CP,),
    writes=(SMOOTH_CP, NOISE_CV),
    step=lambda parameters, state, signals, dt: None,
    replaces=SLAVE_SERVO_CP,
    trigger=SLAVE_SERVO_CP,
)


def configuration(**session: int | list[str]) -> str:
    return yaml.safe_dump({"teleop": {"ros__parameters": session}})


@pytest.fixture
def recipe() -> Recipe:
    """A recording of a session with a stage of a user; each answer 0.1 ms after its question."""
    made = Recipe(2000)
    made.topics += [SMOOTH_CP, NOISE_CV]
    made.metadata["configuration"] = configuration(stages=["smoother"])
    poses, joints = pose_rows(2000), np.zeros((2000, 6))
    way = {
        MASTER_MEASURED_CP: poses,
        SLAVE_SERVO_CP: poses,
        SMOOTH_CP: poses,
        SLAVE_SERVO_JP: joints,
        SLAVE_SETPOINT_JS: joints,
    }
    for place, (topic, rows) in enumerate(way.items(), start=1):
        made.rows[topic] = (made.stamps, rows, made.stamps + place * 100_000)
    return made


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "bag"


@pytest.fixture
def _smoother(own_parts: None) -> None:
    register_stage(SMOOTHER)


@pytest.mark.usefixtures("_smoother")
def test_stage_of_a_user_has_its_own_latency(recipe: Recipe, path: Path) -> None:
    latency = evaluate(recipe.write(path)).latency_ms
    assert list(latency) == [*BUILT_IN[:2], "smoother", *BUILT_IN[2:4], "total"]
    medians: Any = [delay.median for delay in latency.values()]
    assert np.allclose(medians, [0.1, 0.1, 0.1, 0.1, 0.1, 0.5])


@pytest.mark.usefixtures("_smoother")
def test_table_and_page_show_the_stage_of_a_user(recipe: Recipe, path: Path, tmp_path: Path) -> None:
    recipe.write(path)
    shown = terminal()
    evaluate_bags([path], None, tmp_path / "page.html", shown)
    lines = [text.split() for text in shown.export_text().splitlines()]
    assert ["smoother", "ms", "0.10/0.10/0.10"] in lines
    assert '"name": "smoother"' in (tmp_path / "page.html").read_text()


@pytest.mark.usefixtures("_smoother")
def test_gaps_of_a_topic_of_a_user_are_counted(recipe: Recipe, path: Path) -> None:
    recipe.drop(SMOOTH_CP, [100, 101, 500])
    score = evaluate(recipe.write(path))
    assert (score.topics["slave/smooth_cp"].count, score.topics["slave/smooth_cp"].gaps) == (1997, 3)
    assert score.topics["slave/servo_cp"].gaps == 0


@pytest.mark.usefixtures("_smoother")
def test_a_recording_that_lacks_many_messages_is_told_so_first(recipe: Recipe, path: Path) -> None:
    recipe.drop(SMOOTH_CP, range(100, 300))
    verdict = evaluate(recipe.write(path)).verdict
    assert "200 messages missing" in verdict.text


@pytest.mark.usefixtures("_smoother")
def test_only_a_stamp_that_is_passed_on_may_come_again_for_one_that_was_lost(recipe: Recipe, path: Path) -> None:
    stamps = recipe.stamps.copy()
    stamps[700] = stamps[699]
    recipe.rows[SMOOTH_CP] = (stamps, pose_rows(2000), recipe.stamps)
    recipe.rows[NOISE_CV] = (stamps, np.zeros((2000, 6)), recipe.stamps)
    topics = evaluate(recipe.write(path)).topics
    assert topics["slave/smooth_cp"].gaps == 0
    assert topics["slave/noise_cv"].gaps == 1


def test_stage_that_is_not_installed_leaves_the_built_in_ones(recipe: Recipe, path: Path) -> None:
    score = evaluate(recipe.write(path))
    assert list(score.latency_ms) == [*BUILT_IN[:4], "total"]
    assert np.isclose(present(score.latency_ms["inverse_kinematics"].median), 0.2)
    assert score.topics["slave/smooth_cp"].count == 2000
    assert score.topics["slave/smooth_cp"].gaps is None


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "- 1",
        "teleop: 3",
        "slave_sim: {ros__parameters: {}}\nunknown: {ros__parameters: {}}",
        configuration(stages=["smoother"]),
        configuration(delays=["slave/smooth_cp=0.1"]),
        configuration(arms=["a", "a"]),
        configuration(arms=3),
    ],
)
def test_graph_that_cannot_be_built_is_that_of_the_built_in_stages(recipe: Recipe, path: Path, text: str) -> None:
    recipe.metadata["configuration"] = text
    assert read_origin(recipe.write(path)).graph == build_graph()


def test_delays_of_links_in_a_row_add_up_along_the_chain(recipe: Recipe, path: Path) -> None:
    links = ["slave/servo_cp=0.03", "slave/servo_jp=0.02", "slave/measured_cf=0.5"]
    recipe.metadata["configuration"] = configuration(delays=links)
    assert read_origin(recipe.write(path)).chain_delay == pytest.approx(0.05)


def test_settings_of_the_graph_are_those_of_the_recording(recipe: Recipe, path: Path) -> None:
    recipe.metadata["configuration"] = configuration(
        arms=["right", "left"], delays=["slave/servo_jp=0.02"], former_parameter=1
    )
    origin = read_origin(recipe.write(path))
    assert origin.graph == build_graph(["right", "left"], (), ["slave/servo_jp=0.02"])
    assert not [topic for topic in origin.streams if topic.arm]
    assert [stage for stage, _ in origin.chain] == BUILT_IN[:4]
    assert origin.writer(SLAVE_MEASURED_CP) == "slave"
    assert origin.writer(SMOOTH_CP) == ""


def test_command_that_nobody_sent_does_not_count_in_the_total(recipe: Recipe, path: Path) -> None:
    stamps, rows, logs = recipe.rows[SLAVE_SETPOINT_JS]
    stamps = stamps.copy()
    stamps[:50] = np.arange(1, 51) * TICK_NS  # of a session before
    recipe.rows[SLAVE_SETPOINT_JS] = (stamps, rows, logs)
    assert np.isclose(present(evaluate(recipe.write(path)).latency_ms["total"].max), 0.5)
