"""Trials: small motions of an arm, each commanded as an ordinary CRTK client does, and then reversed."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from teleop_core.base.errors import SessionError
from teleop_core.kernels.geometry import Array
from teleop_drill.conformance.crtk_topics import RowResult
from teleop_drill.nodes.conformance_arm import ArmClient, numbers_of

TURN = 0.01
"""Distance by which a joint is moved [rad or m]."""
WAY = 0.003
"""Distance by which the tip is moved [m]."""
_NEAR = 0.05  # share of the displacement that may be missing at the end
_MOVED = 0.3  # least share of the displacement that counts as a motion
_BEYOND = 0.3  # largest share of the displacement by which a move may leave the range between begin and goal
_TURNED = 0.02  # largest turn of a tip whose commanded orientation stays the same [rad]
_PATIENCE = 10.0  # longest duration of a move [s]
_NOTHING = 1.5  # time after which a command that has caused no motion is assumed to cause none [s]
_STATE = 3.0  # longest duration of a change of state [s]
_STILL = 1e-4  # motion of a joint at rest [rad or m]
Outcome = tuple[RowResult, str]
_OK: Outcome = (RowResult.OK, "")


class Trials:
    """Trials of one arm, which must be enabled, homed and at rest.

    Args:
        arm: The arm.
    """

    def __init__(self, arm: ArmClient) -> None:
        self.arm = arm
        self._start = np.empty(0)
        self._joint, self._axis = ((-1, 0.0), (-1, 0.0))  # joint or axis whose direction is known to be free, and the
        # sign
        self._first: set[int] = set()  # joints that are moved first, because two topics name them in another order
        self._turned = 0.0  # largest turn of the tip in a trial [rad]

    def unfit(self) -> str:
        """Reason why no trial is possible; empty if trials are possible."""
        state = self.arm.newest("operating_state", 3.0)
        if state is None:
            return "no operating_state: it is unknown whether the arm may be moved"
        if state.state != "ENABLED" or not state.is_homed:
            homed = "homed" if state.is_homed else "not homed"
            return f"the arm is {state.state}, {homed}: enable and home it first"
        if state.is_busy:
            return "the arm is busy: wait until its motion has ended"
        if self.arm.newest("setpoint_js") is None and self.arm.newest("measured_js") is None:
            return "neither setpoint_js nor measured_js: the arm's position is unknown"
        self._start = self.joints()
        names = [list(one.name) for one in map(self.arm.newest, ("setpoint_js", "measured_js")) if one is not None]
        self._first = {i for i, pair in enumerate(zip(names[0], names[-1], strict=False)) if len({*pair}) > 1}
        return ""

    # -- where it is -----------------------------------------------------------------------------

    def joints(self) -> Array:
        """Joint positions of the arm: the setpoint, or the measurement if there is no setpoint."""
        name = "setpoint_js" if self.arm.publishers("setpoint_js") else "measured_js"
        return self._fresh(name)["position"]

    def place(self) -> tuple[Array, Array]:
        """Position and quaternion of the arm's tip."""
        name = "setpoint_cp" if self.arm.publishers("setpoint_cp") else "measured_cp"
        found = self._fresh(name)
        return found["position"], found["quaternion"]

    def _fresh(self, name: str) -> dict[str, Array]:
        tap = self.arm.tap(name)
        self.arm.wait(lambda: tap.read() > 0, 0.5)
        if tap.newest is None and self.arm.newest(name) is None:
            raise SessionError(f"{self.arm.path(name)} stopped during the test: has the arm been switched off?")
        return numbers_of(tap.newest)

    def go_back(self) -> None:
        """Move the arm smoothly back to its joints at the start."""
        if self.is_back() or not self.arm.readers("move_jp"):
            return
        self.arm.send("move_jp", self.arm.message("move_jp", position=self._start.tolist()))
        self.arm.wait(self.is_back, _PATIENCE)

    def is_back(self) -> bool:
        """Whether the joints of the arm are where they were at the start."""
        return float(np.abs(self.joints() - self._start).max()) < _STILL

    # -- commands --------------------------------------------------------------------------------

    def state_command(self) -> Outcome:
        """Pause, refuse to move, resume without a motion; unknown commands must change nothing."""
        arm = self.arm
        self._say("no such command")
        arm.pause(0.3)
        if self._state() != "ENABLED":
            return RowResult.FAILED, "a text that is no command changed the state"
        if not self._reaches("pause", "PAUSED"):
            return RowResult.FAILED, f"pause: {self._state()} in place of PAUSED after {_STATE:g} s"
        before = self.joints()
        if arm.readers("move_jp"):
            goal = before.copy()
            goal[0] += TURN
            arm.send("move_jp", arm.message("move_jp", position=goal.tolist()))
            arm.pause(0.7)
        moved = float(np.abs(self.joints() - before).max())
        if not self._reaches("resume", "ENABLED"):
            return RowResult.FAILED, f"resume: {self._state()} in place of ENABLED"
        if moved > _STILL:
            return RowResult.FAILED, f"moved by {moved:.3g} while PAUSED"
        arm.pause(0.3)
        moved = float(np.abs(self.joints() - before).max())
        if moved > _STILL:
            return RowResult.FAILED, f"moved by {moved:.3g} on resume, without a command"
        return _OK

    def _say(self, word: str) -> None:
        self.arm.send("state_command", self.arm.message("state_command", string=word))

    def _state(self) -> str:
        self.arm.tap("operating_state").read()
        return str(self.arm.newest("operating_state").state)

    def _reaches(self, command: str, state: str) -> bool:
        self._say(command)
        return self.arm.wait(lambda: self._state() == state, _STATE)

    def move_joints(self, name: str, *, is_relative: bool) -> Outcome:
        """Move a joint there and back; the arm must report busy during the motion only."""
        for joint, sign in self._joints():
            begin = self.joints()
            step = np.zeros(len(begin))
            step[joint] = sign * TURN
            outcome = self._move(name, begin, begin + step, step if is_relative else begin + step)
            if outcome is not None:
                self._joint = joint, sign
                return outcome
        return RowResult.FAILED, "no joint moves in either direction"

    def _move(self, name: str, begin: Array, goal: Array, sent: Array) -> Outcome | None:
        """Result of a move of joints; None if nothing moved."""
        message = self.arm.message(name, position=sent.tolist())
        return self._watch_move(name, message, self.joints, begin, goal)

    def move_tip(self, name: str) -> Outcome:
        """Move the tip by a few millimetres; the arm must report busy during the motion only."""
        for axis, sign in self._candidates(self._axis, 3):
            p, q = self.place()
            goal = p.copy()
            goal[axis] += sign * WAY
            message, self._turned = _filled(self.arm.message(name), goal, q), 0.0
            outcome = self._watch_move(name, message, partial(self._position, q), p, goal)
            if outcome is not None:
                self._axis = axis, sign
                return self._unturned(outcome)
        return RowResult.FAILED, "the tip moves along no axis in either direction"

    def _position(self, orientation: Array) -> Array:
        """Position of the tip; its turn away from an orientation (4,) is noted."""
        position, now = self.place()
        self._turned = max(self._turned, 2.0 * math.acos(min(1.0, abs(float(orientation @ now)))))
        return position

    def _unturned(self, outcome: Outcome) -> Outcome:
        """The outcome of a trial in which the tip must not turn."""
        if outcome[0] is RowResult.OK and self._turned > _TURNED:
            return RowResult.FAILED, f"the tip turned by {self._turned:.2g} rad, but its orientation was to stay"
        return outcome

    def _watch_move(
        self, name: str, message: Any, where: Callable[[], Array], begin: Array, goal: Array
    ) -> Outcome | None:
        """Result of a move from begin to goal, both (n,); None if nothing moved."""
        tap, busy, beyond = self.arm.tap("operating_state"), [False], [0.0]
        way, lower, upper = float(np.abs(goal - begin).max()), np.minimum(begin, goal), np.maximum(begin, goal)
        tap.read()

        def off() -> float:
            place = where()
            beyond[0] = max(beyond[0], float(np.abs(place - np.clip(place, lower, upper)).max()))
            return float(np.abs(place - goal).max())

        def watch(state: Any) -> None:
            busy[0] = busy[0] or state.is_busy

        self.arm.publisher_of(name)
        self.arm.send(name, message)
        if not self.arm.wait(lambda: off() < way * (1.0 - _MOVED), _NOTHING):
            return None
        if not self.arm.wait(lambda: off() < way * _NEAR, _PATIENCE):
            return RowResult.FAILED, f"{off():.2g} short of its goal after {_PATIENCE:g} s"
        self.arm.wait(lambda: tap.read(watch) > 0 and not tap.newest.is_busy and busy[0], 2.0)
        if not busy[0]:
            return RowResult.FAILED, "is_busy never became true: clients that wait for the move wait without end"
        if tap.newest.is_busy:
            return RowResult.FAILED, "still busy at its goal"
        text = f"left the range between begin and goal, {way:.2g}, by {beyond[0]:.2g}"
        return (RowResult.FAILED, text) if beyond[0] > _BEYOND * way else _OK

    def _joints(self) -> list[tuple[int, float]]:
        """Joints to try, each with a sign; those of :attr:`_first` first."""
        return sorted(self._candidates(self._joint, len(self._start)), key=lambda one: one[0] not in self._first)

    def _candidates(self, known: tuple[int, float], count: int) -> list[tuple[int, float]]:
        """Directions to try: the direction that is known to be free, or all directions if none is known."""
        return [known] if known[0] >= 0 else list(product(range(count), (1.0, -1.0)))

    def stream_joints(self, name: str, rate: float, *, is_relative: bool = False) -> Outcome:
        """Stream a joint there and back again in two seconds."""
        for joint, sign in self._joints():
            begin = self.joints()

            def sent(share: float, last: float, p: Array = begin, i: int = joint, s: float = sign) -> Any:
                base = 0.0 * p if is_relative else p.copy()
                base[i] += s * TURN * (share - last if is_relative else share)
                return self.arm.message(name, position=base.tolist())

            where = partial(self._along_joint, begin, joint, sign)
            outcome = self._stream(name, rate, sent, where)
            if outcome is not None:
                self._joint = joint, sign
                return outcome
        return RowResult.FAILED, "no joint follows in either direction"

    def _along_joint(self, begin: Array, joint: int, sign: float) -> float:
        return float(sign * (self.joints() - begin)[joint] / TURN)

    def stream_tip(self, name: str, rate: float) -> Outcome:
        """Stream the tip there and back again in two seconds."""
        for axis, sign in self._candidates(self._axis, 3):
            p, q = self.place()

            def sent(share: float, _: float, p: Array = p, q: Array = q, i: int = axis, s: float = sign) -> Any:
                goal = p.copy()
                goal[i] += s * WAY * share
                return _filled(self.arm.message(name), goal, q)

            self._turned = 0.0
            outcome = self._stream(name, rate, sent, partial(self._along_axis, (p, q), axis, sign))
            if outcome is not None:
                self._axis = axis, sign
                return self._unturned(outcome)
        return RowResult.FAILED, "the tip follows along no axis in either direction"

    def _along_axis(self, begin: tuple[Array, Array], axis: int, sign: float) -> float:
        return float(sign * (self._position(begin[1]) - begin[0])[axis] / WAY)

    def _stream(
        self, name: str, rate: float, sent: Callable[[float, float], Any], where: Callable[[], float]
    ) -> Outcome | None:
        """Result of streamed commands that move to the full displacement and back."""
        self.arm.publisher_of(name)
        count, last, farthest = round(2.0 * rate), 0.0, 0.0
        for i in range(count + 1):
            share = 0.5 * (1.0 - math.cos(2.0 * math.pi * i / count))
            self.arm.send(name, sent(share, last))
            last = share
            self.arm.pause(1.0 / rate)
            farthest = max(farthest, where())
            if i == count // 2 and farthest < 0.1:
                return None
        self.arm.wait(lambda: abs(where()) < _NEAR, 1.0)
        if farthest < 1.0 - _MOVED:
            return RowResult.FAILED, f"followed {farthest:.0%} of the distance"
        rest = abs(where())
        return (RowResult.FAILED, f"{rest:.0%} of the way off in the end") if rest > _NEAR else _OK

    def run_joints(self, name: str) -> Outcome:
        """Command a speed of a joint, then send nothing; the joint must come to rest by itself."""
        for joint, sign in self._joints():
            begin, speed = self.joints(), np.zeros(len(self._start))
            speed[joint] = sign * 2.0 * TURN
            message = self.arm.message(name, velocity=speed.tolist())
            where = partial(self._along_joint, begin, joint, sign)
            outcome = self._run(name, message, self.arm.message(name), where)
            if outcome is not None:
                return outcome
        return RowResult.FAILED, "no joint reacts to a speed in either direction"

    def run_tip(self, name: str) -> Outcome:
        """Command a speed of the tip, then send nothing; the tip must come to rest by itself."""
        for axis, sign in self._candidates(self._axis, 3):
            begin, message = self.place(), self.arm.message(name)
            setattr(message.twist.linear, "xyz"[axis], sign * 2.0 * WAY)
            where = partial(self._along_axis, begin, axis, sign)
            outcome = self._run(name, message, self.arm.message(name), where)
            if outcome is not None:
                return outcome
        return RowResult.FAILED, "the tip reacts to a speed along no axis in either direction"

    def _run(self, name: str, message: Any, halt: Any, where: Callable[[], float]) -> Outcome | None:
        """Result of a speed of twice the displacement per second, commanded for half a second."""
        self.arm.publisher_of(name)
        for _ in range(25):
            self.arm.send(name, message)
            self.arm.pause(0.02)
        went = where()
        if went < 0.1:
            return None
        self.arm.pause(1.0)
        before = self.joints()
        self.arm.pause(0.3)
        drift = float(np.abs(self.joints() - before).max())
        if hasattr(halt, "velocity"):
            halt.velocity = [0.0] * len(self._start)
        self.arm.send(name, halt)
        if drift > _STILL:
            return RowResult.NOTED, "still moves a second after the last message: the arm has no watchdog"
        return _OK if 0.3 < went < 3.0 else (RowResult.FAILED, f"moved {went:.0%} of the commanded distance")

    def hold(self) -> Outcome:
        """Command hold; the arm must not move and must stay enabled."""
        before = self.joints()
        self.arm.publisher_of("hold")
        self.arm.send("hold", self.arm.message("hold"))
        self.arm.pause(0.5)
        moved = float(np.abs(self.joints() - before).max())
        if moved > _STILL:
            return RowResult.FAILED, f"moved by {moved:.3g}"
        is_enabled = self._state() == "ENABLED"
        return _OK if is_enabled else (RowResult.FAILED, f"{self._state()} afterwards")


