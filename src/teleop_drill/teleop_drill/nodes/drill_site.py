"""Site: where a session is drilled, this machine or a simulated one, and its processes."""

from pathlib import Path
from typing import Protocol

from teleop_core.middleware.world import World
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.observer import Observer
from teleop_drill.drill import inside
from teleop_drill.drill.exercise import Master


class Session(Protocol):
    """Processes of a session, as a drill starts, breaks and ends them.

    Attributes:
        recordings: Recordings so far, the present one last.
    """

    recordings: list[Path]

    def start(self) -> None:
        """Start all processes that do not run, and wait until all are ready; raises SessionError."""

    def check(self) -> None:
        """Make sure that all processes run; raises SessionError."""

    def close(self) -> None:
        """End all, in order."""

    def until_ns(self, recording: Path) -> int:
        """When the recording after the given one was begun [ns]; later than all times if there is none."""

    def is_running(self, node: str) -> bool:
        """Whether the process of a node runs."""

    def dead(self) -> list[str]:
        """Processes that have ended."""

    def send(self, node: str, number: int) -> None:
        """Send a signal to a node's process."""

    def await_end(self, node: str, timeout: float) -> None:
        """Wait until a node's process has ended, for at most `timeout` [s]."""

    def limit_files(self, node: str, room: int | None) -> None:
        """Let files of a node's process grow by at most `room` bytes; None for no limit."""

    def hog(self) -> None:
        """Keep all processors busy."""

    def relieve(self) -> None:
        """Let them rest."""

    def start_bystander(self) -> None:
        """Start a foreign process that subscribes to all streams."""

    def kill_bystander(self) -> None:
        """Kill it."""


class Steering(Protocol):
    """Controls what breaks inside of the processes."""

    def write(self, word: int = inside.WORKS, offset_ns: int = 0) -> None:
        """Set what the stage does and the error of the clock [ns]."""


class Site(Protocol):
    """Where a session is drilled: this machine, or a simulated one.

    Attributes:
        world: World of the drill itself.
        domain: ROS domain.
        is_composed: Whether all nodes share one process.
        master: Kind of operator that moves the hand.
        control: Control of the faults inside the processes.
        interrupt: Object that ends a wait of the drill with KeyboardInterrupt.
    """

    world: World
    domain: int
    is_composed: bool
    master: Master
    control: Steering
    interrupt: Interrupt

    def session(self, observer: Observer) -> Session:
        """Processes of a session, whose reports the observer receives."""

    def load(self) -> float:
        """Load of the machine, per processor."""
