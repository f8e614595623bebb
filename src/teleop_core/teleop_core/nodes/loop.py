"""Loop: the thread in which nodes work; the executor serves their parameters in another thread.

:class:`LiveLoop` runs the nodes of a process tick after tick. Within the process, a value goes directly from stage to
stage, in the same tick. Every message is also published, so that other processes can listen. While a stage is not
active, its readers listen to the topic instead: a real device, or a node elsewhere, then replaces the stage.
"""

import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from teleop_core.base.errors import TeleopError
from teleop_core.graph.signals import PHASES
from teleop_core.graph.stage import Stage
from teleop_core.graph.topics import Kind
from teleop_core.middleware.platform import Platform
from teleop_core.nodes.feed import Feed
from teleop_core.nodes.ports import Ports
from teleop_core.nodes.rate import Phases, Schedule
from teleop_core.nodes.strain import Strain
from teleop_core.nodes.streams import Tap
from teleop_core.nodes.tuned import TunedNode

_END_PATIENCE = 8.0  # longest wait for the last turn [s], which may compile a kernel or wait for a slow disk


class Loop:
    """Thread that makes one turn after another until it is stopped.

    Args:
        platform: Platform of the loop.
        name: Name of the thread.
        turn: Makes one turn; blocks for at most a tenth of a second.
        fail: Called when a turn failed and the loop has ended, with the reason and whether it was expected.
        prepare: Called once in the thread before the first turn, may take long; None if the turns prepare themselves.
        patience: Time without progress after which the loop counts as hung, without the time for which it waited for a
            processor [s]; 0: never.

    Attributes:
        name: Name of the thread.
        turns: Number of finished turns.
        patience: As given.
        is_running: Whether the loop continues; False after it was asked to stop.
        is_ready: Whether the loop is prepared for its turns.
        is_hung: Whether a watchdog found that it hangs.
    """

    def __init__(
        self,
        platform: Platform,
        name: str,
        turn: Callable[[], None],
        fail: Callable[[str, bool], None],
        prepare: Callable[[], None] | None = None,
        patience: float = 0.0,
    ) -> None:
        self.name, self.turns, self.patience = name, 0, patience
        self.is_ready = self.is_hung = False
        self._turn, self._fail, self._prepare = turn, fail, prepare
        self.is_running, self._platform = True, platform
        self._thread = platform.thread(name, self._run)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> bool:
        """End after the current turn; returns whether the loop has ended. A loop that hangs is abandoned."""
        self.is_running = False
        if self._platform.thread_ident() == self._thread.ident:
            return True
        self._thread.join(0.0 if self.is_hung else _END_PATIENCE)
        return not self._thread.is_alive()

    @property
    def is_alive(self) -> bool:
        """Whether the thread is still running."""
        return self._thread.is_alive()

    @property
    def thread(self) -> int:
        """Number of the loop's thread in the operating system; 0 before the thread has begun."""
        return self._thread.native_id or 0

    def place(self) -> str:
        """Current position of the loop's thread in the code: the innermost calls, the most recent call last."""
        frame = sys._current_frames().get(self._thread.ident or 0)
        if frame is None:
            return "  it has ended"
        return "".join(traceback.format_stack(frame)[-6:]).rstrip()

    def _run(self) -> None:
        turn = self._turn
        try:
            if self._prepare is not None:
                self._prepare()
                self.is_ready = True
            while self.is_running:
                turn()
                self.turns += 1
        except TeleopError as error:
            self._fail(str(error), True)
        except Exception:  # the thread would end without a message
            self._fail(traceback.format_exc(), False)


class LoopNode(TunedNode):
    """Node that works in a :class:`LiveLoop`."""

    description: Stage
    ports: Ports
    schedule: Schedule
    patience: float
    """Time without progress after which the loop counts as hung [s]; 0: never."""
    gate: Any
    """Locked by the loop during a tick."""
    is_at_work: bool
    starts: int
    """Number of times that it began to work."""
    has_ended: bool

    def due(self) -> Sequence[int]:
        """Wait for work, at most a tenth of a second; returns the ticks to make [ns, monotonic].

        A session has a schedule for all its nodes and does not call this method.
        """
        return self.schedule.due()

    def take(self) -> None:
        """Read what came from other processes; the loop calls this method of all its nodes before :meth:`step`."""

    def step(self, tick_ns: int) -> None:
        """Work for one tick [ns, monotonic]; the loop calls this method of all its nodes in turn."""
        raise NotImplementedError

    def tell(self) -> None:
        """Report changes of the last tick, after the loop has sent all messages of the tick."""

    def prepare(self) -> None:
        """Apply the real-time options to the calling thread; log the options that the system refuses."""
        options = self.options.real_time
        refusals = self.platform.take_real_time(options)
        for refusal in refusals:
            self.ros.get_logger().warning(refusal)
        if options.priority > 0 and not any("priority" in refusal for refusal in refusals):
            self.schedule.strain = self.strain()

    def strain(self) -> Strain:
        """New judge of the loop that calls this method, which has real-time priority."""
        again = replace(self.options.real_time, cpus=(), lock_memory=False, freeze_gc=False)
        warn = self.ros.get_logger().warning
        # A log line takes milliseconds, too long for the loop.
        return Strain(
            self.platform, lambda: self.platform.take_real_time(again), lambda text: self.ros.defer(warn, text)
        )


