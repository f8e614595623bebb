"""Drill: breaks a running session in one way after the other, and measures what the arm does."""

import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from teleop_core import api
from teleop_core.drill import hand, inside, measure
from teleop_core.drill.exercise import Cure, Exercise, Master, Motion
from teleop_core.drill.outcome import Outcome
from teleop_core.drill.recordings import check_recording
from teleop_core.errors import SessionError
from teleop_core.geometry import Array
from teleop_core.nodes.children import environment, free_domain
from teleop_core.nodes.drill_rig import LiveRig
from teleop_core.operation import Fault, State
from teleop_core.own_parts import VARIABLE, load_own_parts
from teleop_core.robots.robot import Robot
from teleop_core.session.configuration import Configuration
from teleop_core.signals import DT
from teleop_core.slave.slave_sim import SlaveSim
from teleop_core.topics import (
    SLAVE_MEASURED_CP,
    SLAVE_OPERATION,
    SLAVE_SETPOINT_CP,
    SLAVE_SETPOINT_JS,
    TELEOP_STATE,
)

_BEFORE = 0.2  # motion that is seen before a fault [s]
_PATIENCE = 1.0  # for an arm that goes on by itself [s]
_LONGEST = 60.0  # until an arm follows again, whatever it takes [s]
_FOLLOWS = 90.0  # until it follows after the start [s]
_CIRCLE = (
    "operator.kind=circle", f"operator.size=[{2 * hand.RADIUS}, 0.0, {2 * hand.RADIUS}]",
    f"operator.period={hand.ROUND}", "operator.approach_time=1.0", "haptic_master.patience=0.0",
    "operator.rotation=0.0",
)  # fmt: skip
_STEADY = 4  # looks, a tenth of a second apart, at an arm that follows
_STRENGTH = (Cure.NOTHING, Cure.RESUME, Cure.RESET, Cure.RESTART)
Say = Callable[[str], None]


def drill(
    exercises: Sequence[Exercise],
    folder: Path,
    say: Say,
    *,
    is_composed: bool = False,
    files: Sequence[Path] = (),
    texts: Sequence[str] = (),
) -> list[Outcome]:
    """Do exercises in sessions of their own, on a ROS domain of their own.

    Args:
        exercises: What is done, as of :func:`teleop_core.drill.chosen`.
        folder: Where recordings go.
        say: Told a line about each.
        is_composed: Whether all nodes share one process.
        files: Parameter files over the scenario ``free_motion``.
        texts: Parameters ``key=value`` over all files.

    Raises:
        TeleopError: A parameter is wrong, or a session cannot be started.
    """
    sys.setswitchinterval(2e-4)  # the drill's own hand must not wait 5 ms for its turn
    outcomes: list[Outcome] = []
    for master in Master:
        own = [one for one in exercises if one.master is master]
        if own:
            place = folder / master.name.lower()
            place.mkdir(parents=True)
            made = _configuration(master, files, texts)
            part = _Drill(master, made, place, say, is_composed=is_composed)
            outcomes += part.run(own)
            if part.is_over:
                break
    order = [one.name for one in exercises]
    return sorted(outcomes, key=lambda outcome: order.index(outcome.exercise.name))


@dataclass(frozen=True)
class _Limits:
    """What the slave's drives can do."""

    speed: Array
    braking: Array


