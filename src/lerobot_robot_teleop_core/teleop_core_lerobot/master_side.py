"""Side of the master: from the hand to the joints that it asks of a slave.

A program that leads the slave hands over to the hand so: :meth:`MasterSide.hold` presses the clutch, so that the hand
moves nothing; :meth:`MasterSide.feel` moves the session's own slave to the joints where the program has led the arm;
:meth:`MasterSide.release` waits until it is there, and lets the clutch go. The hand then leads from these joints on.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.graph import copy, topics
from teleop_core.graph.operation import State
from teleop_core.kernels.fields import Wrench
from teleop_core.slave.operation.states import Answer
from teleop_core_lerobot.side import FORCE, SECOND_NS, Side

_PATIENCE = 60.0  # longest move to given joints [s]
GIVEN_CF = tc.Topic("given/measured_cf", tc.Kind.WRENCH, frame_id="slave_base", is_seldom=True)
"""Force on the tip that the loop gave last; before: the force on the simulated slave's tip."""
GIVEN_BUTTONS = tc.Topic("given/buttons", tc.Kind.BUTTONS, frame_id="master_base", is_seldom=True)
"""Buttons of the hand, with the clutch pressed while the loop holds the master."""


class GivenForce(tc.Fields):
    """What the loop gave last: force [N] and torque [N·m] (6,), and whether it gave any."""

    wrench: Wrench
    is_given: int


class GivenClutch(tc.Fields):
    """Whether the loop holds the master."""

    is_held: int


class GivenForceRow(tc.Row):
    """Ports of the stage ``given_force``."""

    given_measured_cf: NDArray[np.float64]


class GivenClutchRow(tc.Row):
    """Ports of the stage ``given_clutch``."""

    given_buttons: NDArray[np.float64]


@tc.kernel
def _give_force(p: Any, s: GivenForce, row: GivenForceRow, dt: float) -> None:
    """Tell the force that was given, or the simulated one before."""
    for i in range(6):
        row.given_measured_cf[i] = s.wrench[i] if s.is_given else row.slave_measured_cf[i]


@tc.kernel
def _give_clutch(p: Any, s: GivenClutch, row: GivenClutchRow, dt: float) -> None:
    """Tell the buttons of the hand, and press the clutch while the master is held."""
    copy(row.master_buttons, row.given_buttons)
    if s.is_held:
        row.given_buttons[0] = 1.0


GIVEN_FORCE = tc.Stage(
    "given_force",
    tc.NoParameters,
    reads=(topics.SLAVE_MEASURED_CF,),
    writes=(GIVEN_CF,),
    step=_give_force,
    state=GivenForce,
    replaces=topics.SLAVE_MEASURED_CF,
)
GIVEN_CLUTCH = tc.Stage(
    "given_clutch",
    tc.NoParameters,
    reads=(topics.MASTER_BUTTONS,),
    writes=(GIVEN_BUTTONS,),
    step=_give_clutch,
    state=GivenClutch,
    replaces=topics.MASTER_BUTTONS,
)
for _stage in (GIVEN_FORCE, GIVEN_CLUTCH):
    tc.register_stage(_stage, replace=True)


class MasterSide(Side):
    """The master, from the hand to the joint references that it asks of a slave.

    The session has a simulated slave of its own, which the hand sees and feels until a force is given.
    """

    def __init__(
        self, robot: str = "", scenario: str = "", settings: Sequence[str] = (), fps: int = 30, bag: str = ""
    ) -> None:
        super().__init__([GIVEN_FORCE, GIVEN_CLUTCH], robot, scenario, settings, fps, bag)

    @property
    def feedback_keys(self) -> tuple[str, ...]:
        """Keys of what a loop may give: joints to move to while held [rad or m], and force on the tip [N]."""
        return (*self.joint_keys, *FORCE)

    def next_action(self) -> dict[str, float]:
        """Let one period pass, and tell the joint references at its end [rad or m].

        Raises:
            SessionError: No session runs.
        """
        self._advance_period()
        return self._named(self._row["slave_servo_jp"])

    def hold(self) -> None:
        """Press the clutch from the next tick on: the hand moves nothing until :meth:`release`.

        Raises:
            SessionError: No session runs.
        """
        self._given(GIVEN_CLUTCH)["is_held"] = True

    def release(self) -> None:
        """Let periods pass until the session's slave is at the joints that were given, then let the clutch go.

        Does nothing if the master is not held.

        Raises:
            SessionError: No session runs, or the slave does not get there, because it is stopped.
        """
        given, began = self._given(GIVEN_CLUTCH), self._running.now_ns
        if not given["is_held"]:
            return
        while self._slave.motion.source == "move":
            if self._running.now_ns - began > _PATIENCE * SECOND_NS:
                state = int(self._slave.operation["state"])
                raise tc.SessionError(f"the master's own slave does not move: its state is {State(state).name}")
            self._advance_period()
        self._advance_period()  # the chain has the slave's setpoint as its command now
        given["is_held"] = False

    def feel(self, feedback: Mapping[str, float]) -> None:
        """Give the force on the slave's tip from the next tick on; while held, joints to move to as well.

        Args:
            feedback: Has ``force.x``, ``force.y`` and ``force.z`` along slave_base [N], or all of ``joint_keys``
                [rad or m], or both; other keys are left alone, so that a whole observation will do. Joints beyond
                their limits are moved to the limits. Joints have no effect unless the master is held.

        Raises:
            ParameterError: Both groups of keys are incomplete, or a number is not finite.
            SessionError: No session runs, or the session's slave refuses the move, as it is stopped.
        """
        groups = [keys for keys in (FORCE, self.joint_keys) if all(key in feedback for key in keys)]
        given = {key: feedback[key] for keys in groups for key in keys}
        if not given or not np.isfinite(list(given.values())).all():
            needed = f"finite {', '.join(FORCE)}, or a finite number for each of {', '.join(self.joint_keys)}"
            raise tc.ParameterError("feedback", dict(feedback), needed)
        force = self._given(GIVEN_FORCE)
        if FORCE[0] in given:
            force["wrench"][:3], force["is_given"] = [given[key] for key in FORCE], True
        if self.joint_keys[0] in given and self._given(GIVEN_CLUTCH)["is_held"]:
            self._go_to(np.array([given[key] for key in self.joint_keys]))

    def _go_to(self, joints: NDArray[np.float64]) -> None:
        robot = self._slave.robot
        answer, text = self._slave.motion.move(np.clip(joints, robot.lower, robot.upper))
        if answer not in {Answer.DONE, Answer.ALREADY}:
            raise tc.SessionError(f"the master's own slave: {text}")
