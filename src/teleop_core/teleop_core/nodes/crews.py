"""Crews: the processes of a live session, and the nodes in each process."""

from collections.abc import Collection
from enum import StrEnum

from teleop_core.base.errors import UnknownNameError
from teleop_core.graph.graph import RECORDER_NAME, Graph
from teleop_core.nodes.start import SESSION

_SIDES = ("hand_side", "slave_side")
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
        if name not in names:
            raise UnknownNameError("node of the session", name, names)
    own = {name: _process_of(graph, name, processes) for name in names if name not in without}
    shared = {process: tuple(name for name in own if own[name] == process) for process in dict.fromkeys(own.values())}
    return ({RECORDER_NAME: (RECORDER_NAME,)}, shared)


def _process_of(graph: Graph, name: str, processes: Processes) -> str:
    """Name of the process that runs a node."""
    if processes is Processes.NODES:
        return name
    if processes is Processes.ONE:
        return SESSION
    stages = [member.stage.name for member in graph.members if member.arm == name.rpartition("/")[0]]
    place = stages.index(name.rpartition("/")[2])
    return _SIDES[place >= stages.index("slave")]
