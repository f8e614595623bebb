"""Crews: the processes of a live session, and the nodes in each process."""

from collections.abc import Collection, Mapping
from enum import StrEnum

from teleop_core.base.errors import UnknownNameError
from teleop_core.graph.graph import FRAMES_NAME, RECORDER_NAME, Graph
from teleop_core.nodes.start import SESSION

_SIDES = ("hand_side", "slave_side")
_FREE = ("display", "task")
"""Stages that may run on either side."""
Crew = dict[str, tuple[str, ...]]
"""Processes that are started together, each with its nodes."""


class Processes(StrEnum):
    """Distribution of a session's nodes over processes; the recorder always has its own process."""

    SIDES = "sides"
    """Two processes: the hand's side up to inverse kinematics, and the slave's side with the simulated arm."""
    NODES = "nodes"
    """A process for each node, so that each node can be replaced or killed separately."""
    ONE = "one"
    """All stages in one process: the fastest session."""


def crews(graph: Graph, processes: Processes = Processes.SIDES, without: Collection[str] = ()) -> tuple[Crew, ...]:
    """Processes of a graph, in groups that are started one after the other. The first group is the recorder.

    Args:
        graph: Graph of the session.
        processes: Distribution of the nodes over processes.
        without: Nodes that are not started.

    Raises:
        UnknownNameError: ``without`` names a node that does not exist.
    """
    names = tuple(member.name for member in graph.members)
    for name in without:
        if name not in (*names, FRAMES_NAME):
            raise UnknownNameError("node of the session", name, (*names, FRAMES_NAME))
    sides = _sides(graph)
    own = {name: _process_of(name, processes, sides) for name in names if name not in without}
    if FRAMES_NAME not in without:
        is_alone = processes is Processes.NODES or not own
        own[FRAMES_NAME] = FRAMES_NAME if is_alone else own.get("slave", [*own.values()][-1])
    shared = {process: tuple(name for name in own if own[name] == process) for process in dict.fromkeys(own.values())}
    return ({RECORDER_NAME: (RECORDER_NAME,)}, shared)


def _process_of(name: str, processes: Processes, sides: Mapping[str, str]) -> str:
    """Name of the process that runs a node."""
    if processes is Processes.NODES:
        return name
    return SESSION if processes is Processes.ONE else sides[name]


def _sides(graph: Graph) -> dict[str, str]:
    """Side of each node.

    Stages up to inverse kinematics are at the hand, the slave and what simulates it at the arm. Any other stage, such
    as a display or a task, is where fewer topics cross between the processes.
    """
    found: dict[str, str] = {}
    for member in graph.members:
        stages = [one.stage.name for one in graph.members if one.arm == member.arm]
        found[member.name] = _SIDES[stages.index(member.stage.name) >= stages.index("slave")]
    for member in graph.members:
        if member.stage.name in _FREE:
            found[member.name] = min(_SIDES[::-1], key=lambda side: _crossing(graph, found | {member.name: side}))
    return found


def _crossing(graph: Graph, sides: Mapping[str, str]) -> int:
    """Number of topics that a process publishes for the other one."""
    links = [link for member in graph.members for link in graph.links_of(member)]
    return len({link.topic.name for link in links if sides[link.writer.name] != sides[link.reader.name]})
