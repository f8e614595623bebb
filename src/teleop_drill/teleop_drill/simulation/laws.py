"""Laws: conditions that must be true under any faults, checked by an observer of the whole machine."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from teleop_core.bags.messages import layout
from teleop_core.bags.reader import Bag, recover
from teleop_core.base.errors import RecordingError
from teleop_core.graph.operation import State
from teleop_core.graph.topics import NO_COMMAND_NS, SLAVE_SETPOINT_JS
from teleop_core.kernels.fields import Cells
from teleop_core.middleware.platform import Taken
from teleop_core.slave.commands import CommandStatus
from teleop_core.slave.velocity import MotionSource
from teleop_drill.drill.numbers import Numbers
from teleop_drill.simulation import sometimes
from teleop_drill.simulation.changes import StateChanges
from teleop_drill.simulation.drilled_session import DrilledSession
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.owner import Owner, stamp_of
from teleop_drill.simulation.steps import StepReader

_LOOK_NS = 5_000_000
_BAD = ("error", "fatal")
_NO_DISK = re.compile("cannot be (written|finished)")
_SAFE = re.compile(r"the first [\d.]+ s \((\d+) of \d+ messages\)")
_SLACK = 1e-6
_CURVED = 1e-2
"""Largest share by which the tip's displacement in a tick may exceed the limit. The slave shortens joint steps, which
limits the displacement only approximately."""
_TELL = 0.3
"""Longest time until a new state is reported to the operator [s]; only time in which the slave's process runs counts.
"""
_OBEY = 0.1
"""Longest time until a pressed stop is in force [s]; only time in which the slave's process runs counts."""
_DOUBT = 0.7
"""Longest time until a stop is in force after the slave has discovered a button that was already pressed [s]: half a
second plus two checks."""
_FOUND_NS = 1_600_000_000
"""Time in which a recorder discovers all topics [ns]."""
_ON_THE_WAY_NS = 300_000_000
"""Time in which a sent message is recorded [ns]."""
_SOON = 0.06
"""Delay of a machine that is not busy [s]."""
_ENGAGING_NS = 200_000_000
"""Time in which an arm that begins to follow moves no faster than the hand [ns]."""
_REST = 0.25
"""Longest time until an arm without a new speed command is at rest, in addition to the command timeout and braking [s].
"""
_OLDEST_NS = 6_000_000_000
"""Age of a speed command that moves an arm no more [ns]: ``operation.oldest_command``, and a second."""
_KEPT_NS = 250_000_000
"""Longest time before its end from which a recorder that is killed loses messages [ns]."""
_OLD = 1.0
"""Largest age of a command that an enabled arm may follow [s]."""
_JOINING = 20
"""Number of setpoints by which a newly enabled slave moves its setpoint to the arm without a command."""
_AFTER_STEP_NS = 5_000_000_000
"""Time after a step of the clock in which stamps from before the step may arrive [ns]."""
_QUEUES = 2500
"""Largest number of messages that may wait in any queue; it is somewhat more than the recorder's longest queue."""
_SLOW_NS, _GIVEN_WAY_NS = 1_500_000, 4_500_000_000
"""A process whose turns take longer than the first must have given way after the second [ns]: two times of judgement,
and a turn of the machine."""
_FOLLOWING = int(MotionSource.FOLLOWING)
LAWS = (
    "speed", "tool speed", "motion", "told", "stop", "asked", "pause", "engage", "owner", "age", "way", "ends",
    "queues", "recorded", "recovery",
)  # fmt: skip
"""Names of all laws."""


@dataclass(frozen=True)
class Broken:
    """Breach of a law.

    Attributes:
        law: Name of the law.
        at: Time of the breach since the arm followed [s].
        text: Description of the breach.
    """

    law: str
    at: float
    text: str


def _saved(said: Sequence[str]) -> int | None:
    """Number of messages that a recorder reported as safe when its disk failed; None without such a report."""
    found = [_SAFE.search(text) for text in said]
    return next((int(one[1]) for one in reversed(found) if one), None)


