"""Reach: what it says of people's motions is what sessions do, and what it proposes is followed."""

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

import teleop_core as tc
import teleop_lab as lab
from people import PEOPLE, moves, person, recorded, saved
from present import present
from teleop_core.graph.topics import Limit
from teleop_core.robots.bodies import urdf_of
from teleop_lab.planning.placement import Placement

if TYPE_CHECKING:
    from conftest import Run

# A walk has no slave that lags, and ticks of sessions take stamps together that are closer than
# 1 ms: of some thousand samples a few are told otherwise.
AGREE = 0.005
# Ten products of numbers of size one [m or rad].
ROUNDING = 1e-9
SECONDS = 25.0
ROBOTS = ("rcrt1", "puma560")


def followed(session: tc.Recording) -> float:
    """Share of the time in which a recorded session followed."""
    told = session["slave/reach"]
    held = np.diff(told.stamp_ns, append=2 * told.stamp_ns[-1] - told.stamp_ns[-2])
    return float(held[told["limit"] == Limit.NONE].sum() / held.sum())


@cache
def proposed(name: str, robot: str, seconds: float) -> lab.Reach:
    """Answer for a person, looked for once: it takes seconds."""
    return lab.reach(person(name, seconds), robot=robot)


ALIGNED: dict[str, Any] = {"motion_scaling.tool_axes": ["+x", "-y", "-z"]}
"""Stylus and tool are aligned as is published for the RCRT-1, which suits no other arm."""
GAINS: dict[str, Any] = {"coarse_gain": 0.3, "fine_gain": 0.1}
MODELS = {name: pinocchio.buildModelFromXML(urdf_of(tc.load_robot(name))) for name in ROBOTS}


