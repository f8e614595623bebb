"""Stage: a session on a simulated machine, and the faults and commands that a schedule applies to it."""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import TwistStamped
from lifecycle_msgs.srv import ChangeState
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from teleop_core.bags.messages import read_numbers
from teleop_core.base.errors import SessionError
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.graph.operation import State
from teleop_core.graph.topics import OPERATION, SLAVE_OPERATION, TELEOP_STATE, Topic
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.platform import Qos, Taken
from teleop_core.nodes.crews import Processes, crews
from teleop_core.nodes.crtk import STATE_COMMAND
from teleop_core.nodes.observer import ReportReader
from teleop_core.nodes.operation import STOP_TOPIC
from teleop_core.nodes.streams import message_type
from teleop_core.robots import Robot
from teleop_core.session.configuration import Configuration
from teleop_core.slave.operation.faults import Fault as SlaveFault
from teleop_core.slave.operation.states import COMMANDS
from teleop_drill.drill.exercise import Master
from teleop_drill.simulation import sometimes
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.owner import stamp_of
from teleop_drill.simulation.platform import SimulatedPlatform
from teleop_drill.simulation.session import SimulatedSession

_FRESH_NS = 200_000_000
_OBEYED_NS = 10_000_000_000
"""Age of a command that an arm obeys no more, with some reserve [ns]."""


