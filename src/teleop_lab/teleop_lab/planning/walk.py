"""Walk: a hand's path through motion scaling and inverse kinematics alone.

A walk runs the stages of a session sample after sample, with a slave that reaches every command at once. The followed
motion, the cut-off motion and the causes are those of a session. The computation is about a hundred times faster.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.coupling.mapping.inverse_kinematics import InverseKinematics, InverseKinematicsParameters
from teleop_core.coupling.mapping.motion_scaling import MotionScaling
from teleop_core.graph import DT, assign, topics
from teleop_core.kernels import Array, pose_from_transform, raise_pending, records
from teleop_core.kernels.program import Program
from teleop_lab.planning.asked import AskedPath
from teleop_lab.planning.placement import Placement

_COLUMN = {name: column for column, name in enumerate(topics.SLAVE_REACH.columns)}
# Larger than any speed limit [rad/s or m/s].
_ANY_SPEED = 1e6


@dataclass(frozen=True, eq=False)
class Walked:
    """Result of a walk along a path.

    Attributes:
        weights: Share of the time (N,) that each sample represents; they add up to 1.
        asked: Poses (N, 7) [m] commanded to the slave.
        reached: Poses (N, 7) [m] that the slave reaches.
        q: Joints (N, n) [rad, m] of the slave.
        limit: :class:`~teleop_core.graph.topics.Limit` (N,) that kept the slave from following.
        joint: Joint (N,) that was at its limit; -1 for none.
        residual: Distance [m] and angle [rad] (N, 2) from the commanded pose.
    """

    weights: Array
    asked: Array
    reached: Array
    q: Array
    limit: NDArray[np.int64]
    joint: NDArray[np.int64]
    residual: Array

    @property
    def share(self) -> float:
        """Share of the time in which the slave follows the command."""
        return float(self.weights[self.limit == topics.Limit.NONE].sum())

    @property
    def causes(self) -> dict[str, float]:
        """Share of the time in which the slave does not follow, by the name of the cause."""
        causes = (limit for limit in topics.Limit if limit is not topics.Limit.NONE)
        return {c.name.lower(): float(self.weights[self.limit == c].sum()) for c in causes}


class Walker:
    """Walks a path with one placement after the other.

    Args:
        path: Motion of the hand.
        scaling: Parameters of motion scaling; a placement overrides them.
        solving: Parameters of inverse kinematics, with the robot.
    """

    def __init__(self, path: AskedPath, scaling: MotionScalingParameters, solving: InverseKinematicsParameters) -> None:
        self.path = path
        self._parameters = scaling
        self._scaling, self._solving = MotionScaling(scaling), InverseKinematics(solving)
        self.robot = self._solving.robot
        self._speed = self._solving.parameters["speed"].copy()
        self.weights = _weights(path, scaling.longest_pause)
        pauses_ns = self._pauses(scaling.longest_pause)
        self._scaling_pause, self._solving_pause = pauses_ns
        self._fill()
        self._programs = {is_cut: self._program(is_cut=is_cut) for is_cut in (False, True)}

    def _pauses(self, longest: float) -> tuple[int, int]:
        """Return the longest allowed pauses of both stages [ns]; a thinned path allows longer pauses."""
        usual_ns = 3 * int(np.median(np.diff(self.path.stamp_ns)))
        solving_ns = int(self._solving.parameters["longest_ns"])
        return max(round(longest * 1e9), usual_ns), max(solving_ns, usual_ns)

    def _fill(self) -> None:
        n, count = self.robot.n, len(self.path)
        fields = [("stamp_ns", "i8"), ("pose", "f8", (7,)), ("buttons", "f8", (3,))]
        self._samples = records(fields, count)
        self._samples["stamp_ns"] = self.path.stamp_ns
        self._samples["pose"], self._samples["buttons"] = self.path.poses, self.path.buttons
        width = len(topics.SLAVE_REACH.columns)
        kinds = [("command", "f8", (7,)), ("reached", "f8", (7,)), ("q", "f8", (n,))]
        self._answers = records([*kinds, ("reach", "f8", (width,))], count)

    def _program(self, *, is_cut: bool) -> Program:
        """Steps of both stages for each sample, with a slave that reaches every command at once."""
        scaling, solving, robot, made = self._scaling, self._solving, self.robot, Program()
        s, r = np.asarray(scaling.signals), np.asarray(solving.signals)
        samples, answers, T, q = (
            np.asarray(self._samples),
            np.asarray(self._answers),
            np.zeros((4, 4)),
            np.zeros(robot.n),
        )
        made.copy(samples["pose"], s["master_measured_cp"], from_rows=True)
        made.copy(samples["buttons"], s["master_buttons"], from_rows=True)
        stamp = s["master_measured_cp_ns"]
        made.copy(samples["stamp_ns"], stamp, from_rows=True)
        made.call(scaling.kernel, *scaling.arguments, scaling.signals, DT)
        made.copy(s["slave_servo_cp"], r["slave_servo_cp"])
        made.copy(stamp, r["slave_servo_cp_ns"])
        made.call(solving.kernel, *solving.arguments, solving.signals, DT)
        made.copy(r["slave_servo_jp"], r["slave_setpoint_js"])
        made.copy(r["slave_servo_jp"], q)
        made.call(robot.kernels.fk, q, robot.geometry_row.copy(), T)
        made.call(pose_from_transform, T, s["slave_setpoint_cp"])
        for setpoint in (r["slave_setpoint_js_ns"], s["slave_setpoint_cp_ns"]):
            made.copy(stamp, setpoint)
        if is_cut:
            made.copy(r["slave_reach"], s["slave_reach"])
            made.copy(stamp, s["slave_reach_ns"])
        kept = {"command": s["slave_servo_cp"], "reached": s["slave_setpoint_cp"], "q": q, "reach": r["slave_reach"]}
        for name, value in kept.items():
            made.copy(value, answers[name], to_rows=True)
        return made

    def share(self, placement: Placement, *, is_cut: bool = True) -> float:
        """Share of the time in which the slave follows with a placement, as :attr:`Walked.share`.

        For the arguments see `walk`.
        """
        self._run(placement, is_cut=is_cut, is_fast=False)
        is_followed = self._answers["reach"][:, _COLUMN["limit"]] == topics.Limit.NONE
        return float(self.weights[is_followed].sum())

    def walk(self, placement: Placement, *, is_cut: bool = True, is_fast: bool = False) -> Walked:
        """Compute how the slave follows the path.

        Args:
            placement: Start, turn and gains.
            is_cut: Whether a limit cuts the hand's motion, as in a session. Otherwise every pose of the original path
                is commanded.
            is_fast: Whether joints may be as fast as the path needs.
        """
        self._run(placement, is_cut=is_cut, is_fast=is_fast)
        answers, reach = self._answers, self._answers["reach"]
        return Walked(
            weights=self.weights,
            asked=answers["command"].copy(),
            reached=answers["reached"].copy(),
            q=answers["q"].copy(),
            limit=reach[:, _COLUMN["limit"]].astype(np.int64),
            joint=reach[:, _COLUMN["joint"]].astype(np.int64),
            residual=reach[:, _COLUMN["position_residual"] : _COLUMN["cut_x"]].copy(),
        )

    def _run(self, placement: Placement, *, is_cut: bool, is_fast: bool) -> None:
        scaling, solving = self._scaling, self._solving
        scaling.retune(
            replace(
                self._parameters,
                axes=placement.axes,
                coarse_gain=placement.coarse_gain,
                fine_gain=placement.fine_gain,
                rotation_gain=placement.rotation_gain,
                tool_axes=placement.tool_axes,
                tool_roll=placement.tool_roll,
            )
        )
        for stage in (scaling, solving):
            assign(stage.signals, 0)
            stage.reset()
        scaling.parameters["pause_ns"] = self._scaling_pause
        solving.parameters["longest_ns"] = self._solving_pause
        solving.parameters["speed"] = _ANY_SPEED if is_fast else self._speed
        start = np.array(placement.start)
        solving.signals["slave_setpoint_js"] = start
        pose_from_transform(self.robot.fk(start), scaling.signals["slave_setpoint_cp"])
        program = self._programs[is_cut]
        program.clock["count"] = len(self.path)
        program.run()
        raise_pending()


def _weights(path: AskedPath, longest: float) -> Array:
    """Share of the time (N,) that each sample represents: up to the next sample, at most the longest pause."""
    steps = np.diff(path.time)
    held = np.minimum(np.append(steps, np.median(steps)), max(longest, 3.0 * np.median(steps)))
    return np.asarray(held / held.sum(), dtype=np.float64)