def _filled(message: Any, p: Array, q: Array) -> Any:
    """Pose message with a position and a quaternion w, x, y, z."""
    target = message.pose
    target.position.x, target.position.y, target.position.z = p.tolist()
    names = ("w", "x", "y", "z")
    for name, number in zip(names, q.tolist(), strict=True):
        setattr(target.orientation, name, number)
    return message


TRIALS: Mapping[str, Callable[[Trials], Outcome]] = {
    "state_command": Trials.state_command,
    "move_jp": lambda t: t.move_joints("move_jp", is_relative=False),
    "move_jr": lambda t: t.move_joints("move_jr", is_relative=True),
    "move_cp": lambda t: t.move_tip("move_cp"),
    "interpolate_jp": lambda t: t.stream_joints("interpolate_jp", 20.0),
    "interpolate_cp": lambda t: t.stream_tip("interpolate_cp", 20.0),
    "servo_jp": lambda t: t.stream_joints("servo_jp", 100.0),
    "servo_jr": lambda t: t.stream_joints("servo_jr", 100.0, is_relative=True),
    "servo_jv": lambda t: t.run_joints("servo_jv"),
    "servo_cp": lambda t: t.stream_tip("servo_cp", 100.0),
    "servo_cv": lambda t: t.run_tip("servo_cv"),
    "hold": Trials.hold,
}
"""Trial of each command."""
