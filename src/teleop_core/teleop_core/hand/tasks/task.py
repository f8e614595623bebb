"""Stage ``task``: sets goals, detects whether they are reached, and publishes both."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from teleop_core.base import Choice, choice
from teleop_core.graph import DT, STATE, Row, RunningStage, Stage, assign, topics
from teleop_core.hand.tasks import MEMORY, SCENE, TASKS
from teleop_core.kernels import Array, Fields, kernel, record

_IS_FOLLOWING = STATE["is_following"]
_JAWS = (topics.SLAVE_JAW_GRIP, topics.FIRST_JAW_GRIP, topics.SECOND_JAW_GRIP, topics.SLAVE_JAW_BOARD)
_GRIPS, _BOARD = topics.SLAVE_JAW_GRIP.columns.index("is_gripped"), topics.SLAVE_JAW_BOARD.columns.index("x0")
_SECOND, _FIRST_BLOCK = SCENE.index("is_second"), SCENE.index("x0")


@dataclass(frozen=True, kw_only=True)
class TaskParameters:
    """Choice of the task."""

    kind: Choice = choice(TASKS, "point", fixed=True, doc="task of the operator")


class TaskState(Fields):
    """State record of the stage: the time at which the task began."""

    begin_ns: int


class TaskPart(NamedTuple):
    """The task's judge, its numbers, its memory (64,) and its scene."""

    judge: Any
    numbers: Array
    memory: Array
    scene: Array


@kernel
def task_step(p: TaskState, s: TaskState, part: TaskPart, row: Row, dt: float) -> None:
    """One tick: call the task's judge with the scene, once the slave follows; the judge writes task_state.

    Args:
        p: Not used.
        s: State record; written.
        part: :class:`TaskPart`; memory and scene are written.
        row: Signals.
        dt: Tick [s].
    """
    if s.begin_ns == 0:
        if row.teleop_state[_IS_FOLLOWING] <= 0.0 or row.slave_true_cp_ns == 0:
            return
        s.begin_ns = row.now_ns
    scene = part.scene
    scene[0] = 1e-9 * (row.now_ns - s.begin_ns)
    for i in range(7):
        scene[1 + i] = row.slave_true_cp[i]
    scene[8] = row.hand_jaw[0]
    for i in range(3):
        scene[9 + i] = row.slave_true_cf[i]
    is_second = row.first_slave_jaw_grip_ns > 0
    others = row.first_slave_jaw_grip if is_second else row.second_slave_jaw_grip
    scene[_SECOND] = 1.0 if is_second else 0.0
    scene[_SECOND + 1], scene[_SECOND + 2] = row.slave_jaw_grip[_GRIPS], others[_GRIPS]
    scene[_SECOND + 3], scene[_SECOND + 4] = row.slave_jaw_board[0], row.slave_jaw_board[1]
    for i in range(scene.shape[0] - _FIRST_BLOCK):
        scene[_FIRST_BLOCK + i] = row.slave_jaw_board[_BOARD + i]
    part.judge(part.numbers, part.memory, scene, row.task_state)


class RunningTask(RunningStage):
    """Stage of a task; it begins when the slave first follows the hand."""

    def __init__(self, parameters: TaskParameters, dt: float = DT) -> None:
        super().__init__(TASK, 0, dt)
        self.state = record(TaskState)
        self.kernel = task_step
        kind = TASKS.find(parameters.kind.kind)
        numbers = kind.numbers(parameters.kind.parameters)
        self._part = TaskPart(kind.judge_pointer, numbers, np.zeros(MEMORY), np.zeros(len(SCENE)))
        self.arguments = (record(TaskState), self.state, self._part)
        self._begin = self.signals.copy()
        self.reset()

    def reset(self) -> None:
        """Return to the state without a goal."""
        assign(self.state, 0)
        assign(self.signals, self._begin)
        self._part.memory[:] = 0.0

    def retune(self, parameters: TaskParameters) -> None:
        """Take new numbers of the task from the next tick on; the present goal does not change."""
        self._part.numbers[:] = TASKS.find(parameters.kind.kind).numbers(parameters.kind.parameters)


TASK = Stage(
    "task",
    TaskParameters,
    reads=(topics.SLAVE_TRUE_CP, topics.HAND_JAW, topics.TELEOP_STATE, topics.SLAVE_TRUE_CF, *_JAWS),
    writes=(topics.TASK_STATE,),
    late=(topics.HAND_JAW, topics.TELEOP_STATE, topics.FIRST_JAW_GRIP, topics.SECOND_JAW_GRIP),
    optional=(topics.SLAVE_TRUE_CF, *_JAWS),
    make=RunningTask,
)
