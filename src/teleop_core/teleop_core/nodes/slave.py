"""Node ``slave``: the server of any arm, one step per elapsed millisecond."""

from teleop_core.bags.messages import Refusal
from teleop_core.graph.operation import State
from teleop_core.graph.signals import TICK_NS
from teleop_core.graph.topics import SLAVE_MEASURED_CP, SLAVE_MEASURED_JS, SLAVE_SERVO_JP, Topic
from teleop_core.nodes.crtk_slave import CrtkSlave
from teleop_core.nodes.operation import CommandServices, StopInput
from teleop_core.nodes.sender import SECOND_NS
from teleop_core.nodes.ticking import TickingNode
from teleop_core.slave.commands import CommandStatus
from teleop_core.slave.operation import Fault, operation_text
from teleop_core.slave.ownership import Leader
from teleop_core.slave.parameters import SlaveParameters

_SERVO = SLAVE_SERVO_JP.name
_SELDOM = 10
"""Number of turns between two checks of clocks and publishers."""
_ANSWERS = 50
"""Largest number of the arm's samples that are answered in one turn, so that a turn takes less than a tick."""
_DISABLED = float(State.DISABLED)
_CLOCK_STEP_NS = 100_000_000
"""Largest change of the system clock relative to the monotonic clock that does not count as a step [ns]."""


