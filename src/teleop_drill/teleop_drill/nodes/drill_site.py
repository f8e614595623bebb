"""Site: the machine of a drill (this one or a simulated one), and the processes of a session on it."""

from pathlib import Path
from typing import Protocol

from teleop_core.middleware.platform import Platform
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.observer import ReportReader
from teleop_drill.drill import inside
from teleop_drill.drill.exercise import Master


class SessionProcesses(Protocol):
    """Processes of a session, which a drill starts, breaks and ends.

    Attributes:
        recordings: Recordings so far, the present recording last.
    """

    recordings: list[Path]

    def start(self) -> None:
        """Start all processes that do not run, and wait until all are ready; raises SessionError."""

    def check(self) -> None:
        """Check that all processes run; raises SessionError if one has ended."""

    def close(self) -> None:
        """End all processes in order."""

    def until_ns(self, recording: Path) -> int:
        """Time at which the recording after the given one began [ns]; later than all times if there is none."""

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
        """End the load of :meth:`hog`."""

    def start_bystander(self) -> None:
        """Start a foreign process that subscribes to all streams."""

    def kill_bystander(self) -> None:
        """Kill the foreign process."""


class Steering(Protocol):
    """Control of the faults inside the processes."""

    def write(self, word: int = inside.WORKS, offset_ns: int = 0) -> None:
        """Set the order to the stage, and the error of the clock [ns]."""


class Site(Protocol):
    """Machine on which sessions are drilled: this machine, or a simulated one.

    Attributes:
        platform: Middleware and time of the drill itself.
        domain: ROS domain of the sessions.
        is_composed: Whether all nodes share one process.
        master: Kind of operator that moves the hand.
        control: Control of the faults inside the processes.
        interrupt: Object that ends a wait of the drill with KeyboardInterrupt.
    """

    platform: Platform
    domain: int
    is_composed: bool
    master: Master
    control: Steering
    interrupt: Interrupt

    def session(self, observer: ReportReader) -> SessionProcesses:
        """Return the processes of a session; the observer receives their reports."""

    def load(self) -> float:
        """Load of the machine, divided by the number of processors."""