class DrilledSession:
    """A session, and the faults and commands applied to it; one process contains the whole drill.

    Args:
        bus: The middleware.
        owner: Process of the drill.
        configuration: Configuration of the session.
        robot: The slave.
        folder: Folder of the recordings.
        processes: Distribution of the nodes over processes.
    """

    def __init__(
        self,
        bus: Bus,
        owner: Process,
        configuration: Configuration,
        robot: Robot,
        folder: Path,
        processes: Processes = Processes.SIDES,
    ) -> None:
        self.bus, self.machine, self.robot = bus, owner.machine, robot
        self.platform = SimulatedPlatform(bus, owner)
        self._executor = self.platform.executor()
        self._node = self.platform.node("drill")
        self._executor.add_node(self._node)
        self.platform.thread("executor", self._spin).start()
        observer = ReportReader(0, platform=self.platform)
        shared = {name: nodes for crew in crews(configuration.graph, processes) for name, nodes in crew.items()}
        self.names = tuple(shared)
        self.session = SimulatedSession(bus, owner, configuration, shared, folder, observer, Master.DEVICE)
        self.killed: set[Process] = set()
        """Processes that were ordered to end."""
        self.kills = 0
        """Number of killed node processes."""
        self.lost_disk: set[Process] = set()
        """Processes that may end because their disk failed, if they report what they have saved."""
        self.stopped: list[tuple[Process, int]] = []
        """Processes that were stopped, each with the time [ns]."""
        self.presses: list[int] = []
        """Button of each press."""
        self.held: set[int] = set()
        """Buttons that are pressed."""
        self._buttons = [self._node.create_publisher(Bool, STOP_TOPIC, Qos(depth=100)) for _ in range(2)]
        self._speeds = self._node.create_publisher(JointState, "/slave/servo_jv", Qos())
        names = (*COMMANDS, sometimes.RELEASE)
        self._clients = {name: self._node.create_client(Trigger, f"/slave/{name}") for name in names}
        self._hand = self._node.create_client(ChangeState, "/inverse_kinematics/change_state")
        self._publishers: dict[str, Any] = {}
        self.sometimes: Counter[str] = Counter()
        """How often each event of :mod:`sometimes` was met."""
        self.is_alone, self.is_scripted = True, bool(configuration.groups["slave"].operation.events)
        """Whether nobody but the drill and the session sends commands, and whether the session does by itself."""
        self.asked: list[str] = []
        """Commands that were sent, in their order."""
        self.driven_ns = 0
        """Time at which a speed command that was not old was last sent [ns]."""
        self.killed_ns: dict[Process, int] = {}
        """Time at which processes were killed [ns]."""
        self.operation: dict[str, float] = {}
        """Newest report of the slave, by the names of its numbers."""
        self.is_following = False
        """Whether the motion scaling has reported that the slave follows."""
        self.setpoint: Array = robot.home
        """Newest setpoint of the joints (n,) [rad or m]."""
        self.commanded_ns = 0
        """Time at which a setpoint last followed a new command [ns]."""
        bus.seen[f"/{SLAVE_OPERATION.name}"] = self._note_operation
        bus.seen[f"/{TELEOP_STATE.name}"] = self._note_state
        bus.called |= {f"/slave/{name}": partial(self.asked.append, name) for name in names}
        bus.seen["/slave/state_command"] = self._note_command

    def _spin(self) -> None:
        while True:
            self._executor.spin_once()

    def _note_operation(self, taken: Taken) -> None:
        found = read_numbers(taken.data, OPERATION)
        if isinstance(found, tuple):
            before = self.operation.get("state")
            self.operation = told = dict(zip(OPERATION, found[1].tolist(), strict=True))
            if before is not None and before != told["state"]:
                self.sometimes[sometimes.change(State(int(before)), State(int(told["state"])))] += 1
            if fault := int(told["fault"]):
                self.sometimes[f"fault {SlaveFault(fault).word}"] += 1

    def _note_command(self, taken: Taken) -> None:
        """Note a command of CRTK, which is the last text of its message, unless it is too old to be obeyed."""
        stamp_ns = stamp_of(taken)
        if stamp_ns and abs(self.platform.time_ns() - stamp_ns) > _OBEYED_NS:
            return
        self.asked.append(taken.data.rstrip(b"\0").rpartition(b"\0")[2].decode("utf-8", "replace"))

    def _note_state(self, taken: Taken) -> None:
        found = read_numbers(taken.data, TELEOP_STATE.columns)
        if isinstance(found, tuple):
            self.is_following = found[1][0] > 0.0

    # -- what is done ----------------------------------------------------------------------------

    def process(self, name: str) -> Process:
        """Newest process of a name."""
        return self.session.running[name]

    def note_stop(self, process: Process) -> None:
        """Record that a process does not run from now on."""
        self.stopped.append((process, self.machine.scheduler.now_ns))

    def fail_disk(self, error: int) -> Callable[[], None]:
        """Let writes of the recorder fail with an error number; returns the function that repairs the disk."""
        process = self.process(RECORDER_NAME)
        process.disk_error = error
        self.lost_disk.add(process)
        return lambda: setattr(process, "disk_error", 0)

    def kill(self, name: str) -> None:
        """Kill a process."""
        process = self.process(name)
        self.sometimes[sometimes.AGAIN] += any(one.name == process.name for one in self.killed)
        self.killed.add(process)
        self.killed_ns[process] = self.machine.scheduler.now_ns
        self.kills += name != RECORDER_NAME
        process.end(-9, is_orderly=False)

    def restart(self, name: str) -> None:
        """Restart a process that has ended, as a supervisor does."""
        if self.process(name).is_dead:
            self.session.launch(name)

    def press(self, button: int, *, is_pressed: bool) -> None:
        """Send a message of a stop button, which reaches only discovered readers."""
        if is_pressed:
            self._note_press(button)
            self.presses.append(button)
            self.held.add(button)
        else:
            self.held.discard(button)
        self._buttons[button].publish(Bool(data=is_pressed))

    def _note_press(self, button: int) -> None:
        """Count in which moment a stop is pressed."""
        told, slave = self.operation, self.session.process_of("slave")
        found = None if slave is None else self.found(button, slave)
        is_homed, is_busy = told.get("is_homed", 0.0), told.get("is_busy", 0.0)
        self.sometimes[sometimes.WHILE_HOMING] += bool(is_busy and not is_homed)
        self.sometimes[sometimes.WHILE_BRAKING] += bool(is_busy and told.get("state") != State.ENABLED)
        self.sometimes[sometimes.BOTH_STOPS] += bool(self.held - {button})
        self.sometimes[sometimes.UNKNOWN_STOP] += found is None or found[1] > self.machine.scheduler.now_ns

    def found(self, button: int, slave: Process) -> tuple[int, int] | None:
        """Time at which a button and a slave have discovered each other [ns]; None before the slave listens."""
        links = self._buttons[button].links
        times = [(link.writer_knows_ns, link.reader_knows_ns) for link in links if link.reader.process is slave]
        return max(times, default=None)

    def command(self, name: str) -> None:
        """Send a request to the slave without waiting for the answer."""
        self.sometimes[sometimes.asked(name, self.state)] += 1
        self._clients[name].call_async(Trigger.Request())

    def lead(self, *, by_hand: bool) -> None:
        """Switch whether the hand's commands are sent to the arm, without waiting for the answer."""
        request = ChangeState.Request()
        request.transition.label = "activate" if by_hand else "deactivate"
        self._hand.call_async(request)

    def drive(self, speeds: Array, age_ns: int = 0) -> None:
        """Send speeds (n,) of the joints [rad/s or m/s], with a stamp of some age [ns]; 0: without a stamp."""
        message = JointState(velocity=speeds.tolist())
        if age_ns:
            self._stamp(message, age_ns)
        else:
            self.driven_ns = self.machine.scheduler.now_ns
        self._speeds.publish(message)

    def ask_again(self, names: Sequence[str], age_ns: int) -> None:
        """Send commands to the slave with a stamp of some age [ns], as a client whose messages come late."""
        for name in names:
            message = message_type(STATE_COMMAND)(string=name)
            self._stamp(message, age_ns)
            self._publisher("slave/state_command", type(message)).publish(message)

    def _stamp(self, message: Any, age_ns: int) -> None:
        stamp_ns = self.platform.time_ns() - age_ns
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)

    def drive_tip(self, speed: float) -> None:
        """Send a speed of the tip along all axes of the base [m/s]."""
        self.driven_ns = self.machine.scheduler.now_ns
        message = TwistStamped()
        message.twist.linear.x = message.twist.linear.y = message.twist.linear.z = speed
        self._publisher("slave/servo_cv", TwistStamped).publish(message)

    def publish(self, topic: Topic, data: bytes) -> None:
        """Send bytes on a topic, as an additional publisher."""
        self._publisher(topic.name, message_type(topic.kind.ros_type)).publish(data)

    def _publisher(self, name: str, kind: Any) -> Any:
        if name not in self._publishers:
            self._publishers[name] = self._node.create_publisher(kind, f"/{name}", Qos(depth=1))
        return self._publishers[name]

    @property
    def senders(self) -> set[bytes]:
        """Publishers of the drill, apart from its buttons and speeds."""
        return {one.sender for one in self._publishers.values()}

    def every(self, period: float, work: Callable[[], None]) -> Callable[[], None]:
        """Repeat an action with a period [s]; returns the function that ends it."""
        timer = self._node.create_timer(period, work)
        return timer.cancel

    # -- how it goes on --------------------------------------------------------------------------

    def help(self) -> None:
        """Send the commands that an operator would send in the arm's state."""
        if self.session.dead():
            with suppress(SessionError):  # the slave was killed again meanwhile; the next call starts it
                self.session.start()
            return
        told = self.operation
        state = told.get("state")
        if state == State.PAUSED:
            self.command("resume")
        elif state == State.FAULT:
            for button in self._buttons if told["is_pressed"] else ():  # a button without a message so far counts as
                # pressed
                button.publish(Bool(data=False))
            self.command("reset")
        elif state == State.DISABLED:
            self.command("enable")
        elif state == State.ENABLED and not told["is_homed"] and not told["is_busy"]:
            self.command("home")

    @property
    def state(self) -> str:
        """Name of the last reported state of the arm; :data:`~sometimes.NO_STATE` before the first report."""
        state = self.operation.get("state")
        return sometimes.NO_STATE if state is None else State(int(state)).name

    def follows(self) -> bool:
        """Whether the arm reports that it follows the hand."""
        told = self.operation
        return bool(
            not self.session.dead()
            and self.is_following
            and self.machine.scheduler.now_ns - self.commanded_ns < _FRESH_NS
            and told.get("state") == State.ENABLED
            and told["is_homed"]
            and not told["is_busy"]
        )

    @property
    def recorder(self) -> Process:
        """Newest process of the recorder."""
        return self.process(RECORDER_NAME)
