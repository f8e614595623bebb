"""Session: all nodes of the graph in one process, with one loop that runs all stages in turn.

The nodes are the same as in separate processes: names, topics, parameters, lifecycle. Within the process, a value goes
directly from stage to stage, in the same tick. Every message is also published, so that other processes can listen.
While a stage is not active, its readers listen to the topic instead: a real device, or a node elsewhere, then replaces
the stage.
"""

import sys
from collections.abc import Sequence
from typing import Any

from teleop_core.base.errors import UnknownNameError
from teleop_core.evaluation.metrics.counts import PHASES
from teleop_core.graph.graph import FRAMES_NAME, RECORDER_NAME, Graph, Member
from teleop_core.graph.topics import Kind
from teleop_core.middleware.ros import ROS
from teleop_core.middleware.world import World
from teleop_core.nodes.base import CoreNode
from teleop_core.nodes.feed import Feed
from teleop_core.nodes.files import graph_of
from teleop_core.nodes.frames import FramesNode
from teleop_core.nodes.loop import Loop
from teleop_core.nodes.making import make_node
from teleop_core.nodes.rate import Phases, Schedule
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
        names: Nodes of this process, with the namespaces of their arms; empty: all nodes. Nodes in
            other processes are connected by topics.
        world: World of the session.
        graph: Graph of the session; None: the graph of the parameter files on the command line.

    Raises:
        UnknownNameError: The graph has no such node.
    """

    def __init__(
        self, namespace: str = "", names: Sequence[str] = (), world: World = ROS, graph: Graph | None = None
    ) -> None:
        self._world = world
        graph = graph or graph_of(sys.argv)
        known = [*(member.name for member in graph.members), FRAMES_NAME]
        for name in names:
            if name not in known:
                raise UnknownNameError("node of the session", name, known)
        members = [member for member in graph.members if member.name in names or not names]
        given: dict[str, Any] = {"graph": graph, "namespace": namespace, "world": world}
        self._recorder = () if names else (RecorderNode(**given),)
        self._frames = (FramesNode(**given),) if FRAMES_NAME in names or not names else ()
        self._stages = tuple(_node(graph, member, namespace, world) for member in members)
        pairs = [*zip(members, self._stages, strict=True)]
        for beside in (*self._recorder, *self._frames):
            beside.stages = {member.name: node.parameters for member, node in pairs}
            if self._recorder:
                beside.stages[RECORDER_NAME] = self._recorder[0].parameters
        self._feed = Feed(_fed(self._stages) if names else (), world)
        self._gate = world.lock()
        for node in self._stages:
            node.has_own_loop, node.gate = False, self._gate
            node.tells_strain = node is self._stages[-1]
        last = self._stages[-1]
        self._schedule = Schedule(
            world.monotonic_ns,
            world.sleep,
            last.options.max_catch_up,
            phase_ns=0 if members[0] is graph.members[0] else _AFTER_NS,
        )
        self._phases = Phases(*PHASES)
        for node in self._stages:
            node.phases = self._phases
        self._at_work: tuple[bool, ...] = ()
        self._ticks = 0
        self._loop = Loop(world, "session", self._turn, last.fail, patience=last.patience)
        self._loop.start()

    @property
    def nodes(self) -> tuple[CoreNode, ...]:
        """The nodes. The recorder is the first and masters are the last, so that no message is missed."""
        return (*self._recorder, *self._frames, *reversed(self._stages))

    def watched(self) -> list[tuple[Loop, int]]:
        """The loop of all stages, and the loops of the other nodes."""
        own = [(self._loop, self._loop.turns + self._ticks)] if self._loop.is_ready else []
        return [*own, *(one for node in (*self._recorder, *self._frames) for one in node.watched())]

    def halt(self) -> None:
        """Stop the loop; if it hangs, its nodes end without waiting for it."""
        if not self._loop.stop():
            for node in self._stages:
                node.gate = self._world.lock()
        self._feed.close()

    def _turn(self) -> None:
        """Run all stages for each tick that is due."""
        is_first = not self._loop.is_ready and self._are_all_there()
        if is_first:
            self._stages[-1].prepare()  # give the loop its priority after all kernels are compiled
            self._schedule.strain = self._stages[-1].schedule.strain
            self._loop.is_ready = True
        with self._gate:
            at_work = tuple(node.is_at_work for node in self.nodes)
            if at_work != self._at_work:
                self._link()
                self._at_work = at_work
        if is_first:
            self._schedule.start()  # ticks that passed meanwhile must not be caught up
        if not self._loop.is_ready or not any(at_work):
            self._world.sleep(0.01)
            self._schedule.start()
            return
        for tick_ns in self._schedule.due():
            if not self._loop.is_running:  # there may be a thousand ticks to catch up
                return
            self._tick(tick_ns)

    def _are_all_there(self) -> bool:
        """Whether every node that starts by itself has been at work, so that no sample is missed."""
        waited_for = [n for n in self.nodes if n.options.autostart and not n.has_ended]
        return any(n.has_worked for n in self.nodes) and all(n.has_worked for n in waited_for)

    def _tick(self, tick_ns: int) -> None:
        """Make one tick [ns, monotonic]: take, step, give, tell. The gate keeps all nodes open until it is over."""
        clock = self._world.monotonic_ns
        self._ticks += 1
        with self._gate:
            at_work = [node for node in self._stages if node.is_at_work]
            begin_ns = clock()
            for node in at_work:
                node.take()
            taken_ns = clock()
            for node in at_work:
                node.step(tick_ns)
            stepped_ns = clock()
            # Messages with the longest path to their reader are sent first: the slave's setpoint first, the master's
            # sample last.
            for node in reversed(at_work):
                node.ports.publish()
            self._feed.flush()
            given_ns = clock()
            for node in at_work:
                node.tell()
            self._phases.put(begin_ns, taken_ns, stepped_ns, given_ns, clock())

    def _link(self) -> None:
        """Connect every stage's output to its readers in this process, if both are at work."""
        active = [node for node in self._stages if node.is_at_work]
        for node in self._stages:  # if one ticking node is late in a tick, all ticking nodes are late in this tick
            if node.description.trigger is None:
                node.schedule = self._schedule
        outputs = {topic.name: out for node in active for topic, out in node.ports.outputs.items()}
        inputs = [entry for node in active for entry in node.ports.all_inputs()]
        channels: dict[str, Any] = dict(self._feed.channels)
        for recorder in self._recorder:
            channels |= recorder.channels
        for entry in inputs:
            entry.join(entry.topic.name in outputs)
        for name, out in outputs.items():
            out.serve([entry for entry in inputs if entry.topic.name == name])
        for node in active:
            node.ports.waits = True
            node.ports.connect(channels, self._feed)
        for name, channel in channels.items():
            channel.join(name in outputs)
        self._feed.flush()  # send fed messages before the middleware publishes the first message


def _fed(stages: Sequence[CoreNode]) -> list[str]:
    """Names of the topics that nodes feed to a recorder. Reports are sent only by the middleware."""
    return [
        topic.of_arm(node.arm).name
        for node in stages
        for topic in node.description.writes
        if topic.kind is not Kind.REPORT
    ]


def _node(graph: Graph, member: Member, namespace: str, world: World) -> CoreNode:
    texts = link_texts(graph, member)
    given = {"links": tuple(texts)} if texts else {}
    where = "/".join(filter(None, (namespace, member.arm)))
    return make_node(member.stage, values=given, namespace=where, world=world)
