"""Episodes for LeRobot: a policy leads the joints, and the task says when it is done."""

import numpy as np
import pytest

import teleop_core as tc
from teleop_core.kernels.geometry import Array

pytest.importorskip("teleop_core_lerobot", reason="lerobot_robot_teleop_core is missing")
from teleop_core_lerobot import Episodes, MasterSide

REACH = ("teleop.stages=[display,task]", "task.kind=reach")
GOAL = slice(0, 3)


@pytest.fixture(scope="module")
def episodes() -> Episodes:
    return Episodes(scenario="free_motion", settings=REACH, fps=20, state="export")


def towards(robot: tc.Robot, joints: Array, goal: Array) -> Array:
    """Joints (n,) that bring the tip 3 mm nearer to a goal (3,): by the robot, not by the session."""
    T = robot.fk(joints)
    way = goal - T[:3, 3]
    T[:3, 3] += way * min(1.0, 0.003 / max(float(np.linalg.norm(way)), 1e-9))
    return np.array(robot.ik(T, joints).q)


def test_policy_that_brings_the_tip_to_the_goal_is_rewarded_and_ends_the_episode(episodes: Episodes) -> None:
    robot, seen = tc.load_robot("rcrt1"), episodes.begin(seed=3)
    joints = seen["agent_pos"][: robot.n].astype(np.float64)
    assert seen["agent_pos"].shape == (episodes.state_width,) == (robot.n + 7,)
    assert np.allclose(seen["agent_pos"][robot.n : robot.n + 3], robot.fk(joints)[:3, 3], atol=1e-4)
    rewards = []
    for _ in range(200):
        joints = towards(robot, joints, seen["environment_state"][GOAL])
        seen, reward, is_over = episodes.step(joints)
        rewards.append(reward)
        if is_over:
            break
    assert rewards[-1] == 1.0
    assert not any(rewards[:-1])
    assert len(rewards) > 3


def test_episode_of_a_policy_that_rests_is_not_rewarded(episodes: Episodes) -> None:
    seen = episodes.begin(seed=3)
    for _ in range(40):
        seen, reward, is_over = episodes.step(seen["agent_pos"][:6])
        assert (reward, is_over) == (0.0, False)


def test_same_seed_gives_the_same_episode_and_another_seed_another_goal(episodes: Episodes) -> None:
    found = []
    for seed in (1, 2, 1):
        seen = episodes.begin(seed)
        after, *_ = episodes.step(seen["agent_pos"][:6] + 0.001)
        found.append((seen["environment_state"], after["agent_pos"]))
    assert np.array_equal(found[0][1], found[2][1])
    assert np.array_equal(found[0][0], found[2][0])
    assert not np.array_equal(found[0][0][GOAL], found[1][0][GOAL])


def test_state_is_that_of_a_data_set_that_was_recorded() -> None:
    made = Episodes(scenario="free_motion", settings=("slave.starts_at_home=true",))
    seen = made.begin()
    assert list(seen) == ["agent_pos"]
    assert np.array_equal(seen["agent_pos"], np.array(list(made.side.observe().values()), np.float32))
    assert made.step(seen["agent_pos"][:6])[1:] == (0.0, False)
    made.end()
    only = Episodes(scenario="free_motion", state="joints", settings=("slave.starts_at_home=true",))
    assert np.array_equal(only.begin()["agent_pos"], seen["agent_pos"][:6])
    assert only.state_width == 6


def test_joints_of_the_hand_are_followed_as_those_of_a_policy_are() -> None:
    master = MasterSide(scenario="free_motion", settings=("slave.starts_at_home=true",))
    made = Episodes(scenario="free_motion", settings=("slave.starts_at_home=true",))
    master.begin()
    made.begin()
    for _ in range(60):
        action = np.array(list(master.next_action().values()))
        seen, *_ = made.step(action)
    assert seen["agent_pos"][:6] == pytest.approx(action, abs=0.03)


def test_unfit_actions_and_states_are_refused(episodes: Episodes) -> None:
    episodes.begin()
    with pytest.raises(tc.ParameterError, match="6 joints"):
        episodes.step(np.zeros(5))
    with pytest.raises(tc.ParameterError, match="finite"):
        episodes.step(np.full(6, np.nan))
    with pytest.raises(tc.UnknownNameError, match="record"):
        Episodes(state="pictures")


def test_pictures_of_a_scene_are_seen_if_they_are_asked_for() -> None:
    pytest.importorskip("mujoco", reason="teleop_scene is not installed")
    from teleop_scene import models

    scene = str(models.OWN / "cubes.xml")
    made = Episodes(scene, "free_motion", cameras=["front:96x64"])
    assert made.side.pictures == {"front": (64, 96, 3)}
    try:
        seen = made.begin()
    except tc.TeleopError:
        pytest.skip("no OpenGL without a screen (EGL) on this machine")
    assert seen["pixels"]["front"].shape == (64, 96, 3)
    assert seen["pixels"]["front"].std() > 1.0
    made.end()
