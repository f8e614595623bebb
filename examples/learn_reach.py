"""Let a program learn to move the arm to a goal: soft actor-critic of Stable-Baselines3.

pip install stable-baselines3                      # with PyTorch, some gigabytes
python examples/learn_reach.py 30000               # steps of 20 ms; some seven minutes
"""

import sys
from typing import Any

import gymnasium

NAME = "teleop_lab.environment:teleop_core/Reach-v0"
EPISODES = 50


def success(model: Any, env: Any) -> float:
    """Share of episodes with new goals in which the tip reaches the goal within 10 s."""
    reached = 0
    for seed in range(EPISODES):
        seen, _ = env.reset(seed=10_000 + seed)
        is_over = is_late = False
        while not (is_over or is_late):
            action, _ = model.predict(seen, deterministic=True)
            seen, _, is_over, is_late, _ = env.step(action)
        reached += is_over
    return reached / EPISODES


def main(steps: int) -> None:
    """Learn, and print the share of reached goals before and after."""
    try:
        from stable_baselines3 import SAC
    except ImportError:
        sys.exit("this example needs Stable-Baselines3: pip install stable-baselines3")
    env = gymnasium.make(NAME)
    model = SAC("MlpPolicy", env, seed=1, learning_starts=1000, gamma=0.98)
    print(f"before: {100.0 * success(model, env):.0f} % of {EPISODES} goals")
    model.learn(steps)
    print(f"after {steps} steps: {100.0 * success(model, env):.0f} %")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 30_000)
