"""Rig of a drill: all actions on the topics and the processes of a running session."""

import re
import signal
from collections.abc import Callable
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from teleop_core.bags.messages import layout
from teleop_core.graph.operation import State
from teleop_core.graph.topics import SLAVE_MEASURED_JS, SLAVE_OPERATION, SLAVE_SETPOINT_JS, TELEOP_STATE, Topic
from teleop_core.kernels.geometry import Array
from teleop_core.middleware.platform import Qos
from teleop_core.middleware.ros_parameters import to_message
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.observer import WARNING, ReportReader
from teleop_core.nodes.operation import RELEASE, STOP_TOPIC
from teleop_core.nodes.streams import message_type, profile
from teleop_core.robots.robot import Robot
from teleop_core.session.configuration import Configuration
from teleop_core.slave.operation.states import COMMANDS
from teleop_drill.drill import measure
from teleop_drill.drill.exercise import Master
from teleop_drill.drill.hand import Distortion
from teleop_drill.nodes.drill_site import SessionProcesses, Site
from teleop_drill.nodes.drill_tap import Tap

_NUMBERS = re.compile(r"[-+]?[0-9][0-9.e]*")
_SLAVE = ("slave", "slave_sim")
_TEXTS = ("operation.reported",)
_PERIOD_NS = 1_000_000_000  # period of reports; reports that come later than this describe the time after the fault
_ANSWER = 3.0  # longest wait for the answer of a service [s]
_FOUND = 3.0  # longest wait for discovery [s]
_DRIVE_PERIOD = 0.01
_FRESH = 0.3  # an older setpoint does not come from a running slave [s]


