"""Parts of a drill inside the processes under test: a stage that breaks, a clock that is stepped.

The file is given to the processes as one with own parts, so that nothing of it is in nodes that no
drill has started. What it does is said by the numbers of a file that both sides see.
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
"""Environment variable with the name of the file that says what is to break."""
STAGE_NAME = "drill_stage"
_FORM = struct.Struct("<qq")
WORKS, HANGS, RAISES, STICKS, RACES = 0, 1, 2, 3, 4
"""What the stage does; or what the joints do, which no parameter of a session makes stick or race.
"""
_BRAKED = OPERATION.index("is_braked")
TURN = 5e-3  # from one look at what joints are to do to the next [s]


class Control:
    """What is to break, as both sides see it.

    Args:
        file: File of 16 bytes: what the stage does, and by how much the clock is off [ns].
    """

    def __init__(self, file: Path) -> None:
        with file.open("r+b") as opened:
            self._map = mmap.mmap(opened.fileno(), _FORM.size)

    @staticmethod
    def make(file: Path) -> "Control":
        """A new file, under which all works."""
        file.write_bytes(bytes(_FORM.size))
        return Control(file)

    @property
    def word(self) -> int:
        """What the stage does."""
        return int(_FORM.unpack(self._map)[0])

    @property
    def offset_ns(self) -> int:
        """By how much the clock is off [ns]."""
        return int(_FORM.unpack(self._map)[1])

    def write(self, word: int = WORKS, offset_ns: int = 0) -> None:
        """Say what the stage does and by how much the clock is off [ns]."""
        self._map[:] = _FORM.pack(word, offset_ns)


DRILLED_CP = Topic("slave/drilled_cp", Kind.POSE, passed_on(SLAVE_SERVO_CP.name), "slave_base")


class Steered(Protocol):
    """Who says what the stage does."""

    @property
    def word(self) -> int:
        """What it does."""


class Passing(RunningStage):
    """Passes every command on, as long as it works.

    Attributes:
        control: Who says what it does.
        sleep: How it waits while it hangs [s].
    """

    control: Steered | None = None
    sleep: Callable[[float], None] = staticmethod(time.sleep)

    def step(self) -> None:
        """Pass a command on; or hang, or raise."""
        while self.control is not None and self.control.word == HANGS:
            self.sleep(0.01)
        if self.control is not None and self.control.word == RAISES:
            raise RuntimeError("broken by the drill")
        self.signals[DRILLED_CP.field] = self.signals[SLAVE_SERVO_CP.field]

    def load(self) -> Any:
        """Nothing is compiled."""
        return lambda: None


def _make(_: Any, dt: float) -> Passing:
    return Passing(STAGES.find(STAGE_NAME), 0, dt)


def _step_clock(control: Control) -> None:
    """Let the process read a clock that may be off; what measures durations stays as it is."""
    right = time.time_ns
    time.time_ns = lambda: right() + control.offset_ns


class Joints:
    """Joints of simulated slaves: they stick as long as they are told to.

    Their dry friction is then twice what the drives can give, as under a load far too heavy. Or the
    first one races: it is pushed to twice its speed until the brakes hold it.
    """

    def __init__(self) -> None:
        self._before: WeakKeyDictionary[SlaveSim, Array] = WeakKeyDictionary()

    def obey(self, slave: SlaveSim, word: int) -> None:
        """Do what a word says."""
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
    """All simulated slaves of the process, each of which obeys from its making on."""

    def __init__(self, control: Control) -> None:
        self._control, self._joints = control, Joints()
        self._slaves: WeakSet[SlaveSim] = WeakSet()
        self._make, self._owner = SlaveSim.__init__, 0

    def follow(self) -> None:
        """Know every slave that is made from now on."""
        watched = self

        def make(slave: SlaveSim, *arguments: Any, **options: Any) -> None:
            watched._make(slave, *arguments, **options)
            watched._slaves.add(slave)
            watched._start()

        SlaveSim.__init__ = make  # type: ignore[method-assign, assignment]

    def _start(self) -> None:
        """Start the thread in the process that has a slave: no thread outlives a fork."""
        if self._owner != os.getpid():
            self._owner = os.getpid()
            threading.Thread(target=self._run, name="joints", daemon=True).start()

    def _run(self) -> None:
        while True:
            time.sleep(TURN)
            for slave in tuple(self._slaves):
                self._joints.obey(slave, self._control.word)


def register() -> None:
    """Register the stage that breaks, once."""
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
    """Register the stage in a process that a drill has started, and do there what it says."""
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
    # This file is read as parts of one's own: the stage is that of the package, which the drill steers.
    from teleop_drill.drill import inside  # noqa: PLW0406  # no, it is read under another name

    inside.install()