class LiveLoop(Loop):
    """Loop of the nodes of a process, or of one of them.

    The last node's real-time options and patience are those of the loop.

    Args:
        name: Name of the thread.
        nodes: Nodes in the order of their steps.
        fail: Called when a tick failed and the loop has ended, with the reason and whether it was expected.
        schedule: Schedule of all ticks; None if the single node decides when it works.
        beside: Further nodes of the process, which have their own loops.
        taps: Receivers of messages in this process, by topic; None: messages are fed to the recorder of this machine.

    Attributes:
        nodes: As given.
        phases: Time that the phases of the ticks took.
        tick_ns: Tick that is being made [ns, monotonic].
        newest_ns: Newest tick that is due [ns, monotonic].
        progress: Number that grows as long as the loop makes progress.
    """

    def __init__(
        self,
        name: str,
        nodes: Sequence[LoopNode],
        fail: Callable[[str, bool], None],
        schedule: Schedule | None = None,
        beside: Sequence[LoopNode] = (),
        taps: Callable[[], Mapping[str, Tap]] | None = None,
    ) -> None:
        last = nodes[-1]
        super().__init__(last.platform, name, self._work, fail, patience=last.patience)
        self.nodes, self._crew, self._gate = nodes, (*beside, *nodes), last.platform.lock()
        self._schedule, self._due = (last.schedule, last.due) if schedule is None else (schedule, schedule.due)
        self._taps = taps
        self._feed = Feed(_fed(nodes) if taps is None else (), last.platform)
        self._at_work: tuple[int, ...] = ()
        self.phases, self.tick_ns, self.newest_ns, self.progress = Phases(*PHASES), 0, 0, 0
        for node in nodes:
            node.gate = self._gate

    def stop(self) -> bool:
        """End after the current tick; returns whether the loop has ended. A loop that hangs is abandoned."""
        has_ended = super().stop()
        if has_ended:
            self._feed.close()
        else:
            for node in self.nodes:  # the nodes end without waiting for the loop
                node.gate = self._platform.lock()
        return has_ended

    def _work(self) -> None:
        """Make all ticks that are due: take, step, give, tell. The gate keeps all nodes open during a tick."""
        clock = self._platform.monotonic_ns
        self.progress += 1
        if not self._has_work():
            self._platform.sleep(0.01)
            self._schedule.start()
            return
        ticks = self._due()
        self.newest_ns = ticks[-1]
        for self.tick_ns in ticks:
            if not self.is_running:  # there may be a thousand ticks to catch up
                return
            self.progress += 1
            with self._gate:
                nodes = [node for node in self.nodes if node.is_at_work]
                begin_ns = clock()
                for node in nodes:
                    node.take()
                taken_ns = clock()
                for node in nodes:
                    node.step(self.tick_ns)
                stepped_ns = clock()
                # Messages with the longest path to their reader are sent first: the slave's setpoint first, the
                # master's sample last.
                for node in reversed(nodes):
                    node.ports.publish()
                self._feed.flush()
                given_ns = clock()
                for node in nodes:
                    node.tell()
                self.phases.put(begin_ns, taken_ns, stepped_ns, given_ns, clock())

    def _has_work(self) -> bool:
        """Whether the loop is prepared and a node is at work; connects nodes that have begun or ended."""
        is_first = not self.is_ready and self._are_all_there()
        if is_first:
            last = self.nodes[-1]
            last.prepare()  # give the loop its priority after all kernels are compiled
            self._schedule.strain = last.schedule.strain
            self.is_ready = True
        with self._gate:
            # A node may stop and start between two looks; its outputs are then new ones.
            at_work = tuple(node.starts if node.is_at_work else 0 for node in self._crew)
            if at_work != self._at_work:
                self._link()
                self._at_work = at_work
        if is_first:
            self._schedule.start()  # ticks that passed meanwhile must not be caught up
        return self.is_ready and any(at_work)

    def _are_all_there(self) -> bool:
        """Whether every node that starts by itself has been at work, so that no sample is missed."""
        waited_for = [node for node in self._crew if node.options.autostart and not node.has_ended]
        return any(node.starts for node in self._crew) and all(node.starts for node in waited_for)

    def _link(self) -> None:
        """Connect every stage's output to its readers in this process, if both are at work."""
        active = [node for node in self.nodes if node.is_at_work]
        for node in self.nodes:  # if one ticking node is late in a tick, all ticking nodes are late in this tick
            if node.description.trigger is None:
                node.schedule = self._schedule
        outputs = {topic.name: out for node in active for topic, out in node.ports.outputs.items()}
        inputs = [entry for node in active for entry in node.ports.all_inputs()]
        channels: Mapping[str, Any] = self._feed.channels if self._taps is None else self._taps()
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


def _fed(nodes: Sequence[LoopNode]) -> list[str]:
    """Names of the topics that nodes feed to a recorder. Reports are sent only by the middleware."""
    written = [(topic, node.arm) for node in nodes for topic in node.description.writes]
    return [topic.of_arm(arm).name for topic, arm in written if topic.kind is not Kind.REPORT]