class LiveRig:
    """A session of processes, together with the drill's own nodes.

    Args:
        site: Site of the session.
        configuration: Configuration of the session.
        robot: The slave.
    """

    def __init__(self, site: Site, configuration: Configuration, robot: Robot) -> None:
        assert robot.drives is not None
        self.site = site
        self.is_composed, self._robot, platform = site.is_composed, robot, site.platform
        self._platform, domain = platform, site.domain
        self._speed_limit = np.array(robot.drives.speed_limit)
        self._control = site.control
        self.observer = ReportReader(domain, platform=platform)
        self.session: SessionProcesses = site.session(self.observer)
        self._node, self._own = Guest("drill", domain, platform), Guest("drill_hand", domain, platform)
        self._executor = self._node.platform.executor()
        self._executor.add_node(self._node.ros)
        # The buttons are latched, because the slave treats a button without latched state as pressed until its first
        # message. They are created long before a press, because a message during the discovery between button and
        # slave arrives a tenth of a second late.
        self._buttons = [
            self._node.ros.create_publisher(Bool, STOP_TOPIC, Qos(depth=100, is_latched=True)) for _ in range(2)
        ]
        self._speeds = self._node.ros.create_publisher(JointState, "/slave/servo_jv", Qos())
        self._services = {
            name: self._node.ros.create_client(Trigger, f"/slave/{name}") for name in (*COMMANDS, RELEASE)
        }
        self._settings = {
            node: self._node.ros.create_client(SetParameters, f"/{node}/set_parameters") for node in _SLAVE
        }
        self._intruders: dict[str, Any] = {}
        self.begin_ns, self.warned, self.said = 0, dict[str, int](), ""
        self.woken_ns, self._warned_before = 0, dict[str, str]()
        self.tap = Tap(
            self._own, robot.joint_names, configuration.session.real_time, has_hand=site.master is Master.DRILL
        )

    def close(self) -> None:
        """End the processes, and close the drill's own nodes."""
        try:
            self.session.close()
        finally:
            self.tap.close()
            self.observer.close()
            self._executor.shutdown()
            self._node.close()
            self._own.close()

    # -- what is seen ----------------------------------------------------------------------------

    def mark(self) -> None:
        """Declare that the fault begins now."""
        self.begin_ns, self.warned, self.said = self._platform.time_ns(), {}, ""
        self._warned_before = self._warnings()

    def _warnings(self) -> dict[str, str]:
        """Present warnings of each node; numbers are removed, because they change with every report."""
        told = self.observer.statuses.items()
        return {n: _NUMBERS.sub("", s.message) for n, s in told if s.level >= WARNING}

    def await_calm(self, seconds: float) -> None:
        """Wait until no node warns, for at most a time [s]; a warning that stands hides a new one of the same text."""
        deadline = self.now() + seconds
        while self._warnings() and self.now() < deadline:
            self.wait(0.05)

    def note(self, text: str) -> None:
        """Add a note, which the table shows beside the state."""
        self.said = text

    def now_ns(self) -> int:
        """Time [ns]."""
        return self._platform.time_ns()

    def now(self) -> float:
        """Time of a monotonic clock [s]."""
        return 1e-9 * self._platform.monotonic_ns()

    def wait(self, seconds: float) -> None:
        """Wait for a time [s]; new warnings of nodes are stored with their time."""
        deadline = self.now() + seconds
        while (left := deadline - self.now()) > 0.0:
            self.site.interrupt.check()
            self.observer.listen(min(left, 0.02))
            for name, text in self._warnings().items():
                arrival = self.observer.statuses[name].arrival
                arrival_ns = self._platform.time_ns() - round(1e9 * (self.now() - arrival))
                is_new = self._warned_before.get(name) != text
                if name not in self.warned and (is_new or arrival_ns > self.begin_ns + _PERIOD_NS):
                    self.warned[name] = arrival_ns

    def setpoint(self) -> Array:
        """Newest joint setpoint (n,) of the slave [rad or m]."""
        rows = self.tap.recent(SLAVE_SETPOINT_JS, 1)
        return np.array(rows[-1] if len(rows) else self._robot.home)

    def way_to_limit(self) -> tuple[Array, float]:
        """Displacement (n,) to the nearer limit of the joint that moves the tip least [rad or m].

        Also returns the resulting displacement of the tip, by its initial speed [m].
        """
        q, robot = self.setpoint(), self._robot
        up, down = robot.upper - q, robot.lower - q
        ways = np.where(up < -down, up, down)
        moved = np.linalg.norm(robot.jacobian(q)[:3], axis=0) * np.abs(ways)
        fastest = np.abs(ways) / np.array(robot.drives.speed_limit)  # type: ignore[union-attr]
        joint = int(np.argmin(moved + fastest))
        return np.where(np.arange(robot.n) == joint, ways, 0.0), float(moved[joint])

    def drive(self, speeds: Array, seconds: float, *, is_named: bool = False) -> None:
        """Drive the joints (n,) at speeds [rad/s or m/s] for a time [s], as a CRTK client does.

        With ``is_named`` the messages name the joints, and begin with the second one.
        """
        message = JointState(velocity=speeds.tolist())
        if is_named:
            order = np.roll(np.arange(self._robot.n), -1)
            names = [self._robot.joint_names[i] for i in order]
            message = JointState(name=names, velocity=speeds[order].tolist())
        deadline = self.now() + seconds
        while self.now() < deadline:
            self._speeds.publish(message)
            self.wait(_DRIVE_PERIOD)

    def operation(self) -> dict[str, float]:
        """Newest report of the slave's operation; empty before the first report."""
        reports = self.tap.reports(SLAVE_OPERATION)
        return reports[-1][1] if reports else {}

    def is_following(self) -> bool:
        """Whether the slave runs, is enabled and homed, and its arm follows the hand.

        Motion alone is no proof: an arm that slowly catches up, or that another client drives, also moves without
        following the hand.
        """
        operation, told = self.operation(), self.tap.reports(TELEOP_STATE)
        if told and not told[-1][1]["is_following"]:
            return False
        if not operation or operation["state"] != State.ENABLED or operation["is_busy"]:
            return False
        if self.tap.age(SLAVE_SETPOINT_JS) > _FRESH or not self.session.is_running("slave"):
            return False
        if not self.tap.is_commanded():
            return False
        return measure.follows(*self._recent_joints(), self._speed_limit)

    def _recent_joints(self) -> tuple[Array, Array]:
        """The newest setpoints and the newest measured positions of the joints [rad or m]."""
        topics, n = (SLAVE_SETPOINT_JS, SLAVE_MEASURED_JS), self._robot.n
        wanted, measured = (self.tap.recent(topic, 60)[:, :n] for topic in topics)
        return wanted, measured

    def complaints(self) -> str:
        """Warnings and errors of the nodes, in one line."""
        age = self.tap.age(SLAVE_SETPOINT_JS)
        told = [f"{n}: {s.message}" for n, s in self.observer.statuses.items()]
        moved, went = (int(np.sum(np.any(np.diff(rows, axis=0) != 0.0, axis=1))) for rows in self._recent_joints())
        seen = f"newest setpoint {age:.2f} s old, {moved} of the last 60 moved, the arm in {went}"
        return "; ".join((f"{seen}; {self.operation()}", *told))

    # -- processes -------------------------------------------------------------------------------

    def kill(self, node: str) -> None:
        """Kill a node's process."""
        self.mark()
        self.session.send(node, signal.SIGKILL)
        self.session.await_end(node, 2.0)

    def written(self) -> int:
        """Bytes of the present recording that have reached the disk."""
        return sum(file.stat().st_size for file in self.session.recordings[-1].glob("*.mcap"))

    def freeze(self, node: str, seconds: float, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Stop a node's process for a time [s], call `meanwhile` during the stop, then continue the process."""
        self.mark()
        self.session.send(node, signal.SIGSTOP)
        begin = self.now()
        try:
            meanwhile()
            self.wait(seconds - (self.now() - begin))
        finally:
            if self.is_composed or node in _SLAVE:
                self.woken_ns = self._platform.time_ns()
            self.session.send(node, signal.SIGCONT)

    def limit_files(self, node: str, room: int | None) -> None:
        """Let files of a node's process grow by at most `room` bytes; None for no limit."""
        self.session.limit_files(node, room)

    def hog(self, seconds: float) -> None:
        """Keep all cores busy for a time [s]."""
        self.session.hog()
        try:
            self.wait(seconds)
        finally:
            self.session.relieve()

    def start_bystander(self) -> None:
        """Start a foreign ROS process that subscribes to all streams."""
        self.session.start_bystander()

    def kill_bystander(self) -> None:
        """Kill the foreign process."""
        self.session.kill_bystander()

    def control(self, word: int, offset_ns: int = 0) -> None:
        """Set what the drill's own stage does, and the error of all clocks [ns]."""
        self._control.write(word, offset_ns)

    # -- topics ----------------------------------------------------------------------------------

    def distort(self, distortion: Distortion) -> None:
        """Apply a distortion to the hand's samples before they are sent."""
        self.tap.distortion = distortion

    def mute_buttons(self, *, is_mute: bool) -> None:
        """Stop or restart the messages of the stylus's buttons."""
        self.tap.is_mute = is_mute

    def publish(self, topic: Topic, stamp_ns: int, values: Array) -> None:
        """Send one message as another publisher of the topic would."""
        form = layout(topic, self._robot.joint_names)
        self._intruder(topic).publish(form.encode_one(stamp_ns, values))

    def publish_bytes(self, topic: Topic, data: bytes) -> None:
        """Send bytes that are not a valid message, as another publisher of the topic would."""
        self._intruder(topic).publish(data)

    def leave(self, topic: Topic) -> None:
        """Close the other publisher of the topic."""
        publisher = self._intruders.pop(topic.name, None)
        if publisher is not None:
            self._own.ros.destroy(publisher)

    def _intruder(self, topic: Topic) -> Any:
        """Return another publisher of a topic as soon as it has a reader; at this time the fault begins."""
        if topic.name not in self._intruders:
            kind = message_type(topic.kind.ros_type)
            made = self._own.ros.create_publisher(kind, f"/{topic.name}", profile(topic))
            self._intruders[topic.name] = made
            is_first = len(self._intruders) == 1
            deadline = self.now() + _FOUND
            while made.get_subscription_count() == 0 and self.now() < deadline:
                self._platform.sleep(2e-3)
            if is_first:
                self.mark()
        return self._intruders[topic.name]

    def press(self, *, is_pressed: bool, button: int = 0) -> None:
        """Send a message of a stop button with the given number."""
        own, deadline = self._buttons[button], self.now() + _FOUND
        while own.get_subscription_count() == 0 and self.now() < deadline:
            self._platform.sleep(2e-3)
        if is_pressed:
            self.mark()
        own.publish(Bool(data=is_pressed))

    # -- services --------------------------------------------------------------------------------

    def command(self, name: str) -> bool:
        """Call a service of the slave; returns whether the command was done."""
        return self.commands(name)[0]

    def commands(self, *names: str) -> list[bool]:
        """Like :meth:`command`, for several commands, without waiting for the answers in between."""
        if not all(self._services[name].wait_for_service(_FOUND) for name in names):
            return [False] * len(names)
        asked = [self._services[name].call_async(Trigger.Request()) for name in names]
        found = [self._answer(one) for one in asked]
        return [one is not None and one.success for one in found]

    def set(self, node: str, name: str, value: object) -> bool:
        """Set a parameter of a running node; returns whether it was accepted."""
        kind = str if name in _TEXTS else float
        given = tuple(value) if isinstance(value, list) else value
        request = SetParameters.Request(parameters=[to_message(name, given, kind)])
        found = self._call(self._settings[node], request)
        return bool(found is not None and all(one.successful for one in found.results))

    def _call(self, client: Any, request: Any) -> Any:
        """Call a service and return its answer; None if the answer is late."""
        if not client.wait_for_service(_FOUND):
            return None
        return self._answer(client.call_async(request))

    def _answer(self, future: Any) -> Any:
        """Wait for the answer of a service; None if the answer is late."""
        deadline = self.now() + _ANSWER
        while not future.done() and (left := deadline - self.now()) > 0.0:
            self._executor.spin_once(left)
        return future.result() if future.done() else None
