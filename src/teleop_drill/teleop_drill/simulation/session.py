"""Session: starts, breaks and ends the processes of a session on a simulated machine."""

import signal
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from teleop_core.base.errors import SessionError
from teleop_core.graph.graph import FRAMES_NAME, RECORDER_NAME
from teleop_core.graph.stage import STAGES
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.live import session_parameters
from teleop_core.nodes.making import make_node
from teleop_core.nodes.observer import ReportReader
from teleop_core.nodes.process import serve
from teleop_core.nodes.start import SESSION
from teleop_core.nodes.teleop_session import TeleopSession
from teleop_core.nodes.watch import Crew
from teleop_core.session.configuration import Configuration
from teleop_drill.drill.exercise import Master
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.stand_ins import SimulatedWatch, Work, stand_by

_START = 0.4  # time from the start of a process until its node is created [s]
_STARTED = 60.0  # time limit for the start [s]
_ENDED = 10.0  # time limit for the end [s]
_NEVER_NS = 2**62
ARM = "arm"
"""Process that the drives command; it is started first, and the drill does not break it."""
_DRILLED = ("operator", "haptic_master")
"""Nodes that the drill may replace."""
Processes = Mapping[str, tuple[str, ...]]
"""Nodes of each process, by the name of the process; the recorder's process is first."""


