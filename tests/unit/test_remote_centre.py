"""Remote centre of motion: the tool passes through one place, whatever the hand does."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import teleop_core as tc
from present import present
from teleop_core.coupling.fixtures.remote_centre import RemoteCentreParameters, RunningRemoteCentre
from teleop_core.graph.signals import TICK_NS
from teleop_core.kernels.geometry import Array

Z = np.array([0.0, 0.0, 1.0])


def led(poses: Array, **parameters: Any) -> tuple[Array, Array]:
    """Poses (N, 7) of a centre's answers to commands (N, 7), and the centre."""
    stage = RunningRemoteCentre(RemoteCentreParameters(**parameters))
    step, signals = stage.load(), stage.signals
    answers = np.empty((len(poses), 7))
    for i, pose in enumerate(poses):
        signals["slave_servo_cp"], signals["slave_servo_cp_ns"] = pose, (i + 1) * TICK_NS
        step()
        answers[i] = signals["remote_centre_servo_cp"]
    return answers, np.array(signals["remote_centre_place"])[:3]


def turned(poses: Array) -> Rotation:
    return Rotation.from_quat(poses[:, 3:7], scalar_first=True)


def pose(p: Array, rotation: Rotation) -> Array:
    return np.concatenate((p, rotation.as_quat(scalar_first=True)), axis=-1)


def walk(seed: int, count: int = 2000, speed: float = 0.05) -> Array:
    """A hand that wanders about a place, and turns as it likes."""
    rng = np.random.default_rng(seed)
    ways = np.cumsum(rng.normal(0.0, 1.0, (count, 3)), axis=0) * speed * 1e-3
    turns = np.cumsum(rng.normal(0.0, 1e-3, (count, 3)), axis=0)
    return pose(np.array([0.4, 0.1, -0.2]) + ways, Rotation.from_rotvec(turns))


def beside(poses: Array, centre: Array, shaft: Array = Z) -> Array:
    """Distances (N,) from a centre to the lines of the shafts."""
    axes = turned(poses).apply(shaft)
    return np.linalg.norm(np.cross(poses[:, :3] - centre, axes), axis=1)


@pytest.mark.parametrize("seed", range(2))
def test_the_shaft_passes_through_the_centre_and_the_tip_goes_where_it_is_led(seed: int) -> None:
    poses = walk(seed)
    answers, centre = led(poses, turn_speed=100.0)
    np.testing.assert_allclose(centre, poses[0, :3] - 0.1 * turned(poses)[0].apply(Z), atol=1e-15)
    np.testing.assert_allclose(answers[0], poses[0], atol=1e-15)
    assert beside(answers, centre).max() < 1e-14
    np.testing.assert_allclose(answers[:, :3], poses[:, :3], atol=1e-14)


@pytest.mark.parametrize("seed", range(2))
def test_wherever_a_command_jumps_the_tool_turns_no_faster_than_it_may_and_stays_in_the_port(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = walk(seed)
    poses[:, :3] = rng.uniform(-0.3, 0.3, (len(poses), 3))  # beside, behind, at the centre
    centre = np.zeros(3)
    poses[::7, :3] = centre
    answers, _ = led(poses, place=(0.0, 0.0, 0.0), least_depth=0.02, turn_speed=3.0, begin_time=0.0)
    assert beside(answers, centre).max() < 1e-13
    depth = np.linalg.norm(answers[:, :3], axis=1)
    assert depth.min() >= 0.02 * (1.0 - 1e-12)
    ways = answers[:, :3] / depth[:, None]
    sines = np.linalg.norm(np.cross(ways[1:], ways[:-1]), axis=1)
    assert np.arcsin(sines).max() <= 3.0 * 1e-3 * (1.0 + 1e-9)
    assert (ways[1:] * ways[:-1]).sum(axis=1).min() > 0.0


def test_a_tool_that_is_pulled_out_stays_in_the_port_at_its_least_depth() -> None:
    start = pose(np.array([0.0, 0.0, 0.1]), Rotation.identity())
    poses = np.tile(start, (3000, 1))
    poses[:, 2] = np.linspace(0.1, -0.2, len(poses))
    answers, _ = led(poses)
    np.testing.assert_allclose(answers[:, 2], np.maximum(poses[:, 2], 0.01), atol=1e-15)
    np.testing.assert_allclose(answers[:, 3:7], poses[:, 3:7], atol=1e-15)


def test_a_tool_that_does_not_point_away_from_its_centre_is_turned_so_without_a_jump() -> None:
    start = pose(np.array([0.1, 0.0, 0.1]), Rotation.identity())
    poses = np.tile(start, (1500, 1))
    answers, _ = led(poses, place=(0.0, 0.0, 0.0), begin_time=1.0)
    np.testing.assert_allclose(answers[0], start, atol=1e-15)
    np.testing.assert_allclose(answers[:, :3], poses[:, :3], atol=1e-15)
    turns = (turned(answers[1:]) * turned(answers[:-1]).inv()).magnitude()
    assert turns.max() < 1.6 * (np.pi / 4) * 1e-3  # 1.5 of the mean: eased in and out
    assert beside(answers[1001:], np.zeros(3)).max() < 1e-14


@pytest.mark.parametrize("angle", [-1.5, 0.3, 3.0])
def test_the_hand_turns_the_tool_about_its_shaft_as_it_likes(angle: float) -> None:
    base = pose(np.array([0.03, -0.02, 0.1]), Rotation.from_rotvec([0.2, -0.1, 0.0]))
    other = pose(base[:3], turned(base[None])[0] * Rotation.from_rotvec(angle * Z))
    answers, centre = led(np.array([base, base, other]), place=(0.0, 0.0, 0.0), begin_time=0.0)
    turn = turned(answers[1:2])[0].inv() * turned(answers[2:3])[0]
    np.testing.assert_allclose(turn.as_rotvec(), angle * Z, atol=1e-12)
    assert beside(answers, centre).max() < 1e-15


def test_another_shaft_passes_through_the_centre_as_well() -> None:
    shaft = np.array([1.0, 0.0, 2.0])
    answers, centre = led(walk(1), shaft=tuple(shaft), turn_speed=100.0)
    assert beside(answers, centre, shaft / np.linalg.norm(shaft)).max() < 1e-13


def test_a_session_keeps_the_tool_in_its_port_and_scores_by_how_much_it_does() -> None:
    free = tc.run("coarse_box", duration=8.0)
    assert free.score().value("remote_centre.off_rms_mm") is None
    kept = tc.run("coarse_box", duration=8.0, stages=["network", "passivity", "remote_centre"])
    score = kept.score()
    place = kept["remote_centre/place"].values[0]
    poses = kept["slave/measured_cp"].values[4000:, :7]
    off = 1e3 * beside(poses, place[:3])
    assert score.value("remote_centre.off_max_mm") == pytest.approx(off.max(), rel=0.3)
    assert 0.0 < present(score.value("remote_centre.off_rms_mm")) < 0.6
    wandering = free["slave/measured_cp"].values[4000:, :7]
    assert 1e3 * beside(wandering, place[:3]).max() > 5.0  # without it