class Laws:
    """Checks the laws in one session: at every setpoint, or two hundred times per second.

    Args:
        stage: The session.
        numbers: Numbers from the session's drives and parameters.

    Attributes:
        broken: First breach of each law.
        looks: Number of checks of each law.
        in_force: Kinds of the present faults.
        under: Number of checks of each law by present fault and state of the arm.
        lost_recorders: Recorders that ended because their disk failed.
    """

    def __init__(self, stage: DrilledSession, numbers: Numbers) -> None:
        self._stage, self._numbers = stage, numbers
        self._scheduler = stage.machine.scheduler
        self._form = layout(SLAVE_SETPOINT_JS, stage.robot.joint_names)
        self._owner = Owner(stage.bus, numbers.command_timeout)
        self.broken: dict[str, Broken] = {}
        self.looks: Counter[str] = Counter()
        self.in_force: list[str] = []
        self.under: Counter[tuple[str, str, str]] = Counter()
        self.lost_recorders: set[Process] = set()
        self.begin_ns = self._scheduler.now_ns
        self._steps = StepReader(self._form, stage.robot)
        self._steps_of: Process | None = None
        first = 4 + 8 * int(self._form.places[0])
        self._place, self._joints = slice(first, first + 8 * stage.robot.n), b""
        """Place of the joints in a message, and the joints of the newest setpoint."""
        self._status, self._has_moved = memoryview(b""), False
        self._braking = float(np.max(numbers.speed_limit / numbers.braking))
        self._slave: Any = None
        self._led: Any = None  # stage whose state the cells are
        self._cells: Any = None
        self._process: Process | None = None
        self._worked = 0.0
        """Time for which the slave's process has run [s]; time in which it was stopped does not count."""
        self._seen_state, self._since = -1, 0.0
        self._offset_ns = self._stepped_ns = self._old = 0
        self._moved_at, self._in_motion = 0.0, 0
        self._press: tuple[int, bool] | None = None
        """Newest press that is not yet in force: number of the button, and whether the press was sent to the slave."""
        self._obey_by, self._was_idle, self._was_driven = 0.0, False, False
        self._latest, self._late_until_ns = 0.0, 0
        """Longest present delay [s], and the time until which it holds after its cause has ended [ns]."""
        self._presses = 0
        self._drive_ns, self._driven_at, self._followed_ns, self._stamp_ns = 0, 0.0, 0, 0
        self._leader = b""
        self._engaged: tuple[int, list[float]] | None = None
        """When the arm began to follow [ns], and where the tip was then."""
        self._changes = StateChanges(stage, numbers, self._count, self._break)
        self._slow_ns: dict[Process, int] = {}  # time for which a process has had slow turns
        self._sent_ns: dict[bytes, list[int]] = {}  # times of sending, by publisher
        """Sending times of setpoints by the system's clock [ns], by publisher."""
        stage.bus.seen[f"/{SLAVE_SETPOINT_JS.name}"] = self._judge_setpoint
        self._scheduler.at(0, self._look)

    def _break(self, law: str, text: str) -> None:
        at = 1e-9 * (self._scheduler.now_ns - self.begin_ns)
        self.broken.setdefault(law, Broken(law, at, text))

    def _count(self, law: str, number: int = 1) -> None:
        self.looks[law] += number
        for kind in self.in_force:
            self.under[kind, self._stage.state, law] += number

    # -- at every setpoint -----------------------------------------------------------------------

    def _judge_setpoint(self, taken: Taken) -> None:
        """Judge at once what needs the present state; the speeds are judged later, several setpoints at a time."""
        self._sent_ns.setdefault(taken.sender, []).append(self._stage.platform.time_ns())
        slave, process = self._stage.session.node("slave"), self._stage.session.process_of("slave")
        data = taken.data
        if slave is None or process is not self._steps_of or len(data) < self._form.size:
            self._judge_speed()
            self._steps, self._steps_of, self._joints = StepReader(self._form, self._stage.robot), process, b""
        if slave is None or len(data) < self._form.size:
            return
        if self._steps.add(data):
            self._judge_speed()
        stamp_ns = stamp_of(taken)
        if slave.stage is not self._led:
            self._led = slave.stage
            self._cells = None if self._led is None else Cells(self._led.state)
            self._status = slave.row.number("command_status")
        self._judge_owner(process, stamp_ns)
        self._judge_engage(data)
        before, self._joints = self._joints, data[self._place]
        self._has_moved |= before != self._joints
        if before and self._status[0] == CommandStatus.FRESH:  # otherwise the slave may still brake
            self._judge_age(stamp_ns, before != self._joints)

    def _judge_owner(self, process: Process | None, stamp_ns: int) -> None:
        """Check that only one sender commands the arm at a time."""
        self._count("owner")
        cells = self._cells
        is_driven = cells is not None and not cells["is_busy"] and cells["motion"] != _FOLLOWING
        is_driven = is_driven and cells["driven_ns"] > 0  # an arm that is told to hold is not driven
        if wrong := self._owner.judge(process, stamp_ns, is_driven=is_driven):
            self._break("owner", wrong)
        age_ns = self._scheduler.now_ns - self._stage.driven_ns
        if is_driven and not self._was_driven and age_ns > _OLDEST_NS and self._stage.is_alone:
            self._break("age", f"follows a speed command, although the last one is {1e-9 * age_ns:.1f} s old")
        self._was_driven = is_driven
        self._stage.commanded_ns = self._owner.followed_ns

    def _judge_engage(self, data: bytes) -> None:
        """Check that an arm that begins to follow does not run to where the hand is, if nothing is late."""
        now_ns, before_ns, self._followed_ns = self._scheduler.now_ns, self._followed_ns, self._owner.followed_ns
        if self._followed_ns - before_ns > 1e9 * _OLD:
            is_new = self._worked - self._since < 1.5 * _OLD  # otherwise the hand may have led on behind a bad line
            is_hand = self._stage.is_alone and self._owner.leader not in self._stage.senders
            self._engaged = (now_ns, self._tip(data)) if is_new and is_hand and self._is_quiet() else None
        if self._engaged is None or now_ns - self._engaged[0] < _ENGAGING_NS:
            return
        self._count("engage")
        (since_ns, place), self._engaged = self._engaged, None
        way = math.dist(self._tip(data), place)
        if self._is_quiet() and way > 1.5e-9 * (now_ns - since_ns) * self._numbers.tip_speed:
            self._break("engage", f"the tip went {1e3 * way:.0f} mm as it began to follow, faster than the hand")

    def _tip(self, data: bytes) -> list[float]:
        """Place of the tip in a setpoint [m]; not a number for bytes that are none."""
        found = self._form.decode_one(data)
        if found is None:
            return [math.nan] * 3
        place: list[float] = self._stage.robot.fk(found[1][: self._stage.robot.n])[:3, 3].tolist()
        return place

    def _is_quiet(self) -> bool:
        return not self._stage.bus.lines and self._late() < _SOON

    def _judge_speed(self) -> None:
        """Check the speeds of the setpoints since the last call."""
        if (steps := self._steps.steps()) is None:
            return
        self._stage.setpoint = steps.setpoint
        self._count("tool speed", steps.number)
        if steps.tip > (most := self._numbers.tool_speed) * (1.0 + _CURVED):
            self._break("tool speed", f"the setpoint of the tip moved at {steps.tip:.3g} m/s, at most {most:.3g}")
        self._count("speed", steps.number)
        limit = self._numbers.speed_limit
        if not (steps.joints <= limit * (1.0 + _SLACK)).all():
            joint = int(np.argmax(steps.joints / limit))
            self._break(
                "speed",
                f"the setpoint of joint {joint + 1} moved at {steps.joints[joint]:.3g}, beyond its drive's "
                f"{limit[joint]:.3g}",
            )
        if steps.joints.max() > _SLACK:
            self._moved_at = self._worked

    def _judge_age(self, stamp_ns: int, moves: bool) -> None:
        """Check that the slave does not follow old commands, such as commands that waited in a queue."""
        offset_ns = self._stage.machine.clock.ahead_ns(self._scheduler.now_ns)
        if abs(offset_ns - self._offset_ns) > _LOOK_NS:
            self._offset_ns, self._stepped_ns = offset_ns, self._scheduler.now_ns
        if stamp_ns == NO_COMMAND_NS or not moves:
            self._old = 0
            return
        leader, before_ns = self._owner.leader, self._stamp_ns
        is_back = leader == self._leader and stamp_ns < before_ns
        self._leader, self._stamp_ns = leader, stamp_ns
        if self._scheduler.now_ns - self._stepped_ns < _AFTER_STEP_NS:
            return
        self._count("age")
        if is_back and self._stage.is_alone:
            older = 1e-6 * (before_ns - stamp_ns)
            self._break("age", f"follows a command that is {older:.0f} ms older than the one before")
        master: Any = self._stage.session.node("haptic_master")
        # A process continues to use the clock with which it was started for its stamps.
        epoch_ns = getattr(master, "epoch_ns", offset_ns)
        age = 1e-9 * (self._scheduler.now_ns + epoch_ns - stamp_ns)
        self._old = self._old + 1 if age > _OLD and age > _OLD + self._late() else 0
        if self._old > _JOINING:
            self._break("age", f"follows a command that is {age:.2f} s old")

    # -- now and then ----------------------------------------------------------------------------

    def _look(self) -> None:
        self._scheduler.at(self._scheduler.now_ns + _LOOK_NS, self._look)
        stage, late = self._stage, self._late()
        slave, process = stage.session.node("slave"), stage.session.process_of("slave")
        if process is not self._process:  # the reports of the former process do not describe this process
            self._process, stage.operation = process, {}
        if slave is not self._slave:
            self._slave, self._seen_state, self._press = slave, -1, None
            self._changes.begin()
            self._presses = len(stage.presses)
            for button in stage.held:  # this slave never received a message of the button
                self._press, self._obey_by = (button, False), math.inf
        works = slave is not None and slave.stage is not None and slave.is_at_work
        if works and process is not None and process.is_stopped:
            self._changes.stand(1e-9 * _LOOK_NS)
        elif works and process is not None:
            self._worked += 1e-9 * _LOOK_NS
            silence = 1e-9 * (self._scheduler.now_ns - self._owner.followed_ns)
            self._changes.judge(slave, self._worked, late, silence)
            self._judge_state(slave)
            self._judge_stop(slave, process)
        self._judge_ends()
        self._judge_queues()
        self._judge_way()

    def _judge_state(self, slave: Any) -> None:
        """Check that an arm that must not move is at rest, and that its state is reported in time."""
        self._stage.sometimes[f"a command is {CommandStatus(int(slave.row['command_status'])).name}"] += 1
        state = int(slave.stage.state["state"])
        if state != self._seen_state:
            self._seen_state, self._since = state, self._worked
        in_force = self._worked - self._since
        self._count("motion")
        if self._stage.driven_ns != self._drive_ns:
            self._drive_ns, self._driven_at = self._stage.driven_ns, self._worked
        undriven = self._worked - self._driven_at - self._numbers.command_timeout - self._braking - self._late()
        is_undriven = self._was_driven and undriven > _REST and self._stage.is_alone
        if self._has_moved and (is_undriven or (state != State.ENABLED and in_force > self._braking + 0.2)):
            self._has_moved = False
            self._judge_speed()
        moves = self._worked - self._moved_at < 0.5e-9 * _LOOK_NS  # since the last look
        is_moving = moves and state != State.ENABLED and in_force > self._braking + 0.3
        # A setpoint that goes to an arm whose position was unknown is no motion of the arm.
        self._in_motion = self._in_motion + 1 if is_moving and not slave.stage.state["must_join"] else 0
        if self._in_motion > 1:
            self._break("motion", f"moves {in_force:.2f} s after it became {State(state).name}")
        if state != State.ENABLED and slave.stage.state["is_busy"]:
            self._break("motion", f"has an unfinished move while it is {State(state).name}")
        if moves and is_undriven:
            self._break("motion", f"moves {self._worked - self._driven_at:.2f} s after the last speed command")
        self._count("told")
        told = self._stage.operation.get("state")
        if in_force > _TELL and told != state:
            was = "nothing" if told is None else State(int(told)).name
            self._break("told", f"is {State(state).name} for {in_force:.2f} s but has reported {was}")

    def _judge_stop(self, slave: Any, process: Process) -> None:
        """Check that a pressed stop is in force in time, and never lost.

        A press without a reader must be in force soon after the slave has discovered the button. If the button was
        released before the discovery, the press does not concern an arm that was disabled.
        """
        stage, now_ns, operation = self._stage, self._scheduler.now_ns, slave.stage.operation
        if len(stage.presses) > self._presses:
            self._presses, button = len(stage.presses), stage.presses[-1]
            times = stage.found(button, process)
            is_sent = times is not None and times[0] <= now_ns - _LOOK_NS
            self._press, self._was_idle = (button, is_sent), False
            self._obey_by = math.inf  # until the slave's reader has discovered the button, which delays the message
        if self._press is None:
            return
        self._count("stop")
        button, is_sent = self._press
        self._was_idle |= operation["state"] == State.DISABLED
        if math.isinf(self._obey_by) and (times := stage.found(button, process)) and times[1] <= now_ns:
            self._obey_by = self._worked + (_OBEY if is_sent else _DOUBT)
            self._changes.hold(button, self._obey_by)
        is_over = not is_sent and self._was_idle and button not in stage.held
        if is_over or operation["is_stopped"]:
            self._press = None
        elif self._worked > self._obey_by + self._late():
            self._press = None
            since = "it was pressed" if is_sent else "the slave found the button that was pressed before"
            self._break("stop", f"no stop is in force, although {since} long enough ago")

    def _late(self) -> float:
        """Delay that bad lines and busy processors of the machine may add [s], to what is still on the way too."""
        lines = self._stage.bus.lines.values()
        on_the_way = max((line.delay + 20.0 * line.jitter for line in lines), default=0.0)
        lost = 0.2 * any(line.loss for line in lines)
        slow_ns = max(process.slow_ns for process in self._stage.session.running.values())
        late = on_the_way + lost + 20e-9 * (self._scheduler.costs.crowd_ns + slow_ns) + 0.05
        if late >= self._latest or self._scheduler.now_ns > self._late_until_ns:
            self._latest, self._late_until_ns = late, self._scheduler.now_ns + round(1e9 * late)
        return self._latest

    def _judge_ends(self) -> None:
        """Check that no process ends without an order to end."""
        self._count("ends")
        for process in self._stage.session.running.values():
            if process.is_dead and process not in self._stage.killed:
                self._stage.killed.add(process)
                said = [one.text for one in self._stage.machine.log if one.level in _BAD]
                if process in self._stage.lost_disk and _NO_DISK.search("".join(said[-1:])):
                    self.lost_recorders.add(process)
                    self._stage.sometimes[sometimes.DISK_ENDS] += 1
                    continue  # the saved messages are checked at the end of the session
                self._break("ends", f"{process.name} has ended: {' '.join(said[-1:])[-300:]}")

    def _judge_way(self) -> None:
        """Check that a loop that cannot keep up gives way to other programs."""
        for process in self._stage.session.running.values():
            is_slow = process.slow_ns > _SLOW_NS and not (process.is_stopped or process.is_dead)
            slow_ns = self._slow_ns[process] = self._slow_ns.get(process, 0) + _LOOK_NS if is_slow else 0
            if slow_ns < _GIVEN_WAY_NS:
                continue
            self._count("way")
            keeps = any(strand.has_priority for strand in self._scheduler.strands(process))
            self._stage.sometimes[sometimes.GAVE_WAY] += not keeps
            if keeps:
                self._break("way", f"{process.name} keeps its priority, although its turns take several ticks")

    def _judge_queues(self) -> None:
        """Check that no queue grows without limit."""
        self._count("queues")
        for readers in self._stage.bus.readers.values():
            for reader in readers:
                if not reader.process.is_stopped and reader.waits(_QUEUES) > _QUEUES:
                    count = reader.waits(_QUEUES)
                    self._break("queues", f"{count} messages of {reader.topic} wait")
        for process in self._stage.session.running.values():
            count = max(map(len, process.due), default=0)
            if count > _QUEUES and not (process.is_stopped or process.is_dead):
                self._break("queues", f"{count} calls wait in {process.name}")

    # -- at the end ------------------------------------------------------------------------------

    def finish(self) -> None:
        """Judge the last setpoints."""
        self._judge_speed()

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Take a recording that cannot be read for a breach of the law ``recorded``."""
        try:
            yield
        except RecordingError as error:
            self._break("recorded", str(error))

    def judge_recording(self, path: Path, told: Mapping[str, str]) -> None:
        """Check that all sent messages (all saved ones if the disk failed) are recorded or counted as lost.

        Args:
            path: A recording whose recorder was not killed, while no clock was stepped.
            told: Final report of the recorder; empty if the recorder ended before it could report.
        """
        self._count("recorded")
        said = [one.text for one in self._stage.machine.log if str(path) in one.text]
        saved = _saved(said) if self._stage.lost_disk else None
        if saved == 0:
            return
        if saved is not None:
            path, count = recover(path)
            if count < saved:  # a last chunk that lacks only its index can also be read
                self._break("recorded", f"{saved} messages were said to be safe, {count} are")
        kept_ns = Bag(path).read(SLAVE_SETPOINT_JS).log_ns
        parts = [np.array(times) for times in self._sent_ns.values()]
        if self._stage.kills:
            if told.get("cut_feeds") == "0":
                self._break("recorded", "a process was killed, and the recorder does not say so")
            for k, part in enumerate(parts[:-1]):  # messages in its queue are lost with the process
                last_ns = np.max(kept_ns[kept_ns <= part[-1]], initial=0)
                parts[k] = part[part <= last_ns]
        sent_ns = np.concatenate(parts)
        begin_ns, end_ns = int(kept_ns[0]) + _FOUND_NS, int(sent_ns[-1]) - _ON_THE_WAY_NS
        if saved is not None:
            end_ns = int(kept_ns[-1]) - _ON_THE_WAY_NS
        kept, sent = (int(np.sum((begin_ns < times) & (times < end_ns))) for times in (kept_ns, sent_ns))
        lost = int(told.get(f"lost.{SLAVE_SETPOINT_JS.name}", 0))
        if sent - kept > lost + 1:
            self._break("recorded", f"{sent} setpoints were sent, {kept} recorded, {lost} counted")

    def judge_killed(self, path: Path, killed_ns: int) -> None:
        """Check that a killed recorder, whose disk and processor were sound, lost only the messages before its end.

        Args:
            path: Its recording.
            killed_ns: Time at which it was killed [ns].
        """
        self._count("recorded")
        until_ns = killed_ns + self._stage.machine.clock.ahead_ns(killed_ns) - _KEPT_NS
        kept_ns = Bag(recover(path)[0]).read(SLAVE_SETPOINT_JS).log_ns
        sent_ns = np.concatenate([np.array(times) for times in self._sent_ns.values()])
        lost = int(np.sum((sent_ns > kept_ns[-1]) & (sent_ns < until_ns)))
        if lost > 1:
            self._break("recorded", f"a killed recorder lost {lost} setpoints that were sent long before its end")

    def judge_recovery(self, seconds: float | None, bound: float) -> None:
        """Check that after the recovery the arm follows again, or reports the reason why it does not.

        Args:
            seconds: Time after which the arm followed [s]; None if it did not follow.
            bound: Time within which the arm must follow [s].
        """
        self._count("recovery")
        if seconds is None:
            told = self._stage.operation
            name = State(int(told["state"])).name if told else "nothing"
            self._break("recovery", f"does not follow {bound:g} s after the cure; its state is {name}")
