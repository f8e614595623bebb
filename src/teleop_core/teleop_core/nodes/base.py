"""Base of all nodes: a lifecycle node around one stage of the graph."""

import traceback
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from teleop_core.bags.reports import read_reports
from teleop_core.base.errors import SessionError, TeleopError
from teleop_core.graph.signals import TICK_NS
from teleop_core.graph.stage import STAGES, Stage, joints_of
from teleop_core.graph.topics import Kind, Topic
from teleop_core.graph.warming import warm_up
from teleop_core.middleware.platform import Publisher, TransitionResult
from teleop_core.nodes.diagnostics import Reporter, input_values, recent_values, tick_values
from teleop_core.nodes.display import DisplayCopies
from teleop_core.nodes.loop import LiveLoop, Loop, LoopNode
from teleop_core.nodes.news import Commanders, introduction
from teleop_core.nodes.ports import NO_PORTS, Ports
from teleop_core.nodes.quality import profile
from teleop_core.nodes.rate import REPORT_PERIOD, Recent, Schedule, TickCounts, report_phase
from teleop_core.nodes.streams import Input, message_type
from teleop_core.session.reports import report_of

# longest wait for the gate [s]; even on a busy machine, a session's tick takes a hundredth of this time
_GATE_PATIENCE = 1.0
_NEWS = {"active": "at work", "finalized": "ended"}  # other states are logged by their own names