def tips(robot: str, joints: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """Places (N, 3) and attitudes of the tip by pinocchio."""
    model, found = MODELS[robot], []
    data, frame = model.createData(), model.getFrameId("tip")
    for q in joints:
        pinocchio.framesForwardKinematics(model, data, q)
        found.append(data.oMf[frame].copy())
    turns = Rotation.from_matrix(np.array([T.rotation for T in found]))
    return np.array([T.translation for T in found]), turns


def asked(robot: str, placement: Placement, poses: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """The definition for an aligned tool: steps of the hand times the gain; turns of the stylus in its own axes."""
    place, attitude = tips(robot, np.array([placement.start]))
    moved = (poses[:, :3] - poses[0, :3]) @ picked(placement.axes).T
    hand = Rotation.from_quat(poses[:, [4, 5, 6, 3]])
    tool = Rotation.from_matrix(picked(placement.tool_axes).T)
    tool *= Rotation.from_rotvec([0.0, 0.0, placement.tool_roll])
    turned = tool.inv() * (hand[0].inv() * hand) * tool
    return place + placement.coarse_gain * moved, attitude * turned


def picked(axes: tuple[str, ...]) -> np.ndarray:
    """Rotation whose rows pick axes by their names."""
    matrix = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        matrix[row, "xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return matrix


@pytest.mark.parametrize(("name", "robot"), list(zip(PEOPLE, 2 * ROBOTS, strict=True)))
def test_a_proposal_is_followed_by_the_session_as_it_says(name: str, robot: str) -> None:
    reach = proposed(name, robot, SECONDS)
    assert reach.proposed.share >= reach.goal == 0.99
    session = tc.replay(person(name, SECONDS), robot=robot, settings=reach.settings())
    assert abs(followed(session) - reach.proposed.share) <= AGREE
    assert followed(session) >= 0.985
    assert abs(present(session.score().value("reach.followed_share")) - followed(session)) <= AGREE


@pytest.mark.parametrize(("name", "robot"), list(zip(PEOPLE, 2 * ROBOTS[::-1], strict=True)))
def test_a_session_as_given_follows_as_little_as_it_says(name: str, robot: str) -> None:
    hand = person(name, SECONDS, seed=3)
    reach = lab.reach(hand, robot=robot, share=1e-3, settings=ALIGNED)  # nothing is to be proposed
    assert reach.given.share < 0.995
    session = tc.replay(hand, robot=robot, settings=ALIGNED)
    assert abs(followed(session) - reach.given.share) <= AGREE
    told = session["slave/reach"]["limit"]
    for cause, share in reach.given.session.causes.items():
        assert abs(float((told == Limit[cause.upper()]).mean()) - share) <= 2 * AGREE


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_share_in_place_is_that_of_poses_which_pinocchio_finds_reached(robot: str) -> None:
    stamps, poses = moves(PEOPLE["da_vinci_36"], SECONDS, seed=5)
    reach = lab.reach(recorded(stamps, poses), robot=robot, share=1e-3, settings=GAINS | ALIGNED)
    walked, arm = reach.given.in_place, tc.load_robot(robot)
    places, attitudes = asked(robot, reach.given.placement, poses)
    reached, held = tips(robot, walked.q)
    off = np.linalg.norm(places - reached, axis=1)
    turned = (attitudes.inv() * held).magnitude()
    is_reached = (off <= 1e-7) & (turned <= 1e-7)
    assert ((arm.lower <= walked.q) & (walked.q <= arm.upper)).all()
    np.testing.assert_array_equal(walked.limit == Limit.NONE, is_reached)
    np.testing.assert_allclose(walked.residual, np.stack((off, turned), axis=1), atol=1e-7)
    assert 0.2 < reach.given.in_place.share < 0.98


def test_a_hand_in_the_clutch_moves_nothing() -> None:
    stamps, poses = moves(PEOPLE["pen"], 4.0)
    pressed = np.zeros((len(stamps), 3))
    pressed[500:1800, 0] = 1.0
    walked = lab.reach(recorded(stamps, poses, pressed), robot="puma560", share=1e-3).given.session
    held = walked.asked[500:1801]
    np.testing.assert_allclose(held, np.broadcast_to(held[0], held.shape), atol=ROUNDING)
    assert np.ptp(walked.asked[1801:, :3], axis=0).max() > 0.01


def test_fine_mode_takes_the_fine_gain() -> None:
    stamps, poses = moves(PEOPLE["pen"], 4.0)
    poses[:, 3:] = poses[0, 3:]
    pressed = np.zeros((len(stamps), 3))
    pressed[:50, 2] = 1.0  # the first sample has no edge before it
    reach = lab.reach(recorded(stamps, poses, pressed), robot="puma560", share=1e-3)
    walked, axes = reach.given.in_place, ((2, -1.0), (0, -1.0), (1, 1.0))
    moved = np.stack([sign * (poses[:, axis] - poses[0, axis]) for axis, sign in axes], axis=1)
    np.testing.assert_allclose(walked.asked[:, :3] - walked.asked[0, :3], 0.1 * moved, atol=ROUNDING)


def test_the_tool_turns_about_the_axes_of_the_hand_but_for_the_misfit() -> None:
    stamps, poses = moves(PEOPLE["da_vinci_36"], 12.0, seed=2)
    reach = lab.reach(recorded(stamps, poses), robot="puma560", settings=ALIGNED)
    placement, axes = reach.proposed.placement, picked(reach.proposed.placement.axes)
    attitude = tips("puma560", np.array([placement.start]))[1]
    hand = Rotation.from_quat(poses[:, [4, 5, 6, 3]])
    tool = asked("puma560", placement, poses)[1] * attitude.inv()  # before the gain of rotation
    seen = Rotation.from_matrix(axes @ (hand * hand[0].inv()).as_matrix() @ axes.T)
    # One rotation takes all axes of the hand's turns to those of the tool's.
    between, left = Rotation.align_vectors(tool.as_rotvec(), seen.as_rotvec())
    assert left < 1e-6
    assert abs(between.magnitude() - reach.proposed.misfit) < 1e-6
    assert reach.proposed.misfit < np.radians(60.0) < reach.given.misfit


def test_without_tool_axes_the_tool_turns_about_the_axes_of_the_hand_from_any_start() -> None:
    stamps, poses = moves(PEOPLE["da_vinci_36"], 12.0, seed=2)
    reach = lab.reach(recorded(stamps, poses), robot="puma560", share=1e-3)
    placement, axes = reach.given.placement, picked(reach.given.placement.axes)
    assert placement.tool_axes == ()
    hand = Rotation.from_quat(poses[:, [4, 5, 6, 3]])
    wanted = Rotation.from_matrix(axes @ (hand * hand[0].inv()).as_matrix() @ axes.T)
    told = Rotation.from_quat(reach.given.in_place.asked[:, [4, 5, 6, 3]])
    assert (wanted.inv() * (told * told[0].inv())).magnitude().max() < 1e-9
    assert reach.given.misfit == 0.0


def test_a_hand_at_rest_is_followed_where_it_is() -> None:
    stamps, poses = moves(PEOPLE["da_vinci_30"], 5.0)
    reach = lab.reach(recorded(stamps, np.repeat(poses[:1], len(poses), axis=0)), robot="rcrt1")
    assert reach.given.share == 1.0
    assert reach.is_given
    assert "nothing to change" in str(reach)


def test_a_proposal_keeps_to_limits_and_gains() -> None:
    reach = proposed("motion_capture", "rcrt1", SECONDS)
    placement, arm = reach.proposed.placement, tc.load_robot("rcrt1")
    assert ((arm.lower <= placement.start) & (placement.start <= arm.upper)).all()
    assert 0.0 < placement.coarse_gain < 1.0
    assert placement.fine_gain <= 0.1
    assert 0.0 <= placement.rotation_gain <= 1.0
    assert reach.proposed.at_given_gain < reach.proposed.share


def test_the_same_question_has_the_same_answer() -> None:
    first = proposed("da_vinci_36", "rcrt1", 12.0)
    second = lab.reach(person("da_vinci_36", 12.0), robot="rcrt1")
    assert first.settings() == second.settings()
    assert first.given.share == second.given.share
    assert first.proposed.share == second.proposed.share


def test_a_lower_goal_is_never_paid_with_a_lower_gain() -> None:
    high = proposed("da_vinci_36", "rcrt1", 12.0).proposed
    low = lab.reach(person("da_vinci_36", 12.0), robot="rcrt1", share=0.9).proposed
    assert low.share >= 0.9
    larger = (low.placement.rotation_gain, low.placement.coarse_gain)
    assert larger >= (high.placement.rotation_gain, high.placement.coarse_gain)


def test_a_scenario_is_run_first() -> None:
    reach = lab.reach("coarse_box", texts=["teleop.duration=8.0"])
    assert abs(reach.path.time[-1] - 8.0) < 0.01 + 5.0  # with the way to the start
    assert reach.given.share > 0.99


def test_a_table_of_others_is_taken_as_it_is(tmp_path: Path) -> None:
    stamps, poses = moves(PEOPLE["da_vinci_36"], 10.0)
    table = pandas.DataFrame(poses, columns=["x", "y", "z", "qw", "qx", "qy", "qz"])
    table.insert(0, "time", (stamps - stamps[0]) * 1e-9)
    file = tmp_path / "hand.csv"
    table.to_csv(file, index=False)
    with pytest.warns(UserWarning, match=r"hand\.csv: x, y, z"):
        from_file = lab.reach(file, robot="rcrt1", share=1e-3).given
    direct = lab.reach(recorded(stamps, poses), robot="rcrt1", share=1e-3).given
    assert abs(from_file.share - direct.share) <= AGREE


@pytest.mark.slow
def test_what_the_command_prints_and_writes_is_what_replay_takes(tmp_path: Path, teleop_again: "Run") -> None:
    bag = saved("da_vinci_30", 15.0, tmp_path)
    file, page = tmp_path / "reach.yaml", tmp_path / "reach.html"
    shown = teleop_again("reach", bag, "--robot", "rcrt1", "--out", file, "--html", page).stdout
    proposed = float(present(re.search(r"followed in a session +[\d.]+ % +([\d.]+) %", shown))[1]) / 100.0
    assert proposed >= 0.99
    line = next(line for line in shown.splitlines() if line.startswith("--set "))
    settings = line.removeprefix("--set ").replace("'", "").split()
    by_text = tc.replay(bag, robot="rcrt1", texts=settings)
    by_file = tc.replay(bag, robot="rcrt1", files=[file])
    assert abs(followed(by_text) - proposed) <= AGREE
    np.testing.assert_array_equal(by_text["slave/servo_jp"].values, by_file["slave/servo_jp"].values)
    text = page.read_text()
    assert "as given" in text
    assert "against time" in text
    assert "proposed" in text
    assert "too fast for the joints" in text


def test_axes_stay_where_a_camera_is_fixed() -> None:
    reach = lab.reach(person("motion_capture", 12.0), robot="rcrt1", keeps_axes=True)
    assert reach.proposed.placement.axes == reach.given.placement.axes
    assert reach.proposed.share >= 0.99
