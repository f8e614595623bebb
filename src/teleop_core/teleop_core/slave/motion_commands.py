"""Motion commands: commands to an arm other than a stream of joint references.

The commands are those of CRTK (Collaborative Robotics Toolkit): moves to a goal, speeds of joints and tip, steps
relative to the last command, and hold. The limits, states and faults of the slave's step apply to all of them. Only one
command moves the arm at a time:

- a move replaces any other motion, and only another move or a hold replaces a move;
- of several streams the first one moves the arm, until it is silent for the command timeout
  (:mod:`teleop_core.slave.ownership`);
- hold ends a move, a speed command, and a single reference.
"""

from typing import Any, Protocol

import numpy as np

from teleop_core.base.errors import ShapeError
from teleop_core.graph.operation import State
from teleop_core.graph.topics import NO_COMMAND_NS
from teleop_core.kernels import Array, length, records
from teleop_core.kinematics import IkStatus
from teleop_core.robots.robot import Robot
from teleop_core.slave import ownership
from teleop_core.slave.operation.states import Answer, Event
from teleop_core.slave.ownership import Leader
from teleop_core.slave.velocity import MotionSource

_REACHED = (IkStatus.FOLLOWED, IkStatus.NEAR_SINGULAR)
# A goal may exceed a limit by this much [rad or m], because a setpoint at the limit is rounded.
_SLACK = 1e-6
# A speed more than this many times as fast as the arm could ever move is refused; a smaller one is reduced.
_BEYOND = 100.0
# Least lever between a joint and the tip for the bound of a twist [m].
_LEVER = 1.0
Told = tuple[Answer, str]
"""Answer to a command, and its text."""


class Commanded(Protocol):
    """Parts of a slave that motion commands need."""

    robot: Robot
    parameters: Any
    state: Any

    def request(self, event: Event | str) -> Told:
        """Take a command of the state machine."""


