"""Platform: the simulated machine as seen by one process, with the interface that nodes use."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from teleop_core.base.background import Background
from teleop_core.graph.layers import RealTimeParameters
from teleop_core.middleware.platform import Hooks
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.disk import Disk
from teleop_drill.simulation.lifecycle import SimulatedLifecycleNode
from teleop_drill.simulation.machine import Listener, Process, SocketEnd
from teleop_drill.simulation.nodes import SimulatedExecutor, SimulatedNode
from teleop_drill.simulation.reach import functions
from teleop_drill.simulation.scheduler import Lock, Strand

_PLACE = "recorder"


class SimulatedPlatform:
    """Simulated form of :class:`~teleop_core.middleware.platform.Platform`.

    Args:
        bus: The middleware.
        process: The process.
        given: Parameters of the process's file, by the full names of nodes without the leading slash.

    Attributes:
        process: The process.
    """

    def __init__(self, bus: Bus, process: Process, given: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        self._bus, self.process, self._given = bus, process, given or {}
        self._scheduler = process.machine.scheduler
        scheduler = self._scheduler
        self.monotonic_ns: Callable[[], int] = scheduler.look_and_pass if scheduler.breaks else scheduler.look_ns
        self.background: Background = Disk(process)
        self.sleep: Callable[[float], None] = self._scheduler.sleep

    def functions(self) -> dict[str, int]:
        """Addresses of the C functions of the simulated middleware; none if threads may be interrupted."""
        context = int(np.asarray(self.process.context).ctypes.data)
        return {**functions(), "context": context} if self._bus.reaches else {}

    def time_ns(self) -> int:
        """Time of the system's clock [ns]."""
        now_ns = self.monotonic_ns()
        return now_ns + self.process.clock.ahead_ns(now_ns)

    def lock(self) -> Lock:
        """Lock between threads."""
        return Lock(self._scheduler)

    def thread(self, name: str, work: Callable[[], None]) -> Strand:
        """Return a thread that runs ``work`` as soon as it is started."""
        return self._scheduler.spawn(self.process, name, work)

    def thread_ident(self) -> int:
        """Number of the calling thread."""
        return self._scheduler.current.ident or 0

    def take_real_time(self, options: RealTimeParameters) -> list[str]:
        """Set the priority of the calling thread."""
        self._scheduler.current.has_priority = options.priority > 0
        return []

    def give_way(self) -> None:
        """Take the priority from the calling thread."""
        self._scheduler.current.has_priority = False

    def thread_time_ns(self) -> int:
        """Processor time that the calling thread has used [ns]."""
        return self._scheduler.current.used_ns

    def tidy(self) -> None:
        """Do nothing, because a simulated start leaves no garbage."""

    def connect(self, place: str) -> SocketEnd:
        """Connect to the listener at an address."""
        return self.process.machine.connect(self.process, place)

    def listen(self, place: str) -> Listener:
        """Listen at an address."""
        return self.process.machine.listen(self.process, place)

    def feed_place(self) -> str:
        """Address at which the recorder of this machine listens."""
        return _PLACE

    def node(self, name: str, **options: Any) -> SimulatedNode:
        """A node."""
        return SimulatedNode(self._bus, self.process, name, **options)

    def lifecycle_node(self, name: str, hooks: Hooks, **options: Any) -> SimulatedLifecycleNode:
        """A node with parameters and a lifecycle."""
        full = f"{str(options.get('namespace', '')).strip('/')}/{name}".strip("/")
        return SimulatedLifecycleNode(self._bus, self.process, name, hooks, self._given.get(full, {}), **options)

    def executor(self) -> SimulatedExecutor:
        """Executor of the nodes of this process."""
        return SimulatedExecutor(self.process)

    def guest(self, domain: int | None = None) -> "SimulatedPlatform":
        """This platform, because the simulation has a single domain."""
        return self

    def shutdown(self) -> None:
        """Do nothing, because a simulated process leaves the middleware when it ends."""
