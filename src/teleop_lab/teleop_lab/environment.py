"""Environment: a session as a Gymnasium environment, ``teleop_core/Reach-v0``.

>>> import gymnasium
>>> env = gymnasium.make("teleop_lab.environment:teleop_core/Reach-v0")

An action moves the hand; observation and reward come from the slave's tip and from the task.
"""

from collections.abc import Mapping
from itertools import count
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.base.parameters import build, values_of
from teleop_core.chain.mapping.parameters import axis_map
from teleop_core.chain.tasks.task import TaskParameters
from teleop_core.graph.signals import STATE
from teleop_core.graph.topics import TASK_STATE
from teleop_core.session.api import Setting

Array = NDArray[np.float64]
Observed = NDArray[np.float32]
_GOAL, _SUCCESSES = (TASK_STATE.columns.index(name) for name in ("goal_x", "successes"))
_NUMBERS = count()
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

    TICKS = 20
    metadata = {"render_modes": []}  # noqa: RUF012 - gymnasium's own declaration

    def __init__(self, settings: Mapping[str, Setting] | None = None, reach: float = 0.001) -> None:
        self._reach = reach
        self._hand, self._next = np.zeros(3), np.zeros(3)
        name = f"environment_{next(_NUMBERS)}"  # several may run side by side
        operator = tc.Operator(name, lambda *_: self._motion, ahead=self.TICKS)
        given: dict[str, Setting] = {
            "tremor_amplitude": 0.0, "teleop.stages": ["display", "task"], "task.kind": "reach",
        }  # fmt: skip
        made = tc.configuration(operator=operator, settings=given | dict(settings or {}))
        self._session, self._task = tc.VirtualTime(made), values_of(made.group("task"))
        self._gain = 1.0
        self._hand_of_slave = axis_map("axes", made.value("axes")).T
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (9,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin anew with another goal; see :meth:`gymnasium.Env.reset`."""
        super().reset(seed=seed)
        session = self._session
        self._hand[:], self._next[:] = 0.0, 0.0
        chosen = self._task | {"reach.first": int(self.np_random.integers(10**6))}
        session.stages["task"].retune(build(TaskParameters, chosen))
        session.reset()
        row = session.run(session.lead + self.TICKS)[-1]
        while row["teleop_state"][STATE["is_following"]] <= 0.0 or row["task_state"][0] < 1.0:
            row = session.run(self.TICKS)[-1]
        self._gain = float(row["teleop_state"][STATE["gain"]])
        self._last = row["display_measured_cp"][:3].copy()
        self._goal = row["task_state"][_GOAL : _GOAL + 3].copy()
        return self._observed(row), {}

    def step(self, action: Observed) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Move the hand for 20 ms; see :meth:`gymnasium.Env.step`."""
        wanted = self._reach * np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        self._next = self._hand + self._hand_of_slave @ wanted / self._gain
        row = self._session.run(self.TICKS)[-1]
        self._hand = self._next.copy()
        observed = self._observed(row)
        is_there = bool(row["task_state"][_SUCCESSES] > 0.0)
        reward = 10.0 if is_there else -float(np.linalg.norm(observed[:3]))
        return observed, reward, is_there, False, {"is_success": is_there}

    def _observed(self, row: Any) -> Observed:
        tip = row["display_measured_cp"][:3]
        speed = (tip - self._last) / (1e-3 * self.TICKS)
        self._last = tip.copy()
        command = row["slave_servo_cp"][:3]
        seen = np.concatenate((self._goal - tip, speed, command - tip)) / _SCALE
        return seen.astype(np.float32)

    def _motion(self, times: Array) -> Array:
        """Places (N, 3) of the hand: from where it was to where it goes, evenly."""
        share = np.arange(1, len(times) + 1)[:, None] / self.TICKS
        return self._hand + share * (self._next - self._hand)


NAME = "teleop_core/Reach-v0"
if NAME not in gymnasium.registry:
    gymnasium.register(
        id=NAME, entry_point="teleop_lab.environment:ReachEnv", max_episode_steps=500
    )