class CoreNode(LoopNode):
    """Lifecycle node around one stage: writes received values to its signals, makes steps, publishes outputs.

    A subclass makes the stage in :meth:`setup` and works in :meth:`step`, which a
    :class:`~teleop_core.nodes.loop.LiveLoop` calls while the node is active. Arguments and errors are those of
    :class:`~teleop_core.nodes.tuned.TunedNode`.
    """

    def __init__(self, stage: Stage, group: type | None = None, **options: Any) -> None:
        super().__init__(stage, group, **options)
        self.description = stage
        self.stage: Any = None
        """The running stage, the same object as :attr:`runner`; None for a node without a stage."""
        self.row: Any = None
        """The stage's signals, by the names of their fields."""
        self.gate = self.platform.lock()
        self.ended: Future[None] = Future()
        self.exit_code = 0
        self.has_ended = False
        """Whether the node was shut down and will send nothing more."""
        self.patience = self.options.real_time.patience
        self.loop: LiveLoop | None = None
        """Loop of the node, which a session gives to its nodes; an active node without one makes its own."""
        self.tells_strain = True
        """Whether the reports of this node say that its loop has given way; one node of a session does."""
        self.is_at_work, self.starts = False, 0
        self._own: LiveLoop | None = None
        self.ports = NO_PORTS
        self._own_publishers: list[Publisher] = []
        self._copies = DisplayCopies(self, {})
        self._report: Topic | None = None
        self._reported: tuple[bytes, Any] = (b"", None)
        self._fresh_counts()
        self._word = "unconfigured"
        self._reporter, self._commanders = Reporter(self), Commanders(self, self.description)
        phase = report_phase(stage.name, tuple(STAGES), self.arm)
        wait = (phase - 1e-9 * self.platform.monotonic_ns()) % REPORT_PERIOD
        self._report_timer = self.ros.create_timer(wait, self._begin_reports)
        self.ending = self.platform.lock()
        """Locked while the end is being reported; all nodes of a process share this lock and ``ended``."""

    # -- what subclasses fill in -----------------------------------------------------------------

    def setup(self, parameters: Any) -> None:
        """Make the stage and open its topics."""
        self.stage = self.runner = self.description.run(parameters, TICK_NS / 1e9)
        warm_up(self.runner)
        self.ports = Ports(
            self,
            self.arm,
            self.description,
            self.stage.signals,
            joints_of(parameters),
            self.options.feeds,
            self.open_publisher,
            self.options.joy_buttons,
        )
        self.row = self.ports.row
        self._copies = DisplayCopies(self, self.ports.outputs)
        self._open_report()

    def start(self) -> None:
        """Get ready for the first turn. Messages that came while the node was inactive are already deleted."""

    def stop(self) -> None:
        """Make the outputs safe after the last turn."""

    def teardown(self) -> None:
        """Close everything that :meth:`setup` opened, except topics."""

    def concerns(self) -> list[str]:
        """Texts about all current problems of the node."""
        return []

    def values(self) -> dict[str, str]:
        """Names and texts of the node's own values in its report, in addition to the values that every node reports."""
        return {}

    def news(self, word: str) -> str:
        """Log line for a new state of the node; ``word`` is the state's name."""
        if word != _NEWS["active"]:
            return word
        inputs, robot = self.ports.all_inputs(), getattr(self.parameters, "robot", "")
        names = [topic.name for topic in self.ports.outputs]
        return f"{word}: {introduction(self.description, inputs, names, robot)}"

    def abandon(self) -> None:
        """Save data that must not be lost, when an orderly end is no longer possible. May be called in any thread."""

    # -- as the whole of a process ---------------------------------------------------------------

    @property
    def nodes(self) -> "tuple[CoreNode, ...]":
        """The nodes of a process that runs only this node."""
        return (self,)

    def watched(self) -> list[tuple[Loop, int]]:
        """The running loop, with a number that grows as long as the loop makes progress."""
        loop = self._own
        return [] if loop is None or not loop.is_ready else [(loop, loop.progress)]

    def halt(self) -> None:
        """Stop the loop that several nodes share; a single node has no shared loop."""

    # -- topics ----------------------------------------------------------------------------------

    def open_publisher(self, topic: Topic) -> Publisher:
        """Open a publisher that sends only while the node is active, and that is closed at cleanup."""
        kind = message_type(topic.ros_type)
        name = self.ros.resolve_topic_name(topic.name)
        offered = self.overrides.apply(name, "publisher", profile(topic))
        publisher = self.ros.create_lifecycle_publisher(kind, topic.name, offered)
        self._own_publishers.append(publisher)
        return publisher

    def leave_topics(self) -> None:
        """Stop publishing the stage's topics until the next configuration; another node publishes them instead."""
        self.ports.mute()
        self._close_publishers()

    def _open_report(self) -> None:
        """Open the stage's report topic, if it has one; reports are sent when they change."""
        own = (topic for topic in self.description.writes if topic.kind is Kind.REPORT)
        self._report = next(own, None)
        if self._report is not None:
            self._report_publisher = self.open_publisher(self._report)
            self._state = self.row[self._report.field]
            read_reports(report_of(self._report, 0, self._state))  # loads the message types, which takes 60 ms

    def send_report(self, stamp_ns: int) -> None:
        """Send the report of the state if the state or a reported parameter has changed."""
        if self._report is None or self.runner is None:
            return
        bits, parameters = self._state.tobytes(), self.parameters
        if bits == self._reported[0] and parameters is self._reported[1]:
            return
        self._reported = bits, parameters
        described = self.runner.described()
        self._report_publisher.publish(report_of(self._report, stamp_ns, self._state, described))
        self.show_present()

    def input(self, port: Topic) -> Input:
        """Input of a port. If the values of several topics are added, the input of the first topic."""
        return self.ports.input(port)

    def read_ports(self, trigger: Topic | None = None) -> None:
        """Update the signals of all ports except the trigger's port."""
        self.ports.read(trigger)

    def _close(self) -> None:
        self.ports.close()
        self._close_publishers()
        self.ports = NO_PORTS
        self.stage = self.runner = self.row = None

    def _close_publishers(self) -> None:
        self._copies.close()
        for publisher in self._own_publishers:
            self.ros.destroy(publisher)
        self._copies, self._own_publishers = DisplayCopies(self, {}), []

    # -- lifecycle -------------------------------------------------------------------------------

    def on_configure(self) -> TransitionResult:
        """Make the stage and open its topics. If this is refused, nothing stays open."""
        self._fresh_counts()
        result = self._guard("configure", lambda: self.setup(self.parameters), "inactive")
        if result is not TransitionResult.SUCCESS:
            self._close()
        return result

    def on_activate(self) -> TransitionResult:
        """Start working."""
        return self._guard("activate", self._begin, "active")

    def on_deactivate(self) -> TransitionResult:
        """Stop working."""
        return self._guard("deactivate", self._halt, "inactive")

    def on_cleanup(self) -> TransitionResult:
        """Close everything; afterwards the node can be configured again."""
        return self._guard("cleanup", self._clear, "unconfigured")

    def on_shutdown(self) -> TransitionResult:
        """Stop and close everything for good."""
        self.has_ended = True
        result = self._guard("shutdown", self._clear, "finalized")
        if result is not TransitionResult.SUCCESS:
            self.exit_code = self.exit_code or 1
        return result

    def on_error(self) -> TransitionResult:
        """After a crash: close everything, so that a supervisor can configure the node again."""
        return self._guard("recovery", self._clear, "unconfigured")

    def _begin(self) -> None:
        for entry in self.ports.all_inputs():
            entry.forget()
        self._reported = b"", None
        self.start()
        self.is_at_work = True
        self.starts += 1
        if self.loop is None:
            self._own = self.loop = LiveLoop(self.ros.get_name(), (self,), self.fail)
            self._own.start()

    def _halt(self) -> None:
        if not self.is_at_work:
            return
        has_stopped = True
        if (own := self._own) is not None:
            self._own = self.loop = None
            has_stopped = own.stop()
        is_free = self.gate.acquire(True, _GATE_PATIENCE)
        self.is_at_work = False
        if is_free:
            self.gate.release()
        if not (has_stopped and is_free):  # the outputs are silent because the sending thread hangs
            raise SessionError(f"{self.member_name} does not answer and is left running")
        self.stop()

    def _clear(self) -> None:
        try:
            self._halt()
        finally:
            try:
                if self.stage is not None:
                    self.teardown()
            finally:
                self._close()

    def _guard(self, transition: str, action: Callable[[], None], word: str) -> TransitionResult:
        try:
            action()
        except TeleopError as error:  # a refused configuration, as one readable line
            self.ros.get_logger().error(f"{transition} refused: {error}")
            return TransitionResult.FAILURE
        except Exception:  # rclpy would convert it to ERROR without a message
            self.ros.get_logger().fatal(f"{transition} crashed:\n{traceback.format_exc()}")
            return TransitionResult.ERROR
        if self._word not in {"unconfigured", "failed"} or word != "finalized":
            self.ros.get_logger().info(self.news(_NEWS.get(word, word)))
        self._word = word
        self.report()
        return TransitionResult.SUCCESS

    def fail(self, reason: str, is_expected: bool) -> None:
        """End the work from within the loop: the outputs fall silent, and the process ends."""
        log = self.ros.get_logger()
        log.error(reason) if is_expected else log.fatal(f"crashed:\n{reason}")
        self._word = "failed"
        if self.options.autostart:
            self.end(1)
        else:
            self.ros.defer(self._deactivate)

    def end(self, exit_code: int) -> None:
        """Let the process end; may be called from any thread."""
        with self.ending:  # a thread that sees the end waits until everything is reported
            self.exit_code = self.exit_code or exit_code
            if not self.ended.done():
                self.ended.set_result(None)

    def _deactivate(self) -> None:
        if self.is_at_work:  # a supervisor may have shut the node down already
            self.ros.trigger("deactivate")

    def finish(self) -> None:
        """Shut down from any state; a node that is already shut down is not changed."""
        self._report_timer.cancel()
        if not self.has_ended:
            self.ros.trigger("shutdown")

    def on_no_transition(self, wanted: str) -> None:
        """Log that a requested transition does not exist in the current state."""
        self.ros.get_logger().error(f"no transition {wanted} while {self._word}")

    # -- diagnostics -----------------------------------------------------------------------------

    def _fresh_counts(self) -> None:
        self.schedule = Schedule(self.platform.monotonic_ns, self.platform.sleep, self.options.max_catch_up)
        self.delay = Recent()  # time from the master's sample to this node's output, [ns]

    @property
    def counts(self) -> TickCounts:
        """Counts of executed, late and missed ticks since the node was configured."""
        return self.schedule.counts

    def _begin_reports(self) -> None:
        """Report now, and from then on once a second."""
        self.ros.destroy(self._report_timer)
        self._report_timer = self.ros.create_timer(REPORT_PERIOD, self._report_in_time)
        self._report_in_time()

    def _report_in_time(self) -> None:
        """Report once a second. An exception from a user's part is logged, and does not end the node."""
        try:
            self._copies.look()
            self.report()
        except Exception:
            self.ros.get_logger().error(f"cannot report:\n{traceback.format_exc()}", throttle_duration_sec=60.0)

    def report(self) -> None:
        """Publish the node's status."""
        inputs = self.ports.all_inputs()
        is_active = self._word == "active"
        concerns = self._reporter.input_concerns(inputs)
        concerns += self.ports.concerns()
        if self.tells_strain and (strain := self.schedule.strain) is not None and strain.is_over:
            concerns.append(strain.concern())
        if is_active:
            concerns += self.overrides.concerns() + self.concerns()
            concerns += self.runner.concerns() if self.runner is not None else []
        elif self._word == "failed":
            concerns.append("failed; see its log")
        rate = self._reporter.rate(self.counts.ticks)
        values = tick_values(self._word, rate, self.counts, TICK_NS * 1e-6)
        if self.loop is not None and self.loop is not self._own:
            values |= self.loop.phases.values()
        values["gave_way"] = str(self.schedule.strain.times if self.schedule.strain is not None else 0)
        values |= input_values(inputs) | self._reporter.rates(inputs)
        values |= {f"sent.{t.name}": str(o.sent) for t, o in self.ports.outputs.items()}
        if step := self._reporter.clock_step():
            concerns.append(f"the system clock was stepped by {step:+.3f} s: all ages of messages are reset")
            for entry in inputs:
                entry.sender.clear_ages()
            self.delay.clear()
        values |= recent_values("lateness", self.schedule.lateness)
        values |= recent_values("delay", self.delay) | (self.values() if is_active else {})
        self._reporter.send(concerns, self._word, values)
        for line in self._commanders.news(inputs):
            self.ros.get_logger().info(line)

    def flush(self) -> None:
        """Wait a moment until the last report has arrived."""
        self._reporter.flush()
