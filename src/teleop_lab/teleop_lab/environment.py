"""Environment: a session as a Gymnasium environment, ``teleop_core/Reach-v0``.

>>> import gymnasium
>>> env = gymnasium.make("teleop_lab.environment:teleop_core/Reach-v0")

An action moves the hand; observation and reward come from the slave's tip and from the task.
"""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.base.parameters import build, values_of
from teleop_core.chain.mapping.parameters import axis_map
from teleop_core.chain.tasks.task import TaskParameters
from teleop_core.graph.topics import TASK_STATE
from teleop_core.session.api import Setting

Observed = NDArray[np.float32]
_GOAL, _SUCCESSES = (TASK_STATE.columns.index(name) for name in ("goal_x", "successes"))
_PERIOD = 0.02  # of a step [s]
_SCALE = 0.02
"""Length that is 1 in an observation [m]."""


class ReachEnv(gymnasium.Env[Observed, Observed]):
    """Lead the slave's tip to a goal.

    An action (3,) in -1 to 1 moves the hand by up to ``reach`` along the axes of the slave, over a
    step of 20 ms; as in :mod:`teleop_core`, the hand holds a device and the arm follows. The
    observation (9,) has the way to the goal, the velocity of the tip and the way from the hand's
    command to the tip, in 20 mm and 20 mm/s. The reward is minus the distance in 20 mm, and 10 at
    the goal, where the episode ends. It is truncated after 10 s.

    Args:
        settings: Parameters of the session, such as ``{"display.latency": 0.2}`` or those of a
            network; ``operator`` and the task are its own.
        reach: Largest way of the hand in a step [m].

    Raises:
        TeleopError: A setting is wrong.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - gymnasium's own declaration

    def __init__(self, settings: Mapping[str, Setting] | None = None, reach: float = 0.001) -> None:
        given: dict[str, Setting] = {"teleop.stages": ["display", "task"], "task.kind": "reach"}
        self._session = tc.Session("free_motion", settings=given | dict(settings or {}))
        made, self._reach = self._session.runner.configuration, reach
        self._task = values_of(made.group("task"))
        self._gain, self._hand = 1.0, np.zeros(3)
        self._hand_of_slave = axis_map("axes", made.value("axes")).T
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (9,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin anew with another goal; see :meth:`gymnasium.Env.reset`."""
        super().reset(seed=seed)
        session = self._session
        chosen = self._task | {"reach.first": int(self.np_random.integers(10**6))}
        session.runner.stages["task"].retune(build(TaskParameters, chosen))
        found, self._hand = session.reset(), np.zeros(3)
        while session.values("task/state")[0] < 1.0:
            found = session.step()
        self._gain = found.gain
        self._last = session.values("display/measured_cp")[:3]
        self._goal = session.values("task/state")[_GOAL : _GOAL + 3]
        return self._observed(found), {}

    def step(self, action: Observed) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Move the hand for 20 ms; see :meth:`gymnasium.Env.step`."""
        wanted = self._reach * np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        space = self._session.command_space
        hand = self._hand + self._hand_of_slave @ wanted / self._gain
        self._hand = np.clip(hand, space.low[:3], space.high[:3])
        self._session.command(self._hand)
        observed = self._observed(self._session.step())
        is_there = bool(self._session.values("task/state")[_SUCCESSES] > 0.0)
        reward = 10.0 if is_there else -float(np.linalg.norm(observed[:3]))
        return observed, reward, is_there, False, {"is_success": is_there}

    def _observed(self, found: tc.Observation) -> Observed:
        tip = self._session.values("display/measured_cp")[:3]
        speed = (tip - self._last) / _PERIOD
        self._last = tip
        seen = np.concatenate((self._goal - tip, speed, found.servo_cp[:3] - tip)) / _SCALE
        return seen.astype(np.float32)


NAME = "teleop_core/Reach-v0"
if NAME not in gymnasium.registry:
    gymnasium.register(
        id=NAME, entry_point="teleop_lab.environment:ReachEnv", max_episode_steps=500
    )
