"""Schedules: faults and commands at random times, drawn from a seed."""

import errno
from collections.abc import Callable
from dataclasses import dataclass
from random import Random

import numpy as np

from teleop_core.bags.messages import layout
from teleop_core.graph.topics import MASTER_BUTTONS, MASTER_FILTERED_OUT, SLAVE_ENERGY, SLAVE_SERVO_JP, TASK_STATE
from teleop_core.nodes.crtk import is_installed
from teleop_core.slave.operation.states import COMMANDS
from teleop_drill.simulation import sometimes
from teleop_drill.simulation.bus import Line
from teleop_drill.simulation.drilled_session import DrilledSession
from teleop_drill.simulation.sometimes import RELEASE

BEGIN = 1.0
"""Earliest time in a session at which a fault begins [s]."""
END = 9.0
"""Latest time in a session at which a fault begins [s]."""
_LONGEST = 3.0  # longest duration of a fault [s]
_LONGER = {"slow turns": 4.5}
"""Time by which faults of a kind last longer, so that a loop has time to give way [s]."""
NAMES = sorted((*COMMANDS, RELEASE))
"""Commands that a fault of the kind ``command`` sends, in the order of its amount."""
_LEADS = {"": 8, "disable": 2, "kill": 3, "pause": 4, "press": 2}
"""Commands before a fault, with their weights. Commands to states that faults rarely met have larger weights."""
_CLOCK_NS = (200_000_000, 3_600_000_000_000)
_FAR_NS = 60_000_000_000
"""Distance of a wrong stamp from now [ns]."""
_READ = (SLAVE_SERVO_JP, MASTER_FILTERED_OUT, SLAVE_ENERGY, TASK_STATE)
"""Topics on which garbage comes; nobody else sends on the last three."""


@dataclass(frozen=True)
class Fault:
    """A fault, or an action of a person.

    Attributes:
        at: Begin, relative to the time at which the arm follows [s].
        kind: Kind of fault.
        where: Process that the fault affects; empty for all processes.
        seconds: Duration [s].
        amount: Strength of the fault, from 0 to 1.
    """

    at: float
    kind: str
    where: str
    seconds: float
    amount: float

    def text(self) -> str:
        """Description of the fault in words."""
        where = f" of {self.where}" if self.where else ""
        return f"at {self.at:.3f} s {self.kind}{where} for {self.seconds:.3f} s ({self.amount:.2f})"


Act = Callable[[DrilledSession, Fault], Callable[[], None] | None]
"""Function that begins a fault; it returns a function that ends the fault, or None."""


def draw(seed: int, processes: tuple[str, ...]) -> tuple[Fault, ...]:
    """Draw one to five faults and commands before them, in the order of their times.

    Before more than half of the faults a command moves the arm out of the state ENABLED. Otherwise nearly all faults
    would meet an ENABLED arm.

    Args:
        seed: Seed of the random faults.
        processes: Names of the processes that faults may affect.
    """
    random = Random(f"{seed}/schedule")
    faults = []
    for _ in range(random.randint(1, 5)):
        kind = random.choice(sorted(KINDS))
        where = random.choice(processes) if kind in OF_PROCESS else ""
        seconds = min(_LONGEST, random.expovariate(1.0)) + _LONGER.get(kind, 0.0)
        fault = Fault(random.uniform(BEGIN, END), kind, where, seconds, random.random())
        (lead,) = random.choices(list(_LEADS), list(_LEADS.values()))
        faults += [*_led(lead, fault.at - random.uniform(0.2, 0.6), processes), fault]
    return tuple(sorted(faults, key=lambda fault: fault.at))


def _led(lead: str, at: float, processes: tuple[str, ...]) -> list[Fault]:
    """Commands that bring the arm into another state."""
    if lead in COMMANDS:
        return [commanded(at, lead)]
    where = processes[-2] if lead == "kill" else ""  # the slave's: the recorder's is the last
    return [Fault(at, lead, where, 1.0, 0.5)] if lead else []


def commanded(at: float, name: str) -> Fault:
    """Fault that sends a command at a time [s]."""
    return Fault(at, "command", "", 0.1, (NAMES.index(name) + 0.5) / len(NAMES))


def _form(fault: Fault, count: int) -> int:
    """Which of several forms a fault has; the amount 0.5 gives form 0."""
    return int(1e6 * fault.amount) % count