class SlaveNode(TickingNode):
    """Follows the newest ``slave/servo_jp`` while the arm is enabled and homed; stops on command.

    Nothing is sent before the arm has reported its position, because any setpoint could move it. The emergency stop is
    read before every tick. Faults that only a node can detect, such as a stepped clock, are passed to the stage, which
    reacts as to all other faults.
    """

    def setup(self, parameters: SlaveParameters) -> None:
        """Make the slave, open its topics, and listen to the emergency stop and to commands."""
        super().setup(parameters)
        self._stop = StopInput(self)
        self._commands = CommandServices(self, self.stage, self._stop, self._holders)
        self._crtk = CrtkSlave(self, self.stage)
        self._measured_cp = self.ports.output(SLAVE_MEASURED_CP)
        self._told_state = int(State.DISABLED)

    def teardown(self) -> None:
        """Close what :meth:`setup` opened."""
        self._stop.close()
        self._commands.close()
        self._crtk.close()
        super().teardown()

    def start(self) -> None:
        """Store the offset between the clocks, so that later steps of the system clock are detected."""
        super().start()
        self._is_told = self._is_ready = False
        self._offset_ns, self._turns, self._floods = self.epoch_ns, 0, 0
        self._seen, self._missed = self.counts, self.counts.missed

    def take(self) -> None:
        """Read the newest command and the arm's samples; look for faults."""
        self._is_ready, self._before_ns = self._is_told, self.row["slave_setpoint_js_ns"]
        if self._is_ready:
            self._look()
            super().take()
            return
        self.read_ports()
        self._is_told = self.input(SLAVE_MEASURED_JS).stamp_ns is not None
        self._seen, self._missed = self.counts, self.counts.missed

    def step(self, tick_ns: int) -> None:
        """Make the step of one tick [ns, monotonic], if the position of the arm is known."""
        if not self._is_ready:
            return
        super().step(tick_ns)
        stamp_ns = self.row["slave_setpoint_js_ns"]
        if stamp_ns != self._before_ns:
            self.delay.put(self.platform.time_ns() - stamp_ns)

    def read_ports(self, trigger: Topic | None = None) -> None:
        """Update the signals, and answer every sample of the arm.

        The next step answers the newest sample. If several samples came meanwhile, this method answers the older
        samples. After a standstill of the loop, the stop has priority: only the last of the queued samples are
        answered.
        """
        measured, *others = self.ports.inputs[SLAVE_MEASURED_JS.name]
        if others or not self._is_told:
            super().read_ports(trigger)
            return
        super().read_ports(SLAVE_MEASURED_JS)
        row, name, waiting = self.row, SLAVE_MEASURED_JS.field, []
        while measured.take():
            row[f"{name}_ns"] = measured.stamp_ns
            waiting.append((row[name].copy(), row[f"{name}_ns"]))
        for values, stamp_ns in waiting[-_ANSWERS:-1]:
            row[name] = values
            self.stage.answer_measured()
            self.ports.send_one(self._measured_cp, stamp_ns)
        if len(waiting) > 1:
            row[name] = waiting[-1][0]

    def advance(self, now_ns: int) -> None:
        """Read the emergency stop, then make one step. Several late steps also read the stop before each step."""
        with self.lock:  # locked for both: a reset in between would treat a silent button as released
            is_idle = self._state[0] == _DISABLED
            for is_pressed in self._stop.take(now_ns, is_idle=is_idle):
                heard_ns = self._stop.heard_ns
                self.stage.press(is_pressed=is_pressed, heard_ns=now_ns if heard_ns is None else heard_ns)
            self.stage.step()

    def _look(self) -> None:
        """Detect faults that only a node can detect."""
        longest, counts = self.parameters.operation.longest_outage, self.counts
        # In a composed session, the ticks of one late wake-up come one by one; only the tick counts show how many were
        # missed.
        missed = (counts.missed - self._missed) * TICK_NS * 1e-9 if counts is self._seen else 0.0
        self._seen, self._missed = counts, counts.missed
        if 0.0 < longest < missed:
            self._fail(Fault.STALL, missed, longest)
        if self._stop.has_new:
            self._stop.has_new = False
            self.ros.defer(self._stop.learn)
        self._turns += 1
        if self._turns % _SELDOM == 0:
            self._look_around()

    def _look_around(self) -> None:
        """Detect a stepped clock, and a second publisher of commands."""
        offset_ns = self.platform.time_ns() - self.platform.monotonic_ns()
        if abs(offset_ns - self._offset_ns) > _CLOCK_STEP_NS:
            step = 1e-9 * (offset_ns - self._offset_ns)
            self._offset_ns = offset_ns
            self._fail(Fault.CLOCK, abs(step), 1e-9 * _CLOCK_STEP_NS)
        self._relate_anew(offset_ns)
        self.stage.state["ahead_ns"] = self.epoch_ns - offset_ns
        commands = self.ports.inputs[_SERVO]
        if any(entry.conflict for entry in commands):
            self._fail(Fault.PUBLISHERS)
        floods = sum(entry.refused[Refusal.FLOOD] for entry in commands)
        if floods > self._floods:
            self._floods = floods
            self._fail(Fault.FLOOD)

    def _relate_anew(self, offset_ns: int) -> None:
        """Use the current clock offset if the clock was behind at the start.

        Otherwise commands would seem to come from the future.
        """
        stamp_ns, now_ns = int(self.row["slave_servo_jp_ns"]), int(self.row["now_ns"])
        behind_ns = offset_ns - self.epoch_ns
        if stamp_ns - now_ns > SECOND_NS > abs(stamp_ns - now_ns - behind_ns):
            self.epoch_ns = offset_ns
            self._fail(Fault.CLOCK, 1e-9 * behind_ns, 1e-9 * _CLOCK_STEP_NS)

    def _holders(self) -> tuple[bytes, ...]:
        """Stop buttons that are pressed or missing."""
        heartbeat_ns = round(self.parameters.operation.heartbeat * SECOND_NS)
        since_ns = int(self.row["now_ns"]) - heartbeat_ns if heartbeat_ns else 0
        return self._stop.holders(since_ns)

    def _fail(self, fault: Fault, value: float = 0.0, bound: float = 0.0) -> None:
        with self.lock:
            self.stage.fail(fault, value, bound)

    def send_report(self, stamp_ns: int) -> None:
        """Report the operation when it changes, and log changes that matter to users."""
        before = self._reported
        super().send_report(stamp_ns)
        if self._reported is not before:
            self._crtk.note(stamp_ns)
        state = int(self._state[0])
        if state != self._told_state:
            self._told_state = state
            text = operation_text(self.stage.operation, self.stage.robot.joint_names)
            # A log line takes milliseconds, too long for the loop.
            self.ros.defer(self._tell, text, state == State.FAULT)

    def _tell(self, text: str, is_bad: bool) -> None:
        log = self.ros.get_logger()
        log.error(text) if is_bad else log.info(text)

    def concerns(self) -> list[str]:
        """Texts with the reasons why the arm does not move, and about stop buttons that send nothing."""
        return [*self._standstills(), *self._unknown_buttons()]

    def _unknown_buttons(self) -> list[str]:
        unheard = self._stop.unheard()
        if not unheard:
            return []
        return [f"{unheard} has not sent its state and counts as pressed: press and release it"]

    def _standstills(self) -> list[str]:
        if not self._is_told:
            return ["waits for slave/measured_js: the position of the arm is unknown"]
        status, values = CommandStatus(self.row["command_status"]), self.stage.operation
        if status is CommandStatus.CLOSED or values["fault"] > 0.0:
            return [operation_text(values, self.stage.robot.joint_names)]
        if status is CommandStatus.MOVING:
            is_homing = self.stage.motion.source == "home"
            return ["moves to its start position, then follows"] if is_homing else []
        return self._silences(status)

    def _silences(self, status: CommandStatus) -> list[str]:
        measured_js = self.input(SLAVE_MEASURED_JS)
        if status is CommandStatus.BLIND:
            return [f"no slave/measured_js for {measured_js.age():.1f} s: holds"]
        servo_jp = self.input(SLAVE_SERVO_JP)
        if servo_jp.stamp_ns is None:
            return ["waits for slave/servo_jp and holds"]
        if status is CommandStatus.STALE:
            return [f"no slave/servo_jp for {servo_jp.age():.1f} s: holds"]
        return [self._refusal()] if status is CommandStatus.REFUSED else []

    def _refusal(self) -> str:
        """Text with the reason why the newest ``slave/servo_jp`` was refused."""
        stamp_ns, now_ns = int(self.row["slave_servo_jp_ns"]), int(self.row["now_ns"])
        if (aged := self.stage.motion.refusal_of_age(stamp_ns, now_ns)) is not None:
            return f"slave/servo_jp {aged[1]}: holds"
        leader = Leader(int(self.stage.state["leader"]))
        if leader not in {Leader.NOBODY, Leader.SERVO_JP}:
            return f"slave/servo_jp is refused beside {leader.command}"
        return "slave/servo_jp jumped: holds"

    def values(self) -> dict[str, str]:
        """State, the command that moves the arm, and the number of refused commands."""
        text = operation_text(self.stage.operation, self.stage.robot.joint_names)
        jumped = {"refused.slave/servo_jp.jump": str(self.stage.refused)}
        lost = {"stop_messages_lost": str(self._stop.lost)}
        if holders := self._holders():
            lost["stop_pressed_by"] = self._stop.names(holders)
        return {**jumped, **lost, "operation": text, **self._crtk.values()}
