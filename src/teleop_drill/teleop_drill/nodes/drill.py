"""Drill: injects one fault after the other into running sessions, and measures the reaction of the arm."""

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from teleop_core.base.errors import SessionError
from teleop_core.base.own_parts import load_own_parts
from teleop_core.middleware.real_time import is_priority_granted
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.session import api
from teleop_core.session.configuration import Configuration
from teleop_drill.drill import hand, inside
from teleop_drill.drill.exercise import Exercise, Master
from teleop_drill.drill.judging import judge
from teleop_drill.drill.numbers import WARNED, Numbers, Scheduling
from teleop_drill.drill.outcome import FaultOutcome
from teleop_drill.drill.recordings import Counted, Recorded, judge_recording
from teleop_drill.nodes.drill_evidence import help_on, note_state, recover, seen_of
from teleop_drill.nodes.drill_rig import LiveRig
from teleop_drill.nodes.drill_session import ARM, SIMULATOR, LiveSite
from teleop_drill.nodes.drill_site import SessionProcesses, Site

_PRIORITY = 30
_BEFORE = 0.2  # time of normal motion before a fault [s]
_FOLLOWS = 90.0  # longest time from the start until the arm follows [s]
_CIRCLE = (
    "operator.kind=circle",
    f"operator.size=[{2 * hand.RADIUS}, 0.0, {2 * hand.RADIUS}]",
    f"operator.period={hand.ROUND}",
    "operator.approach_time=1.0",
    "operator.patience=0.0",
    "operator.rotation=0.0",
)
_MEASURED = 2.0  # time in which the wake-up delay of this machine is measured [s]
_STOOD_STILL = 0.5  # share of the command timeout; if this computer stalls for longer, the result is invalid
_MORE = 2  # number of repetitions of an exercise whose result is not valid
_STEADY = 4  # number of checks in a row, a tenth of a second apart, that must find that the arm follows
Say = Callable[[str], None]


def drill(
    exercises: Sequence[Exercise],
    folder: Path,
    say: Say,
    *,
    is_composed: bool = False,
    files: Sequence[Path] = (),
    texts: Sequence[str] = (),
    drives: Sequence[str] = (),
    arm: Sequence[str] = (),
) -> list[FaultOutcome]:
    """Run exercises in separate sessions, on a separate ROS domain.

    Loops and the drill's own tap use SCHED_FIFO if the system allows it and ``texts`` set no priority. Without it,
    seven processes on two cores are late even without a fault.

    Args:
        exercises: Exercises to run, from :func:`teleop_drill.drill.chosen`.
        folder: Folder of the recordings.
        say: Called with one line about each exercise.
        is_composed: Whether all nodes share one process.
        files: Parameter files that override the scenario ``free_motion``.
        texts: Parameters ``key=value`` that override all files.
        drives: Command line of drives that replace the simulated drives. Exercises that break the simulator are then
            left out.
        arm: Command line of the process that the drives command, such as the controller of a real arm. This process is
            started before the drives, and the drill does not break it.

    Raises:
        TeleopError: A parameter is wrong, or a session cannot be started.
    """
    if is_priority_granted(_PRIORITY):
        texts = (f"real_time.priority={_PRIORITY}", *texts)
    sys.setswitchinterval(2e-4)  # the drill's own hand must not wait 5 ms for the interpreter
    foreign = {SIMULATOR: drives, ARM: arm}

    def site(master: Master, made: Configuration, place: Path, interrupt: Interrupt) -> Site:
        return LiveSite(made, place, master, interrupt, is_composed=is_composed, foreign=foreign)

    own = [one for one in exercises if not (drives and one.breaks_simulator)]
    return drill_at(site, own, folder, say, files, texts)


Sites = Callable[[Master, Configuration, Path, Interrupt], Site]
"""Function that makes the site of a session from the kind of the hand's operator, the configuration, the folder of
files, and the interrupt."""


