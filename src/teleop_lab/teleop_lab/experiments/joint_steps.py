"""Joint steps: the step response of each joint of a slave with a control law, and the motion at rest after the step."""

from typing import NamedTuple

import numpy as np

from teleop_core.graph.signals import TICK_NS
from teleop_core.kernels.geometry import Array
from teleop_core.slave.pair import ArmParameters, SimulatedArm

_STEP_S = 0.02  # size of a step, as the time in which the joint moves as far at full speed [s]
_SETTLED_TICKS = 300  # rest before a step
_WAIT_TICKS = 1500  # time after a step in which its overshoot is measured
_REST_TICKS = 2000  # rest after that time


class StepAnswer(NamedTuple):
    """Step responses of a slave's joints, one joint after the other.

    Attributes:
        overshoot: Largest overshoot of each joint (n,), as a share of the step.
        rest_error: Distance between the tip by the encoders and the tip by the setpoints: RMS over the rests after all
            steps [m].
        rest_travel: Largest change of each encoder (n,) during a rest of two seconds, over all steps [counts].
    """

    overshoot: Array
    rest_error: float
    rest_travel: Array


def answer_to_steps(parameters: ArmParameters) -> StepAnswer:
    """Apply a step to one joint after the other, each from home and towards the middle of the joint's range.

    Args:
        parameters: Parameters of the slave. Switch its reference filter off, and start it at home.
    """
    n = SimulatedArm(parameters).robot.n
    overshoot, travel, errors = np.zeros(n), np.zeros(n), []
    for joint in range(n):
        over, error, moved = _one_step(SimulatedArm(parameters), joint)
        overshoot[joint] = over
        errors.append(error)
        travel = np.maximum(travel, moved)
    return StepAnswer(overshoot, float(np.sqrt(np.mean(np.square(errors)))), travel)


def _one_step(slave: SimulatedArm, joint: int) -> tuple[float, float, Array]:
    """Apply a step; returns overshoot [share], rest error of the tip [m] and travel at rest (n,) [counts]."""
    robot = slave.robot
    drives, n = robot.drives, robot.n
    assert drives is not None
    goal = robot.home.copy()
    _measured(slave, goal, slave.lead + _SETTLED_TICKS)
    toward = 1.0 if goal[joint] <= 0.5 * (robot.lower[joint] + robot.upper[joint]) else -1.0
    step = toward * _STEP_S * drives.speed_limit[joint]
    goal[joint] += step
    moved = _measured(slave, goal, _WAIT_TICKS)
    rests = _measured(slave, goal, _REST_TICKS)
    beyond = float(np.max((moved[:, joint] - goal[joint]) / step))
    tips = robot.fk(rests[::20])[:, :3, 3] - robot.fk(goal)[:3, 3]
    error = float(np.sqrt(np.mean(np.sum(tips**2, axis=1))))
    return max(beyond, 0.0), error, np.round(np.ptp(rests[:, :n], axis=0) / drives.encoder_step)


def _measured(slave: SimulatedArm, goal: Array, ticks: int) -> Array:
    """Encoder positions (ticks, n) under a constant command."""
    row, n = slave.signals, slave.robot.n
    rows = np.empty((ticks, n))
    for k in range(ticks):
        row["now_ns"] += TICK_NS
        row["slave_servo_jp"], row["slave_servo_jp_ns"] = goal, row["now_ns"]
        slave.step()
        rows[k] = row["slave_measured_js"][:n]
    return rows
