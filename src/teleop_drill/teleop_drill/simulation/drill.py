"""Drill: the exercises of a drill on a simulated machine; equal seeds give exactly equal results."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from teleop_core.base.errors import ParameterError
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.middleware.platform import Platform
from teleop_core.nodes.crews import Processes, crews
from teleop_core.nodes.interrupt import Interrupt
from teleop_core.nodes.observer import ReportReader
from teleop_core.nodes.start import SESSION
from teleop_core.session.configuration import Configuration
from teleop_drill.drill.exercise import Exercise, Master
from teleop_drill.drill.outcome import FaultOutcome
from teleop_drill.nodes.drill import Say, drill_at
from teleop_drill.nodes.drill_site import Site, Steering
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.inside import SimulatedSteering
from teleop_drill.simulation.machine import Machine, Process
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.scheduler import Scheduler
from teleop_drill.simulation.session import ARM, SimulatedSession
from teleop_drill.simulation.stand_ins import Work


class SimulatedSite:
    """A simulated machine.

    Args:
        bus: Middleware of the machine.
        owner: Process of the drill.
        configuration: Configuration of the session.
        folder: Folder of the recordings.
        master: Kind of operator that moves the hand.
        interrupt: Object that ends a wait of the drill with KeyboardInterrupt.
        processes: Distribution of the nodes over processes.
        foreign: Programs of processes of other software, by name.
    """

    domain = 0

    def __init__(
        self, bus: Bus, owner: Process, configuration: Configuration, folder: Path,
        master: Master, interrupt: Interrupt, processes: Processes, foreign: Mapping[str, Work],
    ) -> None:  # fmt: skip
        self.is_composed = processes is Processes.ONE
        self.master, self.interrupt = master, interrupt
        self._configuration, self._folder = configuration, folder
        self._bus, self._owner, self._processes = bus, owner, processes
        self._foreign = foreign
        self.platform: Platform = SimulatedPlatform(bus, owner)
        self._steering = SimulatedSteering(owner.machine)
        self.control: Steering = self._steering

    def load(self) -> float:
        """Load of the machine by other programs, which is always zero."""
        return 0.0

    def session(self, observer: ReportReader) -> SimulatedSession:
        """Return the processes of a session; the observer receives their topics."""
        graph = self._configuration.graph
        shared = {n: nodes for crew in crews(graph, self._processes) for n, nodes in crew.items()}
        if self.is_composed:  # including the recorder, as in `ros2 run teleop_core teleop_session`
            shared = {SESSION: (RECORDER_NAME, *(member.name for member in graph.members))}
        made = SimulatedSession(
            self._bus, self._owner, self._configuration, shared, self._folder, observer, self.master, self._foreign
        )
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
    drives: Work | None = None,
    arm: Work | None = None,
) -> list[FaultOutcome]:
    """Run exercises on a simulated machine.

    Args:
        exercises: Exercises to run, from :func:`teleop_drill.drill.chosen`.
        folder: Folder of the recordings.
        say: Called with one line about each exercise.
        seed: Seed of all random numbers.
        processes: Distribution of the nodes over processes.
        files: Parameter files that override the scenario ``free_motion``.
        texts: Parameters ``key=value`` that override all files.
        drives: Program of drives that replace the simulated drives, such as a bridge. Exercises that break the
            simulator are then left out.
        arm: Program of the process that the drives command, such as the model of a controller. This process is started
            before the drives, and the drill does not break it.

    Raises:
        ParameterError: ``drives`` are given although all nodes share one process, or an ``arm`` is given without
            drives.
        TeleopError: A parameter is wrong, or a session cannot be started.
    """
    if drives is not None and processes is not Processes.NODES:
        raise ParameterError("processes", processes, f"{Processes.NODES} with drives")
    if arm is not None and drives is None:
        raise ParameterError("arm", arm, "given with drives only, which move the arm")
    both = {"slave_sim": drives, ARM: arm}
    foreign = {name: work for name, work in both.items() if work is not None}
    own = [one for one in exercises if not (drives and one.breaks_simulator)]
    machine = Machine(Scheduler(seed))
    bus = Bus(machine.scheduler)

    def work(owner: Process) -> list[FaultOutcome]:
        bus.watch(owner)

        def site(master: Master, made: Configuration, place: Path, interrupt: Interrupt) -> Site:
            return SimulatedSite(bus, owner, made, place, master, interrupt, processes, foreign)

        given = ("real_time.priority=30", *texts)
        with SimulatedSteering.installed(machine):
            return drill_at(site, own, folder, say, files, given)

    found: list[FaultOutcome] = machine.run(work)
    return found
