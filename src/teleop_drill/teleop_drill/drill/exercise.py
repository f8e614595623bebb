"""Exercise: one fault of a drill, the expected reaction of the arm, and the actions for its recovery."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from teleop_core.graph.operation import State
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array
from teleop_core.slave.operation import Fault
from teleop_drill.drill.hand import SPEED, Distortion
from teleop_drill.drill.numbers import Numbers


class Master(Enum):
    """Kind of operator that moves the hand."""

    DEVICE = "the simulated device of the session"
    DRILL = "the drill itself, which publishes the samples of a device"


class AllowedMotion(Enum):
    """Allowed motion of the arm under a fault."""

    RESTS = "the arm comes to rest by itself"
    HOLDS = "the arm moves to the last valid command and stays there, as with the clutch pressed"
    LED = "the arm follows the drill's own commands"
    GOES_ON = "the arm continues to move, within the motion that the hand commands"


class Cure(Enum):
    """Action that the arm needs to move again."""

    NOTHING = "by itself"
    RESUME = "resume"
    RESET = "reset + enable"
    RESTART = "restart"


class Rig(Protocol):
    """The session of a drill, and actions that cause faults in it."""

    @property
    def is_composed(self) -> bool:
        """Whether all nodes share one process."""
        ...

    def mark(self) -> None:
        """Declare that the fault begins now. Without this call it begins when :attr:`Exercise.inject` is called."""

    def note(self, text: str) -> None:
        """Add a note, which the table shows beside the state."""

    def wait(self, seconds: float) -> None:
        """Let time pass [s]."""

    def kill(self, node: str) -> None:
        """Kill a node's process, as the kernel does when memory is short."""

    def written(self) -> int:
        """Bytes of the present recording that have reached the disk."""
        ...

    def freeze(self, node: str, seconds: float, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Stop a node's process for a time [s], call `meanwhile` during the stop, then continue the process."""

    def limit_files(self, node: str, room: int | None) -> None:
        """Let files of a node's process grow by at most `room` bytes; None for no limit."""

    def hog(self, seconds: float) -> None:
        """Keep all cores busy for a time [s]."""

    def start_bystander(self) -> None:
        """Start a foreign ROS process, and return when it has subscribed to all streams."""

    def kill_bystander(self) -> None:
        """Kill the foreign process."""

    def distort(self, distortion: Distortion) -> None:
        """Apply a distortion to the hand's samples before they are sent."""

    def mute_buttons(self, *, is_mute: bool) -> None:
        """Stop or restart the messages of the stylus's buttons."""

    def publish(self, topic: Topic, stamp_ns: int, values: Array) -> None:
        """Send one message as another publisher of the topic would."""

    def publish_bytes(self, topic: Topic, data: bytes) -> None:
        """Send bytes that are not a valid message, as another publisher of the topic would."""

    def leave(self, topic: Topic) -> None:
        """Close the other publisher of the topic."""

    def setpoint(self) -> Array:
        """Newest joint setpoint (n,) of the slave [rad or m]."""

    def way_to_limit(self) -> tuple[Array, float]:
        """Displacement (n,) of one joint to its nearer limit [rad or m], and the displacement of the tip [m]."""

    def drive(self, speeds: Array, seconds: float, *, is_named: bool = False) -> None:
        """Drive the joints (n,) at speeds [rad/s or m/s] for a time [s], as a CRTK client does.

        With ``is_named`` the messages name the joints, and begin with the second one.
        """

    def now_ns(self) -> int:
        """Present time [ns]."""

    def press(self, *, is_pressed: bool, button: int = 0) -> None:
        """Send a message of a stop button with the given number."""

    def command(self, name: str) -> bool:
        """Call a service of the slave; returns whether the command was done."""

    def commands(self, *names: str) -> list[bool]:
        """Like :meth:`command`, for several commands, without waiting for the answers in between."""

    def set(self, node: str, name: str, value: object) -> bool:
        """Set a parameter of a running node; returns whether it was accepted."""

    def control(self, word: int, offset_ns: int = 0) -> None:
        """Set what the drill's own stage does, and the error of all clocks [ns]."""


Time = Callable[[Numbers], float]
"""A time [s] that follows from the numbers of the session."""


def command_timeout(numbers: Numbers) -> float:
    """Time limit after the last command: the arm follows this command for the command timeout."""
    return numbers.command_timeout


def at_once(numbers: Numbers) -> float:
    """Time limit for commands that are sent directly to the slave, which reads them in every tick."""
    return numbers.tick


def outage(numbers: Numbers) -> float:
    """Time limit for a silent stream: the time until the arm is PAUSED."""
    return numbers.longest_outage


def silence(numbers: Numbers) -> float:
    """Time limit for an arm that no longer reports its position: the time until this silence is a fault."""
    return numbers.longest_silence


def unheard(numbers: Numbers) -> float:
    """Time limit for an arm that no longer reports its position, if it brakes after the command timeout."""
    braking = max(numbers.speed_limit / numbers.braking)
    return numbers.command_timeout + float(braking)


def never(_: Numbers) -> float:
    """Time limit of zero."""
    return 0.0


def after(seconds: float) -> Time:
    """Time limit that the exercise itself gives [s]."""
    return lambda _: seconds


def nothing(_: Rig) -> None:
    """Do nothing."""


@dataclass(frozen=True, kw_only=True)
class Exercise:
    """One fault.

    Attributes:
        name: Name that selects the exercise.
        text: Description of the fault.
        inject: Function that causes the fault; it returns when the fault has begun or is over.
        undo: Function that removes a lasting fault.
        motion: Allowed motion of the arm during the fault.
        states: Operating states that may follow; None stands for a slave that has ended.
        faults: Faults that may be reported; if it is empty, any fault or none may be reported.
        cures: Actions that the arm may need before it moves again.
        master: Kind of operator that moves the hand.
        allowed: Time for which the arm may continue its motion [s] before it must brake.
        stands: Longest time at rest [s] for an arm that is expected to keep moving.
        gap: Longest gap in the commands after which the arm catches up [s].
        by_drives: Whether the drives stood still during the gap and then catch up with the setpoints of the gap.
        said: Text that the arm must have answered, as recorded by :meth:`Rig.note`; empty if any answer is allowed.
        told: Time limit for the report of the state or the fault in ``slave/operation`` [s]; None: no report.
        warns: Whether a node must warn of the fault in ``diagnostics``.
        brakes: Whether the drives must be off at the end, and brakes hold the arm.
        hand_speed: Largest speed of the hand, or of the commands that replace it [m/s].
        tool_speed: Largest speed of the tip's setpoint that the exercise sets [m/s].
        lost: Longest time that may be missing in the recording [s].
        watch: Time for which the session is observed after the injection [s].
        ways: Kinds of sessions to which the exercise applies: True for composed sessions, False for processes.
        cuts_recording: Whether the recorder cannot close the recording because of the fault.
        breaks_simulator: Whether the exercise breaks the simulated arm; then it cannot run without it.
        repeats: Number of repetitions; the worst result is reported.
    """

    name: str
    text: str
    inject: Callable[[Rig], None]
    undo: Callable[[Rig], None] = nothing
    motion: AllowedMotion = AllowedMotion.RESTS
    states: tuple[State | None, ...] = (State.ENABLED,)
    faults: tuple[Fault, ...] = ()
    cures: tuple[Cure, ...] = (Cure.NOTHING,)
    master: Master = Master.DRILL
    allowed: Time = command_timeout
    stands: Time = never
    gap: Time = never
    by_drives: bool = False
    said: str = ""
    told: Time | None = None
    warns: bool = False
    brakes: bool = False
    hand_speed: float = SPEED
    tool_speed: float = math.inf
    lost: float = 0.0
    watch: float = 0.5
    ways: tuple[bool, ...] = (False, True)
    cuts_recording: bool = False
    breaks_simulator: bool = False
    repeats: int = 1
