"""Environments: tasks as Gymnasium environments, ``teleop_core/Reach-v0`` and ``PegTransfer-v0``.

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
from teleop_core.graph.topics import TASK_STATE
from teleop_core.hand.tasks import Act
from teleop_core.hand.tasks.task import TaskParameters
from teleop_core.kernels.axes import axis_map
from teleop_core.session.api import Setting

Observed = NDArray[np.float32]
_ACT, _GOAL, _ATTEMPTS, _SUCCESSES, _STEP = (
    TASK_STATE.columns.index(name) for name in ("act", "goal_x", "attempts", "successes", "step")
)
_PERIOD = 0.02  # duration of a step [s]
_SCALE = 0.02
"""Length [m] that an observation represents as 1."""
_BLOCKS = 3


class _TaskEnv(gymnasium.Env[Observed, Observed]):
    """Task in which actions move the hand, and a jaw if the task needs one."""

    metadata = {"render_modes": []}  # noqa: RUF012 - gymnasium's own declaration

    def __init__(self, scenario: str, given: Mapping[str, Setting], reach: float, *, has_jaw: bool) -> None:
        self._session = tc.Session(scenario, settings=given)
        made, self._reach, self._has_jaw = self._session.runner.configuration, reach, has_jaw
        self._task = values_of(made.group("task"))
        self._gain, self._hand = 1.0, np.zeros(3)
        self._hand_of_slave = axis_map("axes", made.value("axes")).T
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3 + has_jaw,), np.float32)
        shape = (9 + 3 * has_jaw,)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, shape, np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Start a new episode, with another goal if the task has several; see :meth:`gymnasium.Env.reset`."""
        super().reset(seed=seed)
        session = self._session
        chosen = self._task | {"reach.first": int(self.np_random.integers(10**6))}
        session.runner.stages["task"].retune(build(TaskParameters, chosen))
        found, self._hand = session.reset(), np.zeros(3)
        while session.values("task/state")[0] < 1.0:
            found = session.step()
        self._gain = found.gain
        self._last = session.values("display/measured_cp")[:3]
        return self._observed(found, session.values("task/state")), {}

    def step(self, action: Observed) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Move the hand for 20 ms; see :meth:`gymnasium.Env.step`."""
        moved = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        space, session = self._session.command_space, self._session
        before = session.values("task/state")
        hand = self._hand + self._hand_of_slave @ (self._reach * moved[:3]) / self._gain
        self._hand = np.clip(hand, space.low[:3], space.high[:3])
        session.command(self._hand, jaw=float(self._has_jaw and moved[3] > 0.0))
        found, now = session.step(), session.values("task/state")
        observed = self._observed(found, now)
        reward, is_over, is_success = self._judged(observed, before, now)
        info = {"is_success": is_success, "successes": int(now[_SUCCESSES])}
        return observed, reward, is_over, False, info

    def _judged(
        self, observed: Observed, before: NDArray[np.float64], now: NDArray[np.float64]
    ) -> tuple[float, bool, bool]:
        """Reward, whether the episode is over, and whether the task is completed."""
        raise NotImplementedError

    def _observed(self, found: tc.Observation, task: NDArray[np.float64]) -> Observed:
        session = self._session
        tip = session.values("display/measured_cp")[:3]
        speed, self._last = (tip - self._last) / _PERIOD, tip
        ways = (task[_GOAL : _GOAL + 3] - tip, speed, found.servo_cp[:3] - tip)
        seen = [np.concatenate(ways) / _SCALE]
        if self._has_jaw:
            jaw, grip = session.values("slave/jaw/measured_js"), session.values("slave/jaw/grip")
            seen.append(np.array([jaw[0], grip[0] > 0.0, task[_ACT] == Act.GRIP]))
        return np.concatenate(seen).astype(np.float32)


class ReachEnv(_TaskEnv):
    """Move the slave's tip to a goal.

    An action (3,), each value from -1 to 1, moves the hand by up to ``reach`` along each axis of the slave in a step of
    20 ms. As in :mod:`teleop_core`, the hand holds a device and the arm follows. The observation (9,) contains the
    vector to the goal, the velocity of the tip, and the vector from the hand's command to the tip, in units of 20 mm
    and 20 mm/s. The reward is minus the distance in units of 20 mm. At the goal the reward is 10, and the episode ends.
    An episode is truncated after 10 s.

    Args:
        settings: Parameters of the session, such as ``{"display.latency": 0.2}``. The environment itself sets the
            operator and the task.
        reach: Largest displacement of the hand in one step [m].

    Raises:
        TeleopError: A setting is wrong.
    """

    def __init__(self, settings: Mapping[str, Setting] | None = None, reach: float = 0.001) -> None:
        given: dict[str, Setting] = {"teleop.stages": ["display", "task"], "task.kind": "reach"}
        super().__init__("free_motion", given | dict(settings or {}), reach, has_jaw=False)

    def _judged(
        self, observed: Observed, before: NDArray[np.float64], now: NDArray[np.float64]
    ) -> tuple[float, bool, bool]:
        is_there = bool(now[_SUCCESSES] > 0.0)
        return 10.0 if is_there else -float(np.linalg.norm(observed[:3])), is_there, is_there


class PegTransferEnv(_TaskEnv):
    """Carry three blocks with the slave's jaw from their pegs to the pegs of their colours.

    The first three numbers of an action (4,) move the hand as in :class:`ReachEnv`; a fourth number above 0 closes the
    jaw. The observation (12,) contains the values of ``ReachEnv``, the jaw's angle [rad], whether the jaw grips a
    block, and whether the task requires a closed jaw. The goal depends on the present step of the task: reach, grasp,
    lift, carry, place. The reward is minus the distance in units of 20 mm. A finished step adds 5, a block on its peg
    adds 20, and a block at rest elsewhere subtracts 20. The episode ends with the third block, and is truncated after
    90 s.

    Args:
        settings: As in :class:`ReachEnv`.
        reach: Largest displacement of the hand in one step [m].

    Raises:
        TeleopError: A setting is wrong.
    """

    def __init__(self, settings: Mapping[str, Setting] | None = None, reach: float = 0.001) -> None:
        stages = ["jaw_command", "jaw", "jaw_sim", "display", "task"]
        given: dict[str, Setting] = {
            "teleop.stages": stages,
            "task.kind": "peg_transfer",
            "coarse_gain": 2.0,  # the board is wider than the device's workspace
            # The nearest block comes first, because the jaw would push it over on the path to another block.
            "jaw_sim.object.place": [0.281, -0.2357, -0.0911, 0.256, -0.2357, -0.0911, 0.231, -0.2357, -0.0911],
        }
        super().__init__("peg_transfer", given | dict(settings or {}), reach, has_jaw=True)

    def _judged(
        self, observed: Observed, before: NDArray[np.float64], now: NDArray[np.float64]
    ) -> tuple[float, bool, bool]:
        tried, done = now[_ATTEMPTS] - before[_ATTEMPTS], now[_SUCCESSES] - before[_SUCCESSES]
        stepped = tried == 0.0 and now[_STEP] != before[_STEP]
        reward = 5.0 * stepped + 20.0 * (2.0 * done - tried) - float(np.linalg.norm(observed[:3]))
        is_over = bool(now[_ATTEMPTS] >= _BLOCKS)
        return float(reward), is_over, bool(is_over and now[_SUCCESSES] >= _BLOCKS)


for _name, _class, _seconds in (("Reach", ReachEnv, 10.0), ("PegTransfer", PegTransferEnv, 90.0)):
    if f"teleop_core/{_name}-v0" not in gymnasium.registry:
        gymnasium.register(
            id=f"teleop_core/{_name}-v0",
            entry_point=f"{__name__}:{_class.__name__}",
            max_episode_steps=round(_seconds / _PERIOD),
        )
