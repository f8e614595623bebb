"""Session: all nodes of the graph in one process, with one loop that runs all stages in turn.

The nodes are the same as in separate processes: names, topics, parameters, lifecycle.
"""

import sys
from collections.abc import Sequence
from typing import Any

from teleop_core.base.errors import UnknownNameError
from teleop_core.graph.graph import FRAMES_NAME, RECORDER_NAME, Graph, Member
from teleop_core.middleware.platform import Platform
from teleop_core.middleware.ros import ROS
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.files import graph_of
from teleop_core.nodes.frames import FramesNode
from teleop_core.nodes.loop import LiveLoop, Loop
from teleop_core.nodes.making import make_node
from teleop_core.nodes.rate import Schedule
from teleop_core.nodes.recorder import RecorderNode
from teleop_core.session.links import link_texts

_AFTER_NS = 700_000
"""Phase of the slave's side within the millisecond [ns]. The hand's side has phase 0. Even at the p99 of the lateness
of the hand's side, its commands arrive before this phase."""


class TeleopSession:
    """The nodes of a graph, and the loop that runs all stages. The recorder and the node of frames have own loops.

    The loop uses the real-time options and the catch-up limit of the last stage, the slave. The group ``teleop`` of the
    parameter files defines the graph.

    Args:
        namespace: Namespace of the whole session, without leading slash; the arms are below it.
        names: Nodes of this process, with the namespaces of their arms; empty: all nodes. Nodes in other processes are
            connected by topics.
        platform: Platform of the session.
        graph: Graph of the session; None: the graph of the parameter files on the command line.

    Raises:
        UnknownNameError: The graph has no such node.
    """

    def __init__(
        self, namespace: str = "", names: Sequence[str] = (), platform: Platform = ROS, graph: Graph | None = None
    ) -> None:
        graph = graph or graph_of(sys.argv)
        known = [*(member.name for member in graph.members), FRAMES_NAME]
        for name in names:
            if name not in known:
                raise UnknownNameError("node of the session", name, known)
        members = [member for member in graph.members if member.name in names or not names]
        given: dict[str, Any] = {"graph": graph, "namespace": namespace, "platform": platform}
        self._recorder: tuple[RecorderNode, ...] = () if names else (RecorderNode(**given),)
        self._frames = (FramesNode(**given),) if FRAMES_NAME in names or not names else ()
        self._stages = tuple(_node(graph, member, namespace, platform) for member in members)
        pairs = [*zip(members, self._stages, strict=True)]
        for beside in (*self._recorder, *self._frames):
            beside.stages = {member.name: node.parameters for member, node in pairs}
            if self._recorder:
                beside.stages[RECORDER_NAME] = self._recorder[0].parameters
        self._loop = LiveLoop(
            "session",
            self._stages,
            self._stages[-1].fail,
            Schedule(
                platform.monotonic_ns,
                platform.sleep,
                self._stages[-1].options.max_catch_up,
                phase_ns=0 if members[0] is graph.members[0] else _AFTER_NS,
            ),
            (*self._recorder, *self._frames),
            (lambda: self._recorder[0].channels) if self._recorder else None,
        )
        for node in self._stages:
            node.loop, node.tells_strain = self._loop, node is self._stages[-1]
        self._loop.start()

    @property
    def nodes(self) -> tuple[CoreNode, ...]:
        """The nodes. The recorder is the first and masters are the last, so that no message is missed."""
        return (*self._recorder, *self._frames, *reversed(self._stages))

    def watched(self) -> list[tuple[Loop, int]]:
        """The loop of all stages, and the loops of the other nodes."""
        own = [(self._loop, self._loop.progress)] if self._loop.is_ready else []
        return [*own, *(one for node in (*self._recorder, *self._frames) for one in node.watched())]

    def halt(self) -> None:
        """Stop the loop; if it hangs, its nodes end without waiting for it."""
        self._loop.stop()


def _node(graph: Graph, member: Member, namespace: str, platform: Platform) -> CoreNode:
    texts = link_texts(graph, member)
    given = {"links": tuple(texts)} if texts else {}
    where = "/".join(filter(None, (namespace, member.arm)))
    return make_node(member.stage, values=given, namespace=where, platform=platform)
