"""Episodes: a task that a policy does by leading the slave's joints, as often as wanted.

An episode is one attempt of the session's task. Without a task it has no end and no reward.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.base.parameters import build, values_of
from teleop_core.graph.topics import SLAVE_JAW_OBJECT_CP, TASK_STATE
from teleop_core.hand.tasks.task import TaskParameters
from teleop_core_lerobot.side import FORCE
from teleop_core_lerobot.slave_side import SlaveSide

STATES = {"record": 3, "export": 7, "joints": 0}
"""What the state of an observation has beside the joints, and how many numbers: the force on the tip, as
``lerobot-record`` stores it; the pose of the tip, as ``teleop export`` does; or nothing."""
_NUMBER, _ATTEMPTS, _SUCCESSES = (TASK_STATE.columns.index(name) for name in ("number", "attempts", "successes"))
_GOAL = [TASK_STATE.columns.index(f"goal_{name}") for name in ("x", "y", "z", "qw", "qx", "qy", "qz")]
_GOAL.append(TASK_STATE.columns.index("width"))
_PATIENCE = 10.0  # time in which a task sets its first goal [s]
_FIRST = "reach.first"  # parameter that chooses the goals of a task
Seen = dict[str, Any]
"""Observation: ``agent_pos`` (k,); ``environment_state`` (m,) with a task; ``pixels`` by camera, if there are any."""


class Episodes:
    """Episodes of a slave that a policy leads.

    Args:
        robot: As in :class:`~teleop_core_lerobot.SlaveSide`.
        scenario: As in :class:`~teleop_core_lerobot.SlaveSide`.
        settings: As in :class:`~teleop_core_lerobot.SlaveSide`.
        fps: Steps in a second, 1 to 1000.
        cameras: As in :class:`~teleop_core_lerobot.SlaveSide`.
        state: One of :data:`STATES`.

    Attributes:
        side: The slave.

    Raises:
        TeleopError: A value is wrong; the text names it.
    """

    def __init__(
        self,
        robot: str = "",
        scenario: str = "",
        settings: Sequence[str] = (),
        fps: int = 30,
        cameras: Sequence[str] = (),
        state: str = "record",
    ) -> None:
        if state not in STATES:
            raise tc.UnknownNameError("state", state, tuple(STATES))
        self.side, self._state = SlaveSide(robot, scenario, settings, fps, cameras=cameras), state
        self._topics = {topic.name for topic in self.side.topics}

    @property
    def limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper limits (n,) of the joints [rad or m]."""
        return self.side.limits

    @property
    def state_width(self) -> int:
        """Count of numbers in the state."""
        return len(self.side.joint_names) + STATES[self._state]

    @property
    def surroundings_width(self) -> int:
        """Count of numbers about goal and object; 0 without a task."""
        if TASK_STATE.name not in self._topics:
            return 0
        return len(_GOAL) + 7 * (SLAVE_JAW_OBJECT_CP.name in self._topics)

    def begin(self, seed: int = 0) -> Seen:
        """Begin an episode with the slave at its start, and return the first observation.

        Args:
            seed: Chooses the goal of the task ``reach``; other tasks begin with the same goal each time.

        Raises:
            SessionError: The task sets no goal, as the slave does not follow.
        """
        if self.side.is_running:
            self.side.restart()
        else:
            self.side.begin()
        if self.surroundings_width:
            self._begin_task(seed)
        return self.observe()

    def _begin_task(self, seed: int) -> None:
        stage, wanted = self.side.stage("task"), values_of(self.side.parameters("task"))
        if wanted["kind"] == "reach":
            stage.retune(build(TaskParameters, wanted | {_FIRST: seed}))
        where = self.side.observe_joints()
        for _ in range(int(_PATIENCE * self.side.fps)):
            if self._task[_NUMBER] >= 1.0:
                return
            self.side.send(where)
        raise tc.SessionError(f"the task sets no goal within {_PATIENCE:g} s: the slave does not follow")

    @property
    def _task(self) -> NDArray[np.float64]:
        return self.side.values(TASK_STATE)

    def step(self, joints: NDArray[np.float64]) -> tuple[Seen, float, bool]:
        """Give joint references (n,) [rad or m], and let one period pass.

        Returns:
            The observation; the reward, 1 if the attempt has succeeded and else 0; whether the attempt is over.

        Raises:
            ParameterError: There are more or fewer joints, or a number is not finite.
        """
        keys = self.side.joint_keys
        if len(joints) != len(keys):
            raise tc.ParameterError("action", len(joints), f"{len(keys)} joints: {', '.join(keys)}")
        lower, upper = self.limits
        self.side.send(dict(zip(keys, np.clip(joints, lower, upper).tolist(), strict=True)))
        if not self.surroundings_width:
            return self.observe(), 0.0, False
        task = self._task
        return self.observe(), float(task[_SUCCESSES] > 0.0), bool(task[_ATTEMPTS] > 0.0)

    def observe(self) -> Seen:
        """Observation of the last tick; no time passes."""
        found, side = self.side.observe(), self.side
        joints = [found[key] for key in side.joint_keys]
        more = {"record": [found[key] for key in FORCE], "export": side.tip.tolist(), "joints": []}[self._state]
        seen: Seen = {"agent_pos": np.array(joints + more, np.float32)}
        if self.surroundings_width:
            around = self._task[_GOAL]
            if SLAVE_JAW_OBJECT_CP.name in self._topics:
                around = np.concatenate((around, side.values(SLAVE_JAW_OBJECT_CP)))
            seen["environment_state"] = around.astype(np.float32)
        if side.pictures:
            seen["pixels"] = {name: found[name] for name in side.pictures}
        return seen

    def end(self) -> None:
        """End the session, if one runs."""
        if self.side.is_running:
            self.side.end()
