"""Stand-ins: a watchdog of processes that uses no signals and no system statistics, and a foreign process."""

from collections.abc import Callable
from typing import Any

from teleop_core.graph.stage import STAGES
from teleop_core.graph.topics import STREAMS
from teleop_core.nodes.loop import Loop
from teleop_core.nodes.making import make_node
from teleop_core.nodes.process import serve
from teleop_core.nodes.quality import profile
from teleop_core.nodes.streams import message_type
from teleop_core.nodes.watch import Crew
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.platform import SimulatedPlatform

_PERIOD = 0.1
_END_PATIENCE = 4.0


class SimulatedWatch:
    """Finds loops that hang, and ends a process that does not end by itself.

    Args:
        platform: Platform of the process.
        crew: Nodes that are watched.
        process: Process that is ended.

    Attributes:
        word: Activity of the process.
    """

    def __init__(self, platform: SimulatedPlatform, crew: Crew, process: Process) -> None:
        self.word = "starting"
        self._platform, self._crew, self._process = platform, crew, process
        self._still: dict[Loop, tuple[int, float]] = {}
        self._asked = 0.0
        platform.thread("watch", self._run).start()

    def _run(self) -> None:
        while True:
            self._platform.sleep(_PERIOD)
            if self.word == "at work":
                self._find_hung()
            self._asked += _PERIOD * self._crew.nodes[0].ended.done()
            if self._asked > _END_PATIENCE:
                self._leave()

    def _find_hung(self) -> None:
        still: dict[Loop, tuple[int, float]] = {}
        for loop, number in self._crew.watched():
            before, since = self._still.get(loop, (number, 0.0))
            seconds = since + _PERIOD if before == number else 0.0
            still[loop] = number, seconds
            if 0.0 < loop.patience <= seconds and loop.is_alive:
                loop.is_hung = True
                self._crew.nodes[0].ros.get_logger().fatal(f"{loop.name} hangs")
                self._crew.nodes[0].end(1)
        self._still = still

    def _leave(self) -> None:
        for node in self._crew.nodes:
            node.abandon()
        self._process.end(1, is_orderly=False)


Work = Callable[[SimulatedPlatform], int]
"""Program of a simulated process: a function of the process's platform that returns the exit code."""


def run_node(platform: SimulatedPlatform, stage: str, **values: Any) -> int:
    """Run one node as the program of a process until the process is ordered to end; returns the exit code.

    Args:
        platform: Platform of the process.
        stage: Name of the node's stage.
        values: Parameters of the node, as in a parameter file.

    Raises:
        TeleopError: The stage does not exist, or a parameter is wrong.
    """
    crew = make_node(STAGES.find(stage), values=values, platform=platform)
    return serve(crew, SimulatedWatch(platform, crew, platform.process), platform)


def stand_by(platform: SimulatedPlatform) -> int:
    """Subscribe to all streams until the process is killed."""
    node, executor = platform.node("bystander"), platform.executor()
    executor.add_node(node)
    for topic in STREAMS:
        kind = message_type(topic.kind.ros_type)
        node.create_subscription(kind, f"/{topic.name}", lambda _: None, profile(topic, 10))
    while True:
        executor.spin_once()
