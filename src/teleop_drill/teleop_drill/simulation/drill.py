"""Drill: the exercises of a drill on a simulated machine, to the bit the same for the same seed."""

from collections.abc import Sequence
from pathlib import Path

from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.middleware.world import World
from teleop_core.nodes.crews import Processes, crews
from teleop_core.nodes.observer import Observer
from teleop_core.nodes.start import SESSION
from teleop_core.session.configuration import Configuration
from teleop_drill.drill.exercise import Exercise, Master
from teleop_drill.drill.outcome import Outcome
from teleop_drill.nodes.drill import Say, drill_at
from teleop_drill.nodes.drill_rig import Site, Steering
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.inside import SimulatedSteering
from teleop_drill.simulation.machine import Machine, Process
from teleop_drill.simulation.scheduler import Scheduler
from teleop_drill.simulation.session import SimulatedSession
from teleop_drill.simulation.world import SimulatedWorld


class SimulatedSite:
    """A simulated machine.

    Args:
        bus: Its middleware.
        owner: Process of the drill.
        configuration: What runs.
        folder: Where recordings go.
        master: Who moves the hand.
        processes: How the nodes are shared out.
    """

    domain = 0

    def __init__(
        self, bus: Bus, owner: Process, configuration: Configuration, folder: Path,
        master: Master, processes: Processes,
    ) -> None:  # fmt: skip
        self.is_composed = processes is Processes.ONE
        self.master, self._configuration, self._folder = master, configuration, folder
        self._bus, self._owner, self._processes = bus, owner, processes
        self.world: World = SimulatedWorld(bus, owner)
        self._steering = SimulatedSteering(owner.machine)
        self.control: Steering = self._steering

    def load(self) -> float:
        """Load of the machine: none that is not simulated."""
        return 0.0

    def session(self, observer: Observer) -> SimulatedSession:
        """Processes of a session, of which an observer hears."""
        graph = self._configuration.graph
        shared = {n: nodes for crew in crews(graph, self._processes) for n, nodes in crew.items()}
        if self.is_composed:  # the recorder too, as of `ros2 run teleop_core teleop_session`
            shared = {SESSION: (RECORDER_NAME, *(member.name for member in graph.members))}
        made = SimulatedSession(
            self._bus, self._owner, self._configuration, shared, self._folder, observer,
            self.master,
        )  # fmt: skip
        self._steering.session = made
        return made


def simulated_drill(
    exercises: Sequence[Exercise],
    folder: Path,
    say: Say,
    *,
    seed: int = 0,
    processes: Processes = Processes.NODES,
    files: Sequence[Path] = (),
    texts: Sequence[str] = (),
) -> list[Outcome]:
    """Do exercises on a simulated machine.

    Args:
        exercises: What is done, as of :func:`teleop_drill.drill.chosen`.
        folder: Where recordings go.
        say: Told a line about each.
        seed: What everything is drawn from.
        processes: How the nodes are shared out.
        files: Parameter files over the scenario ``free_motion``.
        texts: Parameters ``key=value`` over all files.

    Raises:
        TeleopError: A parameter is wrong, or a session cannot be started.
    """
    machine = Machine(Scheduler(seed))
    bus = Bus(machine.scheduler)

    def work(owner: Process) -> list[Outcome]:
        bus.watch(owner)

        def site(master: Master, made: Configuration, place: Path) -> Site:
            return SimulatedSite(bus, owner, made, place, master, processes)

        given = ("real_time.priority=30", *texts)
        with SimulatedSteering.installed(machine):
            return drill_at(site, exercises, folder, say, files, given)

    found: list[Outcome] = machine.run(work)
    return found
