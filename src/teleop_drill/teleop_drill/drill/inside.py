"""Parts of a drill inside the processes under test: a stage that can fail, and a clock that can be stepped.

The processes of a drill load this file as a file with own parts. Nodes outside of a drill never load it. The drill and
the processes share a control file; its numbers determine the faults.
"""

import mmap
import os
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol
from weakref import WeakKeyDictionary, WeakSet

from teleop_core.base.errors import PartError
from teleop_core.base.parameters import NoParameters
from teleop_core.graph.stage import STAGES, RunningStage, Stage, register_stage
from teleop_core.graph.topics import OPERATION, SLAVE_OPERATION, SLAVE_SERVO_CP, Kind, Topic, passed_on
from teleop_core.kernels.geometry import Array
from teleop_core.slave.slave_sim import SlaveSim

VARIABLE = "TELEOP_DRILL"
"""Environment variable with the path of the control file."""
STAGE_NAME = "drill_stage"
_FORM = struct.Struct("<qq")
WORKS, HANGS, RAISES, STICKS, RACES, SLOWS = range(6)
"""What the stage does; or what the joints do, which no parameter of a session makes stick or race.
"""
_BRAKED = OPERATION.index("is_braked")
_SLOW = 3e-3  # time that a slow step takes [s]
TURN = 5e-3  # time between two readings of the order to the joints [s]


class Control:
    """Control file of the faults; the drill writes it, and the processes read it.

    Args:
        file: File of 16 bytes: the order to the stage, and the error of the clock [ns].
    """

    def __init__(self, file: Path) -> None:
        with file.open("r+b") as opened:
            self._map = mmap.mmap(opened.fileno(), _FORM.size)

    @staticmethod
    def make(file: Path) -> "Control":
        """Create the file with orders that cause no fault."""
        file.write_bytes(bytes(_FORM.size))
        return Control(file)

    @property
    def word(self) -> int:
        """Present order to the stage."""
        return int(_FORM.unpack(self._map)[0])

    @property
    def offset_ns(self) -> int:
        """Offset of the stepped clock [ns]."""
        return int(_FORM.unpack(self._map)[1])

    def write(self, word: int = WORKS, offset_ns: int = 0) -> None:
        """Write the order to the stage, and the error of the clock [ns]."""
        self._map[:] = _FORM.pack(word, offset_ns)


DRILLED_CP = Topic("slave/drilled_cp", Kind.POSE, passed_on(SLAVE_SERVO_CP.name), "slave_base")


class Steered(Protocol):
    """Source of the orders to a stage."""

    @property
    def word(self) -> int:
        """Number of the present order to the stage."""


class Passing(RunningStage):
    """Stage that passes on every command, until the control source orders it to be slow, to hang or to raise.

    Attributes:
        control: Source of the orders to this stage.
        sleep: Function that waits for some seconds while the stage hangs or is slow.
    """

    control: Steered | None = None
    sleep: Callable[[float], None] = staticmethod(time.sleep)

    def step(self) -> None:
        """Pass a command on, slowly or not, or hang, or raise an exception, as the present order says."""
        while self.control is not None and self.control.word == HANGS:
            self.sleep(0.01)
        if self.control is not None and self.control.word == SLOWS:
            self.sleep(_SLOW)
        if self.control is not None and self.control.word == RAISES:
            raise RuntimeError("broken by the drill")
        self.signals[DRILLED_CP.field] = self.signals[SLAVE_SERVO_CP.field]

    def load(self) -> Any:
        """Do nothing, because the stage has no compiled code."""
        return lambda: None


def _make(_: Any, dt: float) -> Passing:
    return Passing(STAGES.find(STAGE_NAME), 0, dt)


def _step_clock(control: Control) -> None:
    """Replace the system clock of the process by a clock with an error; monotonic clocks do not change."""
    right = time.time_ns
    time.time_ns = lambda: right() + control.offset_ns


class Joints:
    """Joints of simulated slaves, which stick or race on command.

    A joint that sticks has dry friction of twice the effort limit of its drive, as with a load that is far too heavy.
    For a race, the first joint is accelerated to twice its rated speed until the brakes stop it.
    """

    def __init__(self) -> None:
        self._before: WeakKeyDictionary[SlaveSim, Array] = WeakKeyDictionary()

    def obey(self, slave: SlaveSim, word: int) -> None:
        """Make the joints of a slave execute an order."""
        friction = slave.parameters["coulomb"]
        if word == STICKS:
            self._before.setdefault(slave, friction.copy())
            friction[:] = 2.0 * slave.parameters["effort_limit"]
        elif slave in self._before:
            friction[:] = self._before.pop(slave)
        is_braked = slave.signals[SLAVE_OPERATION.field][_BRAKED] > 0.0
        if word == RACES and not is_braked:
            slave.arm.dq[0] = 2.0 * slave.parameters["speed_limit"][0]


class _Watched:
    """All simulated slaves of the process; each slave executes the present order as soon as it is created."""

    def __init__(self, control: Control) -> None:
        self._control, self._joints = control, Joints()
        self._slaves: WeakSet[SlaveSim] = WeakSet()
        self._make, self._owner = SlaveSim.__init__, 0

    def follow(self) -> None:
        """Register every slave that is created from now on."""
        watched = self

        def make(slave: SlaveSim, *arguments: Any, **options: Any) -> None:
            watched._make(slave, *arguments, **options)
            watched._slaves.add(slave)
            watched._start()

        SlaveSim.__init__ = make  # type: ignore[method-assign, assignment]

    def _start(self) -> None:
        """Start the thread in the process that contains a slave, because a fork does not copy threads."""
        if self._owner != os.getpid():
            self._owner = os.getpid()
            threading.Thread(target=self._run, name="joints", daemon=True).start()

    def _run(self) -> None:
        while True:
            time.sleep(TURN)
            for slave in tuple(self._slaves):
                self._joints.obey(slave, self._control.word)


def register() -> None:
    """Register the stage that can fail, unless it is registered already."""
    if STAGE_NAME in STAGES:
        return
    stage = Stage(
        STAGE_NAME,
        NoParameters,
        reads=(SLAVE_SERVO_CP,),
        writes=(DRILLED_CP,),
        trigger=SLAVE_SERVO_CP,
        replaces=SLAVE_SERVO_CP,
        make=_make,
    )
    register_stage(stage)


def install() -> None:
    """Register the stage in a process of the drill, and start the functions that read the control file."""
    register()
    file = os.environ.get(VARIABLE)
    if file is None:
        return
    if not Path(file).is_file():
        raise PartError("file of a drill", file, "one that the drill has made")
    control = Passing.control = Control(Path(file))
    _step_clock(control)
    _Watched(control).follow()


if __name__.startswith("teleop_own_parts"):
    # This file is loaded as own parts: the stage that is registered is that of the package, which the drill controls.
    from teleop_drill.drill import inside  # noqa: PLW0406  # no, it is read under another name

    inside.install()