class _Drill:
    """Exercises with one master."""

    def __init__(
        self, master: Master, configuration: Configuration, folder: Path, say: Say, *,
        is_composed: bool,
    ) -> None:  # fmt: skip
        self._master, self._folder, self._say = master, folder, say
        self._is_composed, self._configuration = is_composed, configuration
        slave = SlaveSim(self._configuration.group("slave_sim"))
        self._robot: Robot = slave.robot
        self._limits = _Limits(
            np.array(slave.parameters["speed_limit"]), np.array(slave.parameters["braking"])
        )
        self._rig: LiveRig | None = None
        self._sessions = 0
        self._open: dict[Path, list[Outcome]] = {}
        self._killed: dict[Path, int] = {}
        self.is_over = False
        """Whether it was stopped before its end."""

    def run(self, exercises: Sequence[Exercise]) -> list[Outcome]:
        """Do them, and look at the recordings when all is over."""
        outcomes: list[Outcome] = []
        try:
            for exercise in exercises:
                rig = self._prepared()
                outcome = self._repeated(exercise, rig)
                outcomes.append(outcome)
                if math.isnan(outcome.recovered):
                    outcome.note = rig.complaints()
                    self._close()
                self._say(_line(outcome))
        except (KeyboardInterrupt, SessionError) as error:
            if not outcomes:
                raise
            self._say(f"stopped: {error or 'interrupted'}; what was measured until now:")
            self.is_over = True
        finally:
            self._close()
        for path, recorded in self._open.items():
            self._judge(path, recorded)
        return outcomes

    def _judge(self, path: Path, recorded: list[Outcome]) -> None:
        """Say of each fault during a recording what it did to it."""
        verdict = check_recording(path, self._killed.get(path))
        for outcome in recorded:
            outcome.recording, outcome.is_recorded = verdict.text, verdict.is_good
            if verdict.is_saved and not outcome.exercise.cuts_recording:
                outcome.recording, outcome.is_recorded = "intact", True

    # -- sessions --------------------------------------------------------------------------------

    def _prepared(self) -> LiveRig:
        """As :meth:`_ready`; a session that cannot go on is given up once."""
        if self._rig is None:
            return self._ready()
        try:
            return self._ready()
        except SessionError as error:
            self._say(f"gives the session up: {error}")
            self._close()
            return self._ready()

    def _ready(self) -> LiveRig:
        """A session whose slave follows the hand; a new one if the last did not survive."""
        if self._rig is None:
            self._sessions += 1
            folder = self._folder / f"session_{self._sessions}"
            folder.mkdir()
            self._rig = LiveRig(
                self._configuration, self._robot, folder, _environment(self._master),
                is_composed=self._is_composed, master=self._master,
            )  # fmt: skip
            way = "one process" if self._is_composed else "a process for each node"
            self._say(f"starts a session: {way}, the hand is that of {_who(self._master)}")
            self._rig.session.start()
        deadline = time.monotonic() + _FOLLOWS
        steady = 0
        while steady < _STEADY:
            if self._rig.is_following():
                steady += 1
            else:
                steady = 0
                self._help(self._rig)  # a busy machine may have paused it already
            self._rig.wait(0.1)
            if time.monotonic() > deadline:
                raise SessionError(f"the slave does not follow: {self._rig.complaints()}")
        return self._rig

    def _close(self) -> None:
        if self._rig is not None:
            rig, self._rig = self._rig, None
            rig.close()

    # -- one exercise ----------------------------------------------------------------------------

    def _repeated(self, exercise: Exercise, rig: LiveRig) -> Outcome:
        """The worst of all repetitions; of times that of a stop, the median as well."""
        found = [self._once(exercise, rig)]
        while len(found) < exercise.repeats and not math.isnan(found[-1].recovered):
            try:
                self._ready()
            except SessionError:
                found[-1].recovered = math.nan
                break
            found.append(self._once(exercise, rig))
        failed = [one for one in found if one.failures()]
        worst = failed[0] if failed else max(found, key=lambda one: one.travel)
        for name in ("stop_s", "rest_s"):
            times = [one.extra[name] for one in found if not math.isnan(one.extra[name])]
            if times:
                worst.extra |= {f"{name}_median": float(np.median(times)), name: max(times)}
        worst.extra["repeats"] = len(found)
        worst.ratio = max(one.ratio for one in found)
        return worst

    def _once(self, exercise: Exercise, rig: LiveRig) -> Outcome:
        rig.wait(_BEFORE)
        rig.tap.clear()
        outcome = Outcome(exercise=exercise, load=os.getloadavg()[0] / (os.cpu_count() or 1))
        self._open.setdefault(rig.session.recordings[-1], []).append(outcome)
        before = rig.operation()
        joints = rig.setpoint()
        rig.mark()
        rig.wait(0.0)
        exercise.inject(rig)
        rig.wait(exercise.watch)
        end_ns = time.time_ns()
        self._note_state(outcome, rig, before)
        outcome.note, begin_ns = rig.said, rig.begin_ns
        if exercise.cuts_recording:
            self._killed[rig.session.recordings[-1]] = begin_ns
        exercise.undo(rig)
        self._recover(outcome, rig)
        self._note_motion(outcome, rig, joints, begin_ns, end_ns)  # which takes a while
        return outcome

    def _note_state(self, outcome: Outcome, rig: LiveRig, before: dict[str, float]) -> None:
        """State that followed, and who told first."""
        begin_ns = rig.begin_ns
        told: list[tuple[int, str]] = []
        for sent_ns, report in rig.tap.reports(SLAVE_OPERATION):
            if sent_ns >= begin_ns and _differs(report, before):
                told.append((sent_ns, "slave/operation"))
                if report["fault"] and outcome.fault is Fault.NONE:
                    outcome.fault = Fault(int(report["fault"]))
        for sent_ns, report in rig.tap.reports(TELEOP_STATE):
            if sent_ns >= begin_ns and not report["is_following"]:
                told.append((sent_ns, "teleop/state"))
        told += [(ns, f"diagnostics of {n}") for n, ns in rig.warned.items() if ns >= begin_ns]
        if told:
            first_ns, outcome.told_by = min(told)
            outcome.detected = 1e-9 * (first_ns - begin_ns)
        if rig.session.is_running("slave_sim"):
            outcome.state = State(int(rig.operation()["state"]))
        rest = rig.operation().get("rest_time", 0.0)
        outcome.extra["rest_s"] = rest if outcome.state is not State.ENABLED else math.nan

    def _note_motion(
        self, outcome: Outcome, rig: LiveRig, joints: Array, begin_ns: int, end_ns: int
    ) -> None:
        setpoints = rig.tap.trace(SLAVE_SETPOINT_JS)
        wanted, found = rig.tap.trace(SLAVE_SETPOINT_CP), rig.tap.trace(SLAVE_MEASURED_CP)
        outcome.ratio = measure.step_ratio(setpoints, self._limits.speed, DT)
        outcome.travel = measure.travel(found, begin_ns, end_ns)
        stopped = setpoints.within(0, end_ns)
        outcome.extra["stop_s"] = measure.stop_delay(stopped, begin_ns)
        outcome.extra["tip_speed"] = measure.tip_speed(found.within(begin_ns, end_ns))
        speed = min(measure.speed_before(wanted, begin_ns), 1.5 * hand.SPEED)
        jacobian = self._robot.jacobian(joints)
        bound = measure.lag(wanted, found, begin_ns) + measure.RESOLUTION
        bound += measure.braking_way(setpoints, begin_ns, jacobian, self._limits.braking)
        if outcome.exercise.motion is Motion.RESTS:
            bound += speed * outcome.exercise.allowed
        else:  # the hand asks for no more than its circle, and may be aligned with it anew once
            bound += min(speed * 1e-9 * (end_ns - begin_ns), 4.0 * hand.RADIUS)
        outcome.bound = bound

    # -- recovery --------------------------------------------------------------------------------

    def _recover(self, outcome: Outcome, rig: LiveRig) -> None:
        """Wait until the arm follows again; help it more and more."""
        begin, used = time.monotonic(), Cure.NOTHING
        while (elapsed := time.monotonic() - begin) < _LONGEST:
            if rig.is_following():
                outcome.recovered, outcome.cure = elapsed, used
                break
            if elapsed > _PATIENCE or rig.operation().get("state") != State.ENABLED:
                used = max(used, self._help(rig), key=_STRENGTH.index)
            rig.wait(0.05)
        if rig.session.dead():
            rig.session.start()

    @staticmethod
    def _help(rig: LiveRig) -> Cure:
        """Do what the arm's state asks for."""
        if rig.session.dead():
            rig.session.start()
            return Cure.RESTART
        operation = rig.operation()
        state = operation.get("state")
        if state == State.PAUSED:
            rig.command("resume")
            return Cure.RESUME
        if state == State.FAULT:
            rig.command("reset")
        if state in {State.FAULT, State.DISABLED}:
            rig.command("enable")
            return Cure.RESET
        if state == State.ENABLED and not operation["is_homed"] and not operation["is_busy"]:
            rig.command("home")
            return Cure.RESET
        return Cure.NOTHING


def _configuration(master: Master, files: Sequence[Path], texts: Sequence[str]) -> Configuration:
    """Configuration of a session: the hand goes round at constant speed."""
    own: tuple[str, ...] = _CIRCLE
    if master is Master.DRILL:
        load_own_parts([Path(inside.__file__)])
        own = (*own, f"teleop.stages=[{inside.STAGE_NAME}]")
    return api.configuration("free_motion", files=files, texts=(*own, *texts))


def _environment(master: Master) -> dict[str, str]:
    env = environment() | {"ROS_DOMAIN_ID": free_domain()}
    if master is Master.DEVICE:
        env.pop(VARIABLE, None)
    return env


def _who(master: Master) -> str:
    return "the simulated device" if master is Master.DEVICE else "the drill"


def _differs(report: dict[str, float], before: dict[str, float]) -> bool:
    return any(report[name] != before.get(name) for name in ("state", "fault"))


def _line(outcome: Outcome) -> str:
    failures = outcome.failures()
    mark = "✗" if failures else "✓"
    note = f" ({outcome.note})" if math.isnan(outcome.recovered) else ""
    return f"{mark} {outcome.exercise.name}: {'; '.join(failures) or outcome.state_text}{note}"