class SimulatedSession:
    """Simulated form of :class:`~teleop_drill.nodes.drill_site.SessionProcesses`.

    Args:
        bus: The middleware.
        owner: Process of the drill.
        configuration: Configuration of the session.
        processes: Distribution of the nodes over processes.
        folder: Folder of the recordings.
        observer: Node that receives the reports of the session.
        master: Kind of operator that moves the hand.
        foreign: Programs of processes of other software, by name: drives that replace the simulator, and the arm that
            these drives command.
    """

    def __init__(
        self, bus: Bus, owner: Process, configuration: Configuration, processes: Processes,
        folder: Path, observer: ReportReader, master: Master, foreign: Mapping[str, Work] | None = None,
    ) -> None:  # fmt: skip
        self._bus, self._machine, self._configuration = bus, owner.machine, configuration
        self._folder, self.observer, self._master = folder, observer, master
        left_out = () if master is Master.DEVICE else _DRILLED
        self._processes = {
            name: tuple(node for node in nodes if node not in left_out) for name, nodes in processes.items()
        }
        self._processes = {name: nodes for name, nodes in self._processes.items() if nodes}
        self._foreign = dict(foreign or {})
        if ARM in self._foreign:
            self._processes[ARM] = (ARM,)
        self._places = {node: name for name, nodes in self._processes.items() for node in nodes}
        self.running: dict[str, Process] = {}
        """Newest process of each name."""
        self.crews: dict[Process, Crew] = {}
        """Nodes of each process."""
        self._nodes: dict[Process, dict[str, CoreNode]] = {}
        self.recordings: list[Path] = []
        self._begun_ns: list[int] = []
        self._bystander: Process | None = None

    # -- start and end ---------------------------------------------------------------------------

    def start(self) -> None:
        """Start all processes that do not run, the recorder first, and wait until all are ready."""
        whole = self._processes.items()
        first = {n: k for n, k in whole if RECORDER_NAME in k or n == ARM}
        rest = {n: k for n, k in whole if n not in first}
        for crew in (first, rest):
            new = [name for name in crew if name not in self.running or self.running[name].is_dead]
            for name in new:
                self.launch(name)
            self._await([node for name in new if name not in self._foreign for node in crew[name]])

    def launch(self, name: str) -> None:
        """Start a process without waiting until it is ready."""
        nodes = self._processes[name]
        if RECORDER_NAME in nodes:
            self.recordings.append(self._folder / f"recording_{len(self.recordings) + 1}")
            self._begun_ns.append(self.observer.platform.time_ns())
        given = self._given()

        def work(process: Process) -> int:
            platform = SimulatedPlatform(self._bus, process, given)
            if name in self._foreign:
                return self._foreign[name](platform)
            crew = self._crew(nodes, platform)
            self.crews[process] = crew
            watch = SimulatedWatch(platform, crew, process)
            return serve(crew, watch, platform)

        self.running[name] = self._machine.start(name, work, after=_START)
        self._bus.watch(self.running[name])

    def _crew(self, nodes: tuple[str, ...], platform: SimulatedPlatform) -> Crew:
        graph = self._configuration.graph
        if len(nodes) > 1:
            own = () if RECORDER_NAME in nodes else nodes
            return TeleopSession("", own, platform, graph)
        if nodes[0] in {RECORDER_NAME, FRAMES_NAME}:
            return make_node(STAGES.find(nodes[0]), platform=platform)
        (member,) = (one for one in graph.members if one.name == nodes[0])
        return make_node(member.stage, namespace=member.arm, platform=platform)

    def _given(self) -> dict[str, dict[str, Any]]:
        """Parameters of all nodes, as in their parameter file."""
        found = parameters_of(self._configuration, str(self.recordings[-1]))
        if self._master is not Master.DEVICE:
            for name in _DRILLED:
                found[name]["autostart"] = False
        return found

    def _await(self, nodes: list[str]) -> None:
        for name in nodes:
            self.observer.statuses.pop(name, None)
        scheduler = self._machine.scheduler
        deadline_ns = scheduler.now_ns + round(1e9 * _STARTED)
        while not all(self.observer.is_active(name) for name in nodes):
            self.observer.listen(0.05)
            self.check()
            if scheduler.now_ns > deadline_ns:
                raise SessionError(f"{', '.join(nodes)}: not at work after {_STARTED:g} s")

    def check(self) -> None:
        """Check that all processes run; raises SessionError if one has ended."""
        for process in self.running.values():
            if process.is_dead:
                said = [one.text for one in self._machine.log if one.level in {"error", "fatal"}]
                raise SessionError(f"{process.name} has ended: {'; '.join(said[-2:])}")

    def close(self) -> None:
        """End all processes in order, the recorder last."""
        self.kill_bystander()
        last = [p for n, p in self.running.items() if RECORDER_NAME in self._processes[n]]
        for crew in ([p for p in self.running.values() if p not in last], last):
            self._end(crew)
        self.running.clear()

    def _end(self, processes: list[Process]) -> None:
        scheduler = self._machine.scheduler
        deadline_ns = scheduler.now_ns + round(1e9 * _ENDED)
        for process in processes:
            process.go_on()
            if process in self.crews:
                self.crews[process].nodes[0].end(0)
            elif process.name in self._foreign:
                process.end(0, is_orderly=True)
        while not all(one.is_dead for one in processes) and scheduler.now_ns < deadline_ns:
            scheduler.sleep(0.01)
        for process in processes:
            process.end(-signal.SIGKILL, is_orderly=False)

    def until_ns(self, recording: Path) -> int:
        """Time at which the recording after the given one began [ns]; later than all times if there is none."""
        place = self.recordings.index(recording) + 1
        return self._begun_ns[place] if place < len(self._begun_ns) else _NEVER_NS

    # -- what can be done to them ----------------------------------------------------------------

    def process_of(self, node: str) -> Process | None:
        """Process that contains a node; None if there is none."""
        return self.running.get(self._places.get(node, ""))

    def node(self, name: str) -> CoreNode | None:
        """A running node, for inspection; None if the node does not run."""
        process = self.process_of(name)
        if process is None or process.is_dead or process not in self.crews:
            return None
        nodes = self._nodes.get(process)
        if nodes is None:
            nodes = self._nodes[process] = {one.member_name: one for one in self.crews[process].nodes}
        return nodes.get(name)

    def is_running(self, node: str) -> bool:
        """Whether the process of a node runs."""
        process = self.process_of(node)
        return process is not None and not process.is_dead

    def dead(self) -> list[str]:
        """Processes that have ended."""
        return [name for name, process in self.running.items() if process.is_dead]

    def send(self, node: str, number: int) -> None:
        """Send a signal to a node's process."""
        process = self.process_of(node)
        if process is None or process.is_dead:
            raise ProcessLookupError(node)
        what: dict[int, Callable[[], None]] = {
            signal.SIGSTOP: process.stop,
            signal.SIGCONT: process.go_on,
            signal.SIGKILL: lambda: process.end(-signal.SIGKILL, is_orderly=False),
        }
        what[number]()

    def await_end(self, node: str, timeout: float) -> None:
        """Do nothing, because a simulated process ends at once."""

    def limit_files(self, node: str, room: int | None) -> None:
        """Let files of a node's process grow by at most `room` bytes; None for no limit."""
        process = self.process_of(node)
        if process is not None:
            process.room = room

    def hog(self) -> None:
        """Keep all processors busy: processes without priority wait for a processor."""
        self._machine.scheduler.costs.crowd_ns = 3e6

    def relieve(self) -> None:
        """End the load of :meth:`hog`."""
        self._machine.scheduler.costs.crowd_ns = 0.0

    def start_bystander(self) -> None:
        """Start a foreign process that subscribes to all streams."""
        self._bystander = self._machine.start(
            "bystander", lambda process: stand_by(SimulatedPlatform(self._bus, process))
        )
        self._bus.watch(self._bystander)
        self._machine.scheduler.sleep(0.5)

    def kill_bystander(self) -> None:
        """Kill the foreign process."""
        if self._bystander is not None:
            self._bystander.end(-signal.SIGKILL, is_orderly=False)
            self._bystander = None


def parameters_of(configuration: Configuration, out: str, namespace: str = "") -> dict[str, dict[str, Any]]:
    """Parameters of all nodes of a session, by the full names of the nodes, as in their parameter file.

    Args:
        configuration: The session.
        out: Directory of the recording.
        namespace: Namespace of all nodes, without leading and trailing slash.
    """
    content = session_parameters(configuration, out, namespace)
    content.pop(SESSION, None)
    return {
        name.strip("/"): flattened(node["ros__parameters"])
        for name, node in content.items()
        if "ros__parameters" in node
    }


def flattened(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Parameters with dotted names; lists as tuples."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            found |= flattened(value, f"{prefix}{name}.")
        else:
            found[f"{prefix}{name}"] = tuple(value) if isinstance(value, list) else value
    return found
