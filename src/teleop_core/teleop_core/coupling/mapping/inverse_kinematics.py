"""Inverse kinematics as a stage: it converts every slave pose to joint references, within the joint speeds."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from teleop_core.base import Within, fill, parameter
from teleop_core.graph import DT, Row, RunningStage, Stage, assign, copy, topics
from teleop_core.kernels import Array, Fields, PerJoint, inner, kernel, record
from teleop_core.kernels.geometry import rotation_vector_between, transform_from_pose
from teleop_core.kinematics import IkStatus
from teleop_core.robots import load_robot_set
from teleop_core.robots.robot import Robot
from teleop_core.robots.selection import RobotParameters


@dataclass(frozen=True, kw_only=True)
class InverseKinematicsParameters(RobotParameters):
    """Parameters of :class:`InverseKinematics`."""

    speed_share: float = parameter(
        1.0, Within(0.01, 1.0), "share of the drives' speed limits that joint references may use"
    )
    position_tolerance: float = parameter(
        1e-3,
        Within(0.0, 1.0, "m"),
        "an arm at its speed limit counts as following while its position error is less than this",
    )
    rotation_tolerance: float = parameter(
        math.radians(1.0),
        Within(0.0, 1.0, "rad"),
        "an arm at its speed limit counts as following while its orientation error is less than this",
    )
    longest_pause: float = parameter(
        0.3,
        Within(0.002, 5.0, "s"),
        "largest time between two commands of one stream; for a command after a longer pause, joints "
        "may move as far as full speed allows in 0.45 s",
    )
    feedback_timeout: float = parameter(
        0.1,
        Within(0.002, 5.0, "s"),
        "largest age of the slave's setpoint; if it is older, the solver starts from the slave's "
        "joints again. If commands are slow, the limit is twice their period",
    )


class SolverRecord(InverseKinematicsParameters, Fields):
    """Parameter record of the inverse kinematics."""

    speed: PerJoint  # largest speeds [rad/s or m/s]
    longest_ns: int
    timeout_ns: int


def derive(p: SolverRecord, parameters: InverseKinematicsParameters, robot: Robot) -> None:
    """Write what follows from the parameters and the robot."""
    p.speed[:] = robot.speed_limit * parameters.speed_share
    p.longest_ns = round(parameters.longest_pause * 1e9)
    p.timeout_ns = round(parameters.feedback_timeout * 1e9)


class SolverState(Fields):
    """State record of the inverse kinematics."""

    last_ns: int
    asked: int
    limited: int
    limit: int
    joint: int


class Solver(NamedTuple):
    """Solver of one robot with scratch arrays: plain arrays for robot kernels."""

    fk: Any
    ik: Any
    limits: Array  # rows lower, upper, largest step
    geometry: Array
    T: Array
    reached: Array
    seed: Array  # joints of the last solution (n,)
    q: Array
    free: Array  # the answer without a time limit
    before: Array  # the slave's setpoint at the last command, while the slave follows no command
    residual: Array


_STATUS, _LIMIT, _JOINT, _RESIDUAL, _CUT = 0, 1, 2, 3, 5
_NONE, _AT_JOINT, _BEYOND = int(topics.Limit.NONE), int(topics.Limit.JOINT), int(topics.Limit.WORKSPACE)
_SINGULAR, _SLOW = int(topics.Limit.SINGULARITY), int(topics.Limit.SPEED)
_FOLLOWED, _NEAR_SINGULAR = int(IkStatus.FOLLOWED), int(IkStatus.NEAR_SINGULAR)
# A step [rad or m] so large that it never limits the speed; the path is followed without a time limit.
_ANY_STEP = 1e6
# A single or first command may be at most the distance covered at full speed in this time [s]. The slave accepts up to
# 0.5 s of full-speed motion as one command.
_ALONE = 0.45
# A joint motion longer than this is too long for a tremor [s at full speed]; a prismatic joint moves a millimetre in
# it.
_FAR = 0.02
# A joint this close to its limit [rad or m] counts as at the limit.
_AT = 1e-9


@inner
def _is_reached(status: int) -> bool:
    return status in (_FOLLOWED, _NEAR_SINGULAR)


@inner
def _joint_at_limit(q: Array, limits: Array) -> int:
    """First joint at a joint limit; -1 if there is none."""
    for i in range(q.shape[0]):
        if q[i] <= limits[0, i] + _AT or q[i] >= limits[1, i] - _AT:
            return i
    return -1


@inner
def _explain(p: SolverRecord, solver: Solver, reach: Array) -> None:
    """Write the reason why the arm does not reach the command, and the distance by which it is out of reach.

    The pose is solved again without a time limit. If this solution reaches the command, the arm only lags. A lag is
    reported if it exceeds the tolerance.
    """
    T, q, free, limits = solver.T, solver.q, solver.free, solver.limits
    copy(q, free)
    status = _BEYOND
    if math.isfinite(limits[2, 0]):
        for i in range(q.shape[0]):
            limits[2, i] = _ANY_STEP
        status = solver.ik(T, solver.seed, limits, solver.geometry, free, solver.residual)
    if _is_reached(status):
        solver.fk(q, solver.geometry, solver.reached)
        status = solver.ik(solver.reached, q, limits, solver.geometry, free, solver.residual)
        is_near = reach[_RESIDUAL] <= p.position_tolerance and reach[_RESIDUAL + 1] <= p.rotation_tolerance
        if is_near:
            reach[_STATUS] = status
        else:
            reach[_LIMIT] = _SINGULAR if status == _NEAR_SINGULAR else _SLOW
        return
    reach[_JOINT] = _joint_at_limit(free, limits)
    reach[_LIMIT] = _AT_JOINT if reach[_JOINT] >= 0.0 else _BEYOND
    solver.fk(free, solver.geometry, solver.reached)
    for i in range(3):
        reach[_CUT + i] = solver.reached[i, 3] - T[i, 3]
    rotation_vector_between(T, solver.reached, reach[_CUT + 3 : _CUT + 6])


@inner
def _has_own_way(s: SolverState, solver: Solver, row: Row, timeout_ns: int) -> bool:
    """Whether the slave does not follow, because its setpoint is old or moves by itself."""
    if row.slave_setpoint_js_ns > topics.NO_COMMAND_NS:
        return bool(s.last_ns - row.slave_setpoint_js_ns > timeout_ns)
    moves = False
    for i in range(solver.before.shape[0]):
        moves = moves or row.slave_setpoint_js[i] != solver.before[i]
    copy(row.slave_setpoint_js, solver.before)
    return moves


@inner
def _goes_far(p: SolverRecord, solver: Solver) -> bool:
    """Whether the answer turns a joint farther than small motions of the tip need."""
    for i in range(solver.q.shape[0]):  # noqa: SIM110 - compiled
        if abs(solver.q[i] - solver.seed[i]) > _FAR * p.speed[i]:
            return True
    return False


@inner
def _solve(p: SolverRecord, solver: Solver, time: float, is_alone: bool) -> int:
    """Write the joints that the arm can reach in ``time`` [s] at full speed; for a single command, the final joints.

    Next to a singularity a tremor of the first command would cause large useless joint motions. So joints move far
    only if the pose would otherwise be outside the tolerances.
    """
    longest = _ALONE if is_alone else time
    status = -1
    for attempt in range(3):
        for i in range(solver.q.shape[0]):
            solver.limits[2, i] = p.speed[i] * longest
        status = solver.ik(solver.T, solver.seed, solver.limits, solver.geometry, solver.q, solver.residual)
        near = solver.residual[0] <= p.position_tolerance and solver.residual[1] <= p.rotation_tolerance
        if attempt == 0 and is_alone and _goes_far(p, solver):
            longest = time
        elif attempt == 1 and not near:
            longest = _ALONE
        else:
            break
    return status


@kernel
def inverse_kinematics_step(p: SolverRecord, s: SolverState, solver: Solver, row: Row, dt: float) -> None:
    """One slave pose: write slave_servo_jp and slave_reach.

    The answer is the solution nearest to the last answer. While the slave does not follow, it is the solution nearest
    to the slave's own setpoint, so that a restart never changes the branch. Joints move as far as their speed allows
    in the time since the last command, at any rate of commands. The answer to a single command is the whole motion,
    which the slave makes within its own limits.
    """
    T, seed, q = solver.T, solver.seed, solver.q
    elapsed_ns = row.slave_servo_cp_ns - s.last_ns
    is_alone = s.last_ns == 0 or elapsed_ns > p.longest_ns
    if elapsed_ns <= 0:
        elapsed_ns = round(dt * 1e9)
    elapsed_ns = min(elapsed_ns, p.longest_ns)
    if s.last_ns == 0 or _has_own_way(s, solver, row, max(p.timeout_ns, 2 * elapsed_ns)):
        copy(row.slave_setpoint_js, seed)
    s.last_ns = row.slave_servo_cp_ns
    transform_from_pose(row.slave_servo_cp, T)
    reach = row.slave_reach
    for i in range(reach.shape[0]):
        reach[i] = 0.0
    status = _solve(p, solver, elapsed_ns * 1e-9, is_alone)
    reach[_STATUS], reach[_LIMIT], reach[_JOINT] = status, _NONE, -1.0
    if status >= 0:
        copy(solver.residual, reach[_RESIDUAL : _RESIDUAL + 2])
        if not _is_reached(status):
            _explain(p, solver, reach)
        copy(q, seed)
    s.asked += 1
    if reach[_LIMIT] != _NONE:
        s.limited += 1
        s.limit, s.joint = int(reach[_LIMIT]), int(reach[_JOINT])
    copy(seed, row.slave_servo_jp)


class InverseKinematics(RunningStage):
    """Stage that turns slave poses into joint references; ``slave_reach`` contains the result."""

    def __init__(self, parameters: InverseKinematicsParameters, dt: float = DT) -> None:
        self.robot = load_robot_set(parameters.robot, parameters.geometry)
        n = self.robot.n
        super().__init__(INVERSE_KINEMATICS, n, dt)
        self.parameters, self.state = record(SolverRecord, n), record(SolverState)
        self._solver = Solver(
            self.robot.fk_pointer, self.robot.ik_pointer, self.robot.limits(),
            self.robot.geometry_row.copy(), np.zeros((4, 4)), np.zeros((4, 4)), np.zeros(n),
            np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(2),
        )  # fmt: skip
        self.kernel = inverse_kinematics_step
        self.arguments = (self.parameters, self.state, self._solver)
        self.retune(parameters)
        self.reset()

    def reset(self) -> None:
        """Start at the next pose from the slave's position at that time."""
        self._solver.seed[:] = self.robot.home
        assign(self.state, 0)
        self._told = 0, 0

    def concerns(self) -> list[str]:
        """Texts with the reasons why the slave could not follow since the last call."""
        asked, limited = int(self.state["asked"]), int(self.state["limited"])
        share = (limited - self._told[1]) / max(asked - self._told[0], 1)
        self._told = asked, limited
        if share <= 0.0:
            return []
        why = topics.limit_text(int(self.state["limit"]), int(self.state["joint"]), self.robot.joint_names)
        return [f"the slave cannot follow {share:.0%} of the commands: {why}"]

    def retune(self, parameters: InverseKinematicsParameters) -> None:
        """Take new parameters from the next pose on."""
        fill(self.parameters, parameters)
        derive(self.parameters, parameters, self.robot)


INVERSE_KINEMATICS = Stage(
    "inverse_kinematics",
    InverseKinematicsParameters,
    reads=(topics.SLAVE_SERVO_CP, topics.SLAVE_SETPOINT_JS),
    writes=(topics.SLAVE_SERVO_JP, topics.SLAVE_REACH),
    late=(topics.SLAVE_SETPOINT_JS,),
    trigger=topics.SLAVE_SERVO_CP,
    needs=(topics.SLAVE_SETPOINT_JS,),
    make=InverseKinematics,
)