def _stop(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    process = stage.process(fault.where)
    process.stop()
    stage.note_stop(process)
    return process.go_on


def _slow(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    """Make each turn of a process longer, up to several ticks."""
    process = stage.process(fault.where)
    process.slow_ns = round(3e6 * fault.amount)
    return lambda: setattr(process, "slow_ns", 0)


def _kill(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    stage.kill(fault.where)
    return lambda: stage.restart(fault.where)


def _crowd(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    costs = stage.machine.scheduler.costs
    costs.crowd_ns = 1e7 * fault.amount
    return lambda: setattr(costs, "crowd_ns", 0.0)


def _hiccups(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    costs, before = stage.machine.scheduler.costs, stage.machine.scheduler.costs.hiccups
    costs.hiccups = 0.1 * fault.amount
    return lambda: setattr(costs, "hiccups", before)


def _line(make: Callable[[float], Line]) -> Act:
    def act(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
        keys = ((fault.where, "*"), ("*", fault.where))
        for key in keys:
            stage.bus.lines[key] = make(fault.amount)

        def mend() -> None:
            for key in keys:
                stage.bus.lines.pop(key, None)

        return mend

    return act


def _clock(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    least, most = _CLOCK_NS
    offset_ns = round(least * (most / least) ** fault.amount)
    clock = stage.machine.clock
    clock.offset_ns += offset_ns if int(1e6 * fault.amount) % 2 else -offset_ns
    return lambda: setattr(clock, "offset_ns", 0)


def _drift(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    stage.machine.clock.drift = 1e-3 * (fault.amount - 0.5)
    return lambda: setattr(stage.machine.clock, "drift", 0.0)


def _disk(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    process = stage.process("recorder")
    process.disk_delay = 0.2 * fault.amount
    return lambda: setattr(process, "disk_delay", 0.0)


def _failing_disk(error: int) -> Act:
    return lambda stage, _: stage.fail_disk(error)


def _press(stage: DrilledSession, fault: Fault) -> Callable[[], None] | None:
    """Press a stop button; in a quarter of the cases it is released at once, and says so a dozen times."""
    button = _form(fault, 2)
    stage.press(button, is_pressed=True)
    if _form(fault, 8) in {2, 5}:
        stage.sometimes[sometimes.TAPPED] += 1
        for _ in range(12):
            stage.press(button, is_pressed=False)
        return None
    return lambda: stage.press(button, is_pressed=False)


def _command(stage: DrilledSession, fault: Fault) -> None:
    stage.command(NAMES[int(fault.amount * len(NAMES)) % len(NAMES)])


def _drive(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    """Drive the arm as a CRTK client does: joints far beyond their speed limits, or the tip at a speed that no arm has.

    While the hand's commands arrive, the arm refuses commands of others. So this fault first stops the hand's commands;
    in one form it does not. In another form the commands are old when they come.
    """
    form = _form(fault, 4)
    drives = stage.robot.drives
    assert drives is not None
    speeds = np.sin(np.arange(1.0, stage.robot.n + 1.0) * (1.0 + 9.0 * fault.amount))
    speeds *= 3.0 * drives.speed_limit
    if form:
        stage.sometimes[(sometimes.BESIDE, sometimes.BEYOND, sometimes.OLD)[form - 1]] += 1
    stage.lead(by_hand=form == 1)
    if form == 2:
        stop = stage.every(0.01, lambda: stage.drive_tip(1e307))
    else:
        age_ns = _FAR_NS if form == 3 else 0
        stop = stage.every(0.01, lambda: stage.drive(speeds, age_ns))

    def give_back() -> None:
        stop()
        stage.lead(by_hand=True)

    return give_back


def _intrude(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    """Publish joint commands near the present ones, as a second publisher of the same topic.

    In two of four forms their stamps are a minute old, or a minute ahead. In another form old commands to enable the
    arm come instead.
    """
    if _form(fault, 4) == 3 and is_installed():
        stage.sometimes[sometimes.OLD] += 1
        return stage.every(0.1, lambda: stage.ask_again(("reset", "enable", "resume"), _FAR_NS))
    ahead_ns = (0, -_FAR_NS, _FAR_NS, 0)[_form(fault, 4)]
    stage.sometimes[sometimes.OLD if ahead_ns < 0 else sometimes.AHEAD] += bool(ahead_ns)
    form, drives = layout(SLAVE_SERVO_JP, stage.robot.joint_names), stage.robot.drives
    assert drives is not None
    off = 0.05 * np.sin(np.arange(stage.robot.n) + 10.0 * fault.amount)
    place = stage.setpoint + off * drives.speed_limit

    def send() -> None:
        stage.publish(SLAVE_SERVO_JP, form.encode_one(stage.platform.time_ns() + ahead_ns, place))

    return stage.every(0.002, send)


def _garbage(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    """Send bytes that are not a valid message, on one of several topics."""
    topic = _READ[_form(fault, len(_READ))]
    data = bytes(int(255 * fault.amount) ^ k & 255 for k in range(int(200 * fault.amount)))
    return stage.every(0.001, lambda: stage.publish(topic, data))


def _clutch(stage: DrilledSession, fault: Fault) -> Callable[[], None]:
    """Press the buttons of the stylus as a second publisher does."""
    form = layout(MASTER_BUTTONS, ())
    pressed = np.array([1.0, float(fault.amount > 0.5), 0.0])

    def send() -> None:
        stage.publish(MASTER_BUTTONS, form.encode_one(stage.platform.time_ns(), pressed))

    return stage.every(0.005, send)


KINDS: dict[str, Act] = {
    "standstill": _stop,
    "slow turns": _slow,
    "kill": _kill,
    "crowd": _crowd,
    "hiccups": _hiccups,
    "loss": _line(lambda amount: Line(loss=amount)),
    "delay": _line(lambda amount: Line(delay=0.3 * amount * amount, jitter=0.05 * amount)),
    "disorder": _line(lambda amount: Line(reorders=0.5 * amount, jitter=0.005)),
    "repeats": _line(lambda amount: Line(repeats=amount)),
    "clock step": _clock,
    "clock drift": _drift,
    "slow disk": _disk,
    "full disk": _failing_disk(errno.ENOSPC),
    "read-only disk": _failing_disk(errno.EROFS),
    "gone disk": _failing_disk(errno.EIO),
    "press": _press,
    "command": _command,
    "drive": _drive,
    "intruder": _intrude,
    "garbage": _garbage,
    "buttons": _clutch,
}
"""All kinds of faults, by their names."""
OF_PROCESS = ("standstill", "slow turns", "kill", "loss", "delay", "disorder", "repeats")
"""Kinds of faults that affect one process."""