class MotionCommands:
    """Takes motion commands for a slave, between two ticks.

    Every command returns an :class:`~teleop_core.slave.operation.Answer` and a text with the same content. A command
    that the arm cannot do, or may not do in its state, is refused and changes nothing.

    Args:
        slave: The slave; its state is written.
    """

    def __init__(self, slave: Commanded) -> None:
        self._slave, robot = slave, slave.robot
        levers = np.maximum(length(robot.jacobian(robot.home)[:3].T), _LEVER)
        fastest = np.array([np.sum(levers * robot.speed_limit), np.sum(robot.speed_limit)])
        self._fastest_twist = np.repeat(fastest, 3)  # (6,) [m/s, rad/s]

    # -- what it does ----------------------------------------------------------------------------

    @property
    def goal(self) -> Array:
        """Joint positions (n,) [rad or m] at which the arm will rest: the goal of a move, or the last reference."""
        s = self._slave.state
        return np.array(s["move_to"] if s["is_busy"] else s["target"], dtype=np.float64)

    @property
    def source(self) -> str:
        """Kind of command that moves the arm: ``move``, ``velocity``, ``servo``, or ``nothing``."""
        s = self._slave.state
        if s["is_busy"]:
            return "home" if s["is_homing"] else "move"
        if s["motion"] != MotionSource.FOLLOWING:
            return "velocity"
        return "servo" if s["arrival_ns"] > 0 else "nothing"

    # -- moves -----------------------------------------------------------------------------------

    def move(self, goal: object) -> Told:
        """Move smoothly to joints, from rest to rest; an arm in motion brakes to rest first.

        Args:
            goal: Joints (n,) [rad or m].

        Raises:
            ShapeError: The length of ``goal`` is not the number of joints.
        """
        wanted = np.asarray(goal, dtype=np.float64)
        if refusal := self._unfit(wanted):
            return refusal
        s = self._slave.state
        if s["is_homing"]:
            return Answer.REFUSED, "move refused: it is homing; wait until it is homed"
        answer, text = self._slave.request(Event.MOVE)
        if answer is not Answer.DONE:
            return answer, text
        s["move_to"], s["motion"] = wanted, MotionSource.FOLLOWING
        return answer, "move: on the way"

    def move_by(self, step: object) -> Told:
        """Move by a step of joints (n,) [rad or m] from the setpoint."""
        return self.move(self._slave.state["setpoint"] + self._joints(step))

    def solve(self, T: object) -> Array | Told:
        """Return the joints (n,) at which the tip has the pose T (4, 4), next to the setpoint; or a refusal.

        Of the branches inside the joint limits, the one nearest to the setpoint is taken. The computation is too long
        for a tick: a running session solves outside the ticks, and passes the joints to :meth:`move`.

        Raises:
            ShapeError: ``T`` does not have the shape (4, 4).
        """
        seed = np.array(self._slave.state["setpoint"], dtype=np.float64)
        found = self._slave.robot.ik(T, seed)
        if found.status in _REACHED:
            return found.q
        far, turned = 1e3 * found.residual[0], np.degrees(found.residual[1])
        short = f"the arm comes no nearer than {far:.3g} mm and {turned:.3g}°"
        return Answer.REFUSED, f"refused: out of reach, {short}"

    def load(self) -> None:
        """Compile what commands call, since compiling during a session would make the ticks late."""
        robot, now_ns = self._slave.robot, 0
        self.solve(robot.fk(robot.home))
        self.refusal_of_age(now_ns, now_ns)
        self._refusal_beside(Leader.SERVO_JP, now_ns)
        ownership.lead(records(self._slave.state.dtype)[0], 0, now_ns)

    def refusal_of_age(self, stamp_ns: int, now_ns: int) -> Told | None:
        """Why a command is refused for its age; None if it is not.

        Args:
            stamp_ns: Stamp of the command [ns]; 0 for a command without a stamp, which has no age.
            now_ns: Time of arrival, on the clock of the ticks [ns].
        """
        p = self._slave.parameters
        if stamp_ns == 0 or not ownership.has_wrong_age(p, stamp_ns, now_ns):
            return None
        age, most = 1e-9 * (now_ns - stamp_ns), 1e-9 * int(p["oldest_ns"])
        if age < 0.0:
            return Answer.REFUSED, f"refused: its stamp is {-age:.3g} s ahead of this clock; set the clocks"
        needed = f"at most {most:g} s (slave.operation.oldest_command)"
        return Answer.REFUSED, f"refused: it is {age:.3g} s old, {needed}"

    # -- streams ---------------------------------------------------------------------------------

    def drive_joints(self, speed: object, now_ns: int) -> Told:
        """Drive joints at the given speeds until the command timeout is over; then brake to rest.

        Args:
            speed: Joint speeds (n,) [rad/s or m/s]; speeds above the drives' limits are all reduced in proportion.
            now_ns: Time of arrival, on the clock of the ticks [ns].

        Raises:
            ShapeError: The length of ``speed`` is not the number of joints.
        """
        wanted, most = self._joints(speed), _BEYOND * self._slave.robot.speed_limit
        return self._drive(Leader.SERVO_JV, wanted, most, now_ns)

    def drive_tip(self, twist: object, now_ns: int) -> Told:
        """Drive the tip at the given twist until the command timeout is over; then brake to rest.

        The tip lags near singularities and when joints reach their limits.

        Args:
            twist: Linear and angular velocity (6,) of the tip in base axes [m/s, rad/s].
            now_ns: Time of arrival, on the clock of the ticks [ns].

        Raises:
            ShapeError: ``twist`` does not have the shape (6,).
        """
        return self._drive(Leader.SERVO_CV, _row(twist, 6), _BEYOND * self._fastest_twist, now_ns)

    def servo(self, joints: object, now_ns: int, leader: Leader = Leader.INTERPOLATE_JP) -> Told:
        """Follow a joint reference (n,) [rad or m], like one of ``slave/servo_jp``.

        Args:
            joints: Reference (n,) [rad or m].
            now_ns: Time of arrival, on the clock of the ticks [ns].
            leader: Command by which the reference came.

        Raises:
            ShapeError: The length of ``joints`` is not the number of joints.
        """
        wanted = self._joints(joints)
        if refusal := self._unfit(wanted) or self._refusal() or self._refusal_beside(leader, now_ns):
            return refusal
        s = self._slave.state
        s["asked"], s["asked_ns"], s["asked_by"] = wanted, now_ns, leader
        return Answer.DONE, "servo: taken"

    def servo_by(self, step: object, now_ns: int) -> Told:
        """Follow a step of joints (n,) [rad or m], relative to the last command."""
        s = self._slave.state
        last = s["asked"] if s["asked_ns"] else s["target"]
        return self.servo(last + self._joints(step), now_ns, Leader.SERVO_JR)

    def hold(self) -> Told:
        """Brake to rest and stay there until the next command; an active stream continues to move the arm.

        To stop a stream, pause the arm.
        """
        s = self._slave.state
        if s["state"] != State.ENABLED:
            return Answer.ALREADY, "hold: nothing to do, it does not move"
        if s["is_homing"]:
            return Answer.REFUSED, "hold refused: it is homing; pause or disable it"
        s["is_busy"] = s["must_plan"] = 0
        s["motion"], s["drive"], s["driven_ns"] = MotionSource.JOINTS, 0.0, 0
        return Answer.DONE, "hold: done"

    def _drive(self, leader: Leader, wanted: Array, most: Array, now_ns: int) -> Told:
        if not np.isfinite(wanted).all():
            return Answer.REFUSED, "velocity refused: it holds NaN or infinite numbers"
        if (np.abs(wanted) > most).any():
            i = int(np.flatnonzero(np.abs(wanted) > most)[0])
            return (
                Answer.REFUSED,
                f"velocity refused: {wanted[i]:.3g} is over {_BEYOND:g} times as fast as the arm can move",
            )
        if refusal := self._refusal() or self._refusal_beside(leader, now_ns):
            return refusal
        s, is_joints = self._slave.state, leader is Leader.SERVO_JV
        if s["motion"] == MotionSource.FOLLOWING:
            s["command_stamp_ns"] = NO_COMMAND_NS
        s["drive" if is_joints else "twist"], s["driven_ns"] = wanted, now_ns
        s["motion"] = MotionSource.JOINTS if is_joints else MotionSource.TIP
        ownership.lead(s, int(leader), now_ns)
        return Answer.DONE, "velocity: taken"

    def _refusal_beside(self, leader: Leader, now_ns: int) -> Told | None:
        """Why a stream does not move the arm beside another one; None if it does."""
        s = self._slave.state
        if not ownership.is_led_by_another(self._slave.parameters, s, int(leader), now_ns):
            return None
        return Answer.REFUSED, f"refused: the arm follows a stream of {Leader(int(s['leader'])).command}"

    def _refusal(self) -> Told | None:
        """Why the arm does not follow streams now; None if it follows them."""
        s = self._slave.state
        state = State(int(s["state"]))
        if state is not State.ENABLED:
            return Answer.REFUSED, f"refused in {state.name}, followed in ENABLED"
        if s["is_busy"]:
            return Answer.REFUSED, "refused: it is on the way to a goal; wait, or hold"
        return None if s["is_homed"] else (Answer.REFUSED, "refused: home first")

    def _unfit(self, joints: Array) -> Told | None:
        """Why these joints cannot be a goal; None if they can."""
        robot = self._slave.robot
        wanted = self._joints(joints)
        if not np.isfinite(wanted).all():
            return Answer.REFUSED, "refused: it holds NaN or infinite numbers"
        is_out = (wanted < robot.lower - _SLACK) | (wanted > robot.upper + _SLACK)
        if is_out.any():
            i = int(np.flatnonzero(is_out)[0])
            name, limits = robot.joint_names[i], f"{robot.lower[i]:.4g} to {robot.upper[i]:.4g}"
            text = f"refused: {name} = {wanted[i]:.4g} is beyond its limits, {limits}"
            return Answer.REFUSED, text
        return None

    def _joints(self, values: object) -> Array:
        return _row(values, self._slave.robot.n)


def _row(values: object, count: int) -> Array:
    row = np.asarray(values, dtype=np.float64)
    if row.shape != (count,):
        raise ShapeError("command", (count,), row.shape)
    return row
