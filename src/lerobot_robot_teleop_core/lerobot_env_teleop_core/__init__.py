"""Tasks of teleop_core as LeRobot's environment, ``--env.type=teleop_core``, for ``lerobot-eval``."""

from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_IMAGES, OBS_STATE
from numpy.typing import NDArray

from teleop_core_lerobot import Episodes

__all__ = ["TeleopCoreEnv", "TeleopCoreEnvConfig"]

_ID = "teleop_core/Joints-v0"


class TeleopCoreEnv(gymnasium.Env[dict[str, Any], NDArray[np.float32]]):
    """A policy leads the slave's joints; see :class:`teleop_core_lerobot.Episodes`.

    Args:
        task: Task in words, for policies that read it.
        fps: Steps in a second.
        given: Further arguments of :class:`teleop_core_lerobot.Episodes`.
    """

    def __init__(self, task: str, fps: int, **given: Any) -> None:
        self.task_description = self.task = task
        self.metadata = {"render_modes": ["rgb_array"], "render_fps": fps}
        self.render_mode = "rgb_array"
        self._episodes = episodes = Episodes(fps=fps, **given)
        lower, upper = (limit.astype(np.float32) for limit in episodes.limits)
        self.action_space = gymnasium.spaces.Box(lower, upper, dtype=np.float32)
        spaces: dict[str, Any] = {"agent_pos": self._numbers(episodes.state_width)}
        if episodes.surroundings_width:
            spaces["environment_state"] = self._numbers(episodes.surroundings_width)
        if pictures := episodes.side.pictures:
            boxes: dict[str, Any] = {
                name: gymnasium.spaces.Box(0, 255, shape, np.uint8) for name, shape in pictures.items()
            }
            spaces["pixels"] = gymnasium.spaces.Dict(boxes)
        self.observation_space = gymnasium.spaces.Dict(spaces)

    @staticmethod
    def _numbers(count: int) -> gymnasium.spaces.Box:
        return gymnasium.spaces.Box(-np.inf, np.inf, (count,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; see :meth:`gymnasium.Env.reset`."""
        super().reset(seed=seed)
        return self._episodes.begin(int(self.np_random.integers(10**6))), {"is_success": False}

    def step(self, action: NDArray[np.float32]) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Give joints [rad or m] for a period; see :meth:`gymnasium.Env.step`."""
        seen, reward, is_over = self._episodes.step(np.asarray(action, np.float64))
        return seen, reward, is_over, False, {"is_success": reward > 0.0}

    def render(self) -> Any:
        """Picture of the first camera; a black one without cameras."""
        side = self._episodes.side
        return side.observe()[next(iter(side.pictures))] if side.pictures else np.zeros((64, 64, 3), np.uint8)

    def close(self) -> None:
        """End the session."""
        self._episodes.end()


gymnasium.register(_ID, entry_point=f"{__name__}:TeleopCoreEnv")


@EnvConfig.register_subclass("teleop_core")
@dataclass
class TeleopCoreEnvConfig(EnvConfig):
    """What runs; the fields are arguments of :class:`teleop_core_lerobot.Episodes`, and the length of an episode."""

    task: str | None = "follow the goal"
    robot: str = ""
    scenario: str = ""
    settings: list[str] = field(default_factory=list)
    views: list[str] = field(default_factory=list)
    state: str = "record"
    episode_length: int = 300

    def __post_init__(self) -> None:
        """Tell LeRobot the shapes of actions and observations."""
        found = Episodes(**self._given)
        self._add(ACTION, FeatureType.ACTION, (len(found.side.joint_names),), ACTION)
        self._add("agent_pos", FeatureType.STATE, (found.state_width,), OBS_STATE)
        if found.surroundings_width:
            self._add("environment_state", FeatureType.ENV, (found.surroundings_width,), OBS_ENV_STATE)
        for name, shape in found.side.pictures.items():
            self._add(f"pixels/{name}", FeatureType.VISUAL, shape, f"{OBS_IMAGES}.{name}")

    def _add(self, key: str, kind: FeatureType, shape: tuple[int, ...], of_policy: str) -> None:
        self.features[key], self.features_map[key] = PolicyFeature(type=kind, shape=shape), of_policy

    @property
    def _given(self) -> dict[str, Any]:
        return {
            "robot": self.robot, "scenario": self.scenario, "settings": self.settings, "cameras": self.views,
            "state": self.state, "fps": self.fps,
        }  # fmt: skip

    @property
    def package_name(self) -> str:
        """Package whose import registers the environment."""
        return __name__

    @property
    def gym_id(self) -> str:
        """Name of the environment in Gymnasium."""
        return _ID

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of :class:`TeleopCoreEnv`."""
        return self._given | {"task": self.task or "", "max_episode_steps": self.episode_length}
