"""Nodes in simulated processes, and a peer that talks to them over simulated topics."""

import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from peers import AnyPeer
from teleop_core.bags.reader import Bag
from teleop_core.graph.graph import BUILT_IN, RECORDER_NAME, Graph, build_graph
from teleop_core.graph.stage import STAGES
from teleop_core.nodes.making import make_node
from teleop_core.nodes.observer import ReportReader
from teleop_core.nodes.process import serve
from teleop_core.nodes.teleop_session import TeleopSession
from teleop_core.nodes.watch import Crew
from teleop_core.robots import load_robot
from teleop_core.session.configuration import Configuration
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.machine import Machine, Process
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.scheduler import Scheduler
from teleop_drill.simulation.session import flattened, parameters_of
from teleop_drill.simulation.stand_ins import SimulatedWatch, Work

_START = 0.05  # of a process [s]
_PAUSE = 0.002  # from one look at a condition to the next [s]
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


class SimulatedNode:
    """One process, as tests treat those of the live peer."""

    def __init__(
        self,
        peer: "SimulatedPeer",
        name: str,
        crew: Callable[[SimulatedPlatform], Crew],
        given: Mapping[str, Mapping[str, Any]],
    ) -> None:
        self.name, self._peer, self.crew = name, peer, None
        self.process = self.stderr = self

        def work(process: Process) -> int:
            platform = SimulatedPlatform(peer.bus, process, given)
            self.crew = crew(platform)  # type: ignore[assignment]
            watch = SimulatedWatch(platform, self.crew, process)
            return serve(self.crew, watch, platform)

        self.own = peer.machine.start(name, work, after=_START)
        peer.bus.watch(self.own)

    @property
    def returncode(self) -> int | None:
        return self.own.exit_code

    def poll(self) -> int | None:
        return self.own.exit_code

    def read_text(self, errors: str = "") -> str:
        """What it has said."""
        return "\n".join(one.text for one in self._peer.machine.log)

    def send_signal(self, number: int) -> None:
        if number == signal.SIGSTOP:
            self.own.stop()
        elif number == signal.SIGCONT:
            self.own.go_on()
        elif number == signal.SIGKILL:
            self.own.end(-number, is_orderly=False)
        else:
            assert number in _SIGNALS
            assert self.crew is not None
            self.crew.nodes[0].end(0)

    def end(self, number: int = signal.SIGINT) -> int:
        self.send_signal(number)
        return self.wait()

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def wait(self, timeout: float = 90.0) -> int:
        self._peer.wait(lambda: self.own.is_dead, f"end of {self.name}", timeout)
        assert self.own.exit_code is not None
        return self.own.exit_code


class SimulatedPeer(AnyPeer):
    """Node of a test on a simulated machine; time passes while the test waits."""

    def __init__(self, seed: int = 0) -> None:
        super().__init__()
        self.machine = Machine(Scheduler(seed))
        self.bus = Bus(self.machine.scheduler)
        owner = self.machine.outsider("test")
        self.bus.watch(owner)
        self.platform = SimulatedPlatform(self.bus, owner)
        self.ros = self.platform.node("peer")
        self.executor = self.platform.executor()
        self.executor.add_node(self.ros)
        self.observer = ReportReader(0, platform=self.platform)

    def launch(self, name: str, parameters: dict[str, Any], arm: str, env: Mapping[str, str] | None) -> SimulatedNode:
        full = f"{arm}/{name}".strip("/")
        return SimulatedNode(
            self,
            full,
            lambda platform: make_node(STAGES.find(name), namespace=arm, platform=platform),
            {full: flattened(parameters)},
        )

    def foreign(self, name: str, work: Work) -> Process:
        """Start a process of others, which goes on until it is ended."""
        made = self.machine.start(name, lambda process: work(SimulatedPlatform(self.bus, process)), after=_START)
        self.bus.watch(made)
        return made

    def side(self, *names: str, **parameters: Mapping[str, Any]) -> SimulatedNode:
        """Some nodes of a session in one process, at work."""
        made = SimulatedNode(
            self,
            "side",
            lambda platform: TeleopSession("", names, platform, build_graph()),
            {name: flattened(values) for name, values in parameters.items()},
        )
        self.nodes.append(made)
        for name in names:
            self.wait_state(name, "active")
        return made

    def compose(self, namespace: str = "", **parameters: Mapping[str, Any]) -> SimulatedNode:
        """A session in one process, at work, with its arm at home."""
        home = {"slave": {"start": load_robot("rcrt1").home.tolist()}}
        names = (*BUILT_IN, RECORDER_NAME)
        given = {
            f"{namespace}/{name}".strip("/"): home.get(name, {}) | dict(parameters.get(name, {})) for name in names
        }
        return self._session(namespace, build_graph(), given)

    def run(self, configuration: Configuration, until: Callable[[], Any], out: Path, namespace: str = "") -> Bag:
        """Recording of a configured session in one process, which lasts until something is so."""
        given = parameters_of(configuration, str(out), namespace)
        session = self._session(namespace, configuration.graph, given)
        self.wait(until, "what the session is to come to")
        assert session.end() == 0
        return Bag(out)

    def _session(self, namespace: str, graph: Graph, given: Mapping[str, Mapping[str, Any]]) -> SimulatedNode:
        made = SimulatedNode(
            self,
            "session",
            lambda platform: TeleopSession(namespace, (), platform, graph),
            {name: flattened(values) for name, values in given.items()},
        )
        self.nodes.append(made)
        for name in (*(member.name for member in graph.members), RECORDER_NAME):
            self.wait_state(f"{namespace}/{name}".strip("/"), "active")
        return made

    def until(self, condition: Callable[[], Any], what: str, timeout: float) -> Any:
        scheduler = self.machine.scheduler
        deadline_ns = scheduler.now_ns + round(1e9 * timeout)
        while not (found := condition()):
            assert scheduler.now_ns < deadline_ns, f"not within {timeout:g} s: {what}"
            scheduler.sleep(_PAUSE)
        return found


@pytest.fixture
def peer() -> SimulatedPeer:
    """A peer on a simulated machine of its own."""
    return SimulatedPeer()


@pytest.fixture
def compose(peer: SimulatedPeer, tmp_path: Path) -> Callable[..., SimulatedNode]:
    """Starter of a composed session with parameters; it is recorded in the test's folder."""

    def start(namespace: str = "", **parameters: dict[str, Any]) -> SimulatedNode:
        recorder = {"out": str(tmp_path / "bag")} | parameters.pop("recorder", {})
        return peer.compose(namespace, recorder=recorder, **parameters)

    return start


@pytest.fixture(scope="module")
def common_peer() -> SimulatedPeer:
    """A peer that the tests of a file share."""
    return SimulatedPeer()


@pytest.fixture(scope="module")
def composed_session(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """Composed session that tests of a file share, as a context: peer, process, recording."""

    @contextmanager
    def run(**parameters: Any) -> Iterator[tuple[SimulatedPeer, SimulatedNode, Path]]:
        peer, bag = SimulatedPeer(), tmp_path_factory.mktemp("session") / "bag"
        made = peer.compose(recorder={"out": str(bag)}, **parameters)
        yield peer, made, bag
        made.end()

    return run
