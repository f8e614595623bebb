"""The session as a Gymnasium environment."""

import warnings
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
NAME = "teleop_lab.environment:teleop_core/Reach-v0"
TRANSFER = "teleop_lab.environment:teleop_core/PegTransfer-v0"


def led(env: Any, seed: int) -> tuple[bool, int, list[float]]:
    """Whether a hand that goes towards the goal gets there, in how many steps, and the rewards."""
    seen, _ = env.reset(seed=seed)
    rewards = []
    for step in range(500):
        seen, reward, is_over, is_late, _ = env.step(np.clip(2.0 * seen[:3], -1.0, 1.0))
        rewards.append(reward)
        if is_over or is_late:
            return is_over, step, rewards
    return False, 500, rewards


@pytest.mark.parametrize("name", [NAME, TRANSFER])
def test_gymnasium_finds_no_fault_with_it(name: str) -> None:
    from gymnasium.utils.env_checker import check_env

    env = gymnasium.make(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*infinity.*")
        warnings.filterwarnings("ignore", message=".*render.*")
        check_env(env.unwrapped, skip_render_check=True)


def test_a_hand_that_goes_towards_the_goal_gets_there_and_a_resting_one_does_not() -> None:
    env = gymnasium.make(NAME)
    results = [led(env, seed) for seed in range(5)]
    assert all(is_there for is_there, _, _ in results)
    assert len({steps for _, steps, _ in results}) > 1, "the goals are the same"
    env.reset(seed=1)
    over = [env.step(np.zeros(3, np.float32))[2:4] for _ in range(500)]
    assert not any(is_there for is_there, _ in over)
    assert over[-1][1], "it is not truncated"


def test_the_same_seed_gives_the_same_episode_beside_another_environment() -> None:
    first, second = gymnasium.make(NAME), gymnasium.make(NAME)
    assert led(first, 3)[2] == led(second, 3)[2] == led(first, 3)[2]
    assert led(second, 4)[2] != led(first, 3)[2]


def test_a_hand_that_goes_where_each_step_says_brings_all_blocks_to_their_pegs() -> None:
    env = gymnasium.make(TRANSFER)
    seen, _ = env.reset(seed=1)
    is_over = is_late = False
    rewards, info = [], {}
    while not (is_over or is_late):
        jaw = 1.0 if seen[11] > 0.0 else -1.0
        action = np.append(np.clip(3.0 * seen[:3], -1.0, 1.0), jaw).astype(np.float32)
        seen, reward, is_over, is_late, info = env.step(action)
        rewards.append(reward)
    assert (info["is_success"], info["successes"], is_late) == (True, 3, False)
    assert sum(reward > 15.0 for reward in rewards) == 3


def test_a_jaw_that_never_closes_transfers_nothing_and_runs_out_of_time() -> None:
    env = gymnasium.make(TRANSFER, settings={"task.peg_transfer.longest": 2.0})
    seen, _ = env.reset(seed=1)
    is_over, info = False, {}
    while not is_over:
        action = np.append(np.clip(3.0 * seen[:3], -1.0, 1.0), -1.0).astype(np.float32)
        seen, _, is_over, is_late, info = env.step(action)
        assert not is_late
    assert (info["is_success"], info["successes"]) == (False, 0)