def drill_at(
    site: Sites,
    exercises: Sequence[Exercise],
    folder: Path,
    say: Say,
    files: Sequence[Path] = (),
    texts: Sequence[str] = (),
) -> list[FaultOutcome]:
    """Run exercises like :func:`drill`, but in sessions of any site.

    Args:
        site: Function that makes the site of each session.
        exercises: Exercises to run.
        folder: Folder of the recordings.
        say: Called with one line about each exercise.
        files: Parameter files that override the scenario ``free_motion``.
        texts: Parameters ``key=value`` that override all files.
    """
    outcomes: list[FaultOutcome] = []
    for master in Master:
        own = [one for one in exercises if one.master is master]
        if own:
            place = folder / master.name.lower()
            place.mkdir(parents=True)
            part = _Drill(site, master, _configuration(master, files, texts), place, say)
            with part.interrupt.caught():
                outcomes += part.run(own)
            if part.is_over:
                break
    order = [one.name for one in exercises]
    return sorted(outcomes, key=lambda outcome: order.index(outcome.exercise.name))


class _Drill:
    """Exercises with one master."""

    def __init__(self, site: Sites, master: Master, configuration: Configuration, folder: Path, say: Say) -> None:
        self._site, self._master, self._folder, self._say = site, master, folder, say
        self._configuration = configuration
        self._numbers, self._scheduling = Numbers.of(configuration), Scheduling()
        self._rig: LiveRig | None = None
        self._sessions = 0
        self._open: dict[Path, list[tuple[int, FaultOutcome]]] = {}
        self._killed: dict[Path, int] = {}
        self._counted: dict[Path, Counted] = {}
        self._sessions_of: dict[Path, SessionProcesses] = {}
        self.interrupt = Interrupt()
        """Object that ends a wait of this drill with KeyboardInterrupt."""
        self.is_over = False
        """Whether the drill was stopped before its end."""

    def run(self, exercises: Sequence[Exercise]) -> list[FaultOutcome]:
        """Run the exercises, and check the recordings at the end."""
        outcomes: list[FaultOutcome] = []
        try:
            for exercise in exercises:
                rig = self._prepared()
                outcome = self._judged(exercise, rig)
                outcomes.append(outcome)
                if math.isnan(outcome.recovered):
                    outcome.note = rig.complaints()
                    self._close()
                self._say(_line(outcome))
        except (KeyboardInterrupt, SessionError) as error:
            if not outcomes:
                raise
            self._say(f"stopped: {str(error) or 'interrupted'}; results until now:")
            self.is_over = True
        finally:
            self._close()
        for path, recorded in self._open.items():
            judge_recording(
                Recorded(
                    path, recorded, self._counted[path], self._sessions_of[path].until_ns(path), self._killed.get(path)
                ),
                self._numbers.tick,
            )
        return outcomes

    # -- sessions --------------------------------------------------------------------------------

    def _prepared(self) -> LiveRig:
        """Return a ready session whose arm began at home; if this fails, one new session is tried.

        In each exercise the arm may stand still while the hand moves on, and so its circle moves away from home. There
        a joint limit cuts the circle, and the arm's way is no longer that of the hand.
        """
        if self._rig is None:
            return self._ready()
        try:
            if not self._rig.command("home"):
                raise SessionError("the arm does not home")
            return self._ready()
        except SessionError as error:
            self._say(f"gives the session up: {error}")
            self._close()
            return self._ready()

    def _ready(self) -> LiveRig:
        """Return a session whose slave follows the hand; a new session is started if the last one did not survive."""
        if self._rig is None:
            self._sessions += 1
            folder = self._folder / f"session_{self._sessions}"
            folder.mkdir()
            site = self._site(self._master, self._configuration, folder, self.interrupt)
            self._rig = LiveRig(site, self._configuration, self._numbers.robot)
            way = "one process" if site.is_composed else "a process for each node"
            self._say(f"starts a session: {way}, the hand is that of {_who(self._master)}")
            self._rig.session.start()
            self._await_following(self._rig)
            self._measure_scheduling(self._rig)
        self._await_following(self._rig)
        return self._rig

    def _measure_scheduling(self, rig: LiveRig) -> None:
        """Measure the wake-up delays of the drill's own thread while the session runs."""
        since_ns = rig.now_ns()
        rig.wait(_MEASURED)
        found = self._scheduling = rig.tap.scheduling(since_ns)
        late = f"{1e3 * found.usual:.2f} ms usually, {1e3 * found.worst:.1f} ms at worst"
        self._say(f"wake-ups on this machine are late by {late}; every time limit is extended by twice the worst")

    def _await_following(self, rig: LiveRig) -> None:
        """Wait until the slave follows, and send the commands that it needs; raises SessionError if it never does."""
        deadline = rig.now() + _FOLLOWS
        steady = 0
        while steady < _STEADY:
            if rig.is_following():
                steady += 1
            else:
                steady = 0
                rig.session.check()
                help_on(rig)  # a busy machine may already have paused the arm
            rig.wait(0.1)
            if rig.now() > deadline:
                raise SessionError(f"the slave does not follow: {rig.complaints()}")

    def _close(self) -> None:
        if self._rig is not None:
            rig, self._rig = self._rig, None
            rig.close()
            self._counted |= dict.fromkeys(rig.session.recordings, rig.tap.counted())
            self._sessions_of |= dict.fromkeys(rig.session.recordings, rig.session)

    # -- one exercise ----------------------------------------------------------------------------

    def _judged(self, exercise: Exercise, rig: LiveRig) -> FaultOutcome:
        """Outcome of an exercise, which is repeated once if it failed while the machine itself stood still."""
        outcome = self._repeated(exercise, rig)
        for _ in range(_MORE):
            late = outcome.extra["late_s"]
            is_fair = late < _STOOD_STILL * self._numbers.command_timeout
            if not outcome.failures() or is_fair or math.isnan(outcome.recovered):
                break
            self._say(f"{_line(outcome)}; but this machine stood still for {1e3 * late:.0f} ms: again")
            try:
                self._ready()
            except SessionError:
                break  # return the results so far
            outcome = self._repeated(exercise, rig)
        return outcome

    def _repeated(self, exercise: Exercise, rig: LiveRig) -> FaultOutcome:
        """Repeat an exercise until the first failure; returns the worst outcome with the medians of all repetitions."""
        found = [self._once(exercise, rig)]
        while len(found) < exercise.repeats and not found[-1].failures():
            try:
                self._ready()
            except SessionError:
                found[-1].recovered = math.nan
                break
            found.append(self._once(exercise, rig))
        worst = found[-1]
        if not worst.failures():
            worst = max(found, key=lambda one: one.measured("travel_m").value)
        for name in ("still_s", "rest_s"):
            worst.extra[f"{name}_median"] = float(np.median([m.measured(name).value for m in found]))
        worst.extra["repeats"] = len(found)
        return worst

    def _once(self, exercise: Exercise, rig: LiveRig) -> FaultOutcome:
        if exercise.warns:
            rig.await_calm(1.2 * WARNED)
        rig.wait(_BEFORE)
        rig.tap.clear()
        outcome = FaultOutcome(exercise=exercise, load=rig.site.load())
        self._open.setdefault(rig.session.recordings[-1], []).append((rig.now_ns(), outcome))
        before = rig.operation()
        rig.mark()
        rig.wait(0.0)
        exercise.inject(rig)
        rig.wait(exercise.watch)
        end_ns = rig.now_ns()
        note_state(outcome, rig, before)
        outcome.note, begin_ns = rig.said, rig.begin_ns
        if exercise.cuts_recording:
            self._killed[rig.session.recordings[-1]] = begin_ns
        exercise.undo(rig)
        recover(outcome, rig)
        while exercise.warns and not rig.warned and rig.now_ns() - begin_ns < 1.2e9 * WARNED:
            rig.wait(0.05)
        seen = seen_of(outcome, rig, (begin_ns, end_ns), self._scheduling)
        outcome.measures = {m.name: m for m in judge(exercise, seen, self._numbers)}
        outcome.extra["late_s"] = seen.scheduling.worst
        return outcome


def _configuration(master: Master, files: Sequence[Path], texts: Sequence[str]) -> Configuration:
    """Configuration of a session in which the hand moves on a circle at constant speed."""
    own: tuple[str, ...] = _CIRCLE
    if master is Master.DRILL:
        load_own_parts([Path(inside.__file__)])
        own = (*own, f"teleop.stages=[{inside.STAGE_NAME}]")
    return api.configuration("free_motion", files=files, texts=(*own, *texts))


def _who(master: Master) -> str:
    return "the simulated device" if master is Master.DEVICE else "the drill"


def _line(outcome: FaultOutcome) -> str:
    failures = outcome.failures()
    mark = "✗" if failures else "✓"
    note = f" ({outcome.note})" if math.isnan(outcome.recovered) else ""
    return f"{mark} {outcome.exercise.name}: {'; '.join(failures) or outcome.state_text}{note}"
