"""Visits: kinds of sessions beside the plain one, and a program that uses them as clients, displays and supervisors do.

The program sends commands of CRTK, calls services, changes parameters and states of nodes, reads topics for a while and
presses a stop, at random times and with random values, some of which are refused. A person's poses come from it too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from teleop_core.bags.layouts import layout
from teleop_core.bags.markers import MARKERS
from teleop_core.base.errors import SessionError
from teleop_core.base.parameters import Value, values_of
from teleop_core.graph.graph import RECORDER_NAME
from teleop_core.graph.topics import (
    DIAGNOSTICS,
    MASTER_SERVO_CF,
    OPERATOR_BUTTONS,
    OPERATOR_JAW,
    OPERATOR_SERVO_CP,
    SLAVE_MEASURED_CF,
    SLAVE_OPERATION,
    STREAMS,
    Kind,
    Topic,
)  # fmt: skip
from teleop_core.nodes.crtk import SINGLE, STATE_COMMAND, STREAMED, is_installed
from teleop_core.nodes.crtk_slave import BODY_CF, GOAL_CP, GOAL_JS, MEASURED_CV, SPATIAL_CF
from teleop_core.nodes.remote_control import RemoteControl
from teleop_core.nodes.streams import message_type
from teleop_core.session.configuration import Configuration
from teleop_core.slave.operation.states import COMMANDS
from teleop_drill.drill import hand
from teleop_drill.simulation.platform import SimulatedPlatform

PLAIN = "plain"
"""Session without visits."""


@dataclass(frozen=True)
class SessionKind:
    """Kind of session.

    Attributes:
        scenario: Scenario that is run.
        texts: Values of parameters.
        has_circle: Whether the hand moves on the circle of the drill.
        is_visited: Whether the program of this module runs beside it.
        cost: Processor time beside that of a plain session; a search runs it so much less often.
    """

    scenario: str = "free_motion"
    texts: tuple[str, ...] = ()
    has_circle: bool = True
    is_visited: bool = True
    cost: float = 1.0


_SCRIPT = "pause@6, resume@7, stop@9, reset@9.5, enable@9.6"
SESSIONS = {
    PLAIN: SessionKind(is_visited=False),
    "visited": SessionKind(),
    "network": SessionKind(texts=("teleop.stages=[network,display]", "network.there.least_delay=0.05")),
    "task": SessionKind("point", (f"slave.operation.events=[{_SCRIPT}]",), has_circle=False),
    "pair": SessionKind("uva_board", has_circle=False, cost=5.0),
    "person": SessionKind(texts=("operator.kind=remote", "slave.start_speed=1.0"), has_circle=False),
}
"""Kinds of sessions, by name."""
_PERIOD = 0.02  # time between two poses of a person [s]
_REST = 0.03  # mean time between two actions [s]
_ARM = ("move_jp", "move_jr", "interpolate_jp", "servo_jr", "servo_jv")
_TIP = ("move_cp", "interpolate_cp")  # the faults `intruder` and `garbage` send streams beside the session's own
_READ = (*STREAMS, GOAL_JS, GOAL_CP, MEASURED_CV, BODY_CF, SPATIAL_CF, MARKERS)
_OTHERWISE = (
    SLAVE_MEASURED_CF, OPERATOR_SERVO_CP, MASTER_SERVO_CF, SLAVE_OPERATION, DIAGNOSTICS,
)  # fmt: skip
_AGAIN_NS = 300_000_000  # time between two tries to bring the master back [ns]
_RECORDER = ("start", "stop", "split", "mark")
_JOINTS = tuple(f"other_{k}" for k in range(6))


class Visitor:
    """The program; one process runs it until it is killed.

    Args:
        platform: Platform of its process.
        configuration: The session.

    Attributes:
        may_act: Whether it does more than a person's hand does.
    """

    def __init__(self, platform: SimulatedPlatform, configuration: Configuration) -> None:
        self._platform, self._configuration = platform, configuration
        self._random = platform.process.machine.scheduler.random("visitor")
        self._node, self._executor = platform.node("visitor"), platform.executor()
        self._executor.add_node(self._node)
        self._publishers: dict[str, Any] = {}
        self._members = [member.name for member in configuration.graph.members]
        self._subscriptions: list[Any] = []
        self.may_act = False
        if configuration.groups["operator"].kind.kind == "remote":
            self._begin_ns = platform.monotonic_ns()
            self._node.create_timer(_PERIOD, self._lead)

    def run(self) -> int:
        """Act until the process is killed."""
        acts = (
            (self._move, 6), (self._tell, 3), (self._ask, 4), (self._tune, 4), (self._cycle, 1), (self._read, 4),
            (self._leave, 2), (self._press, 0.3), (self._send_otherwise, 3),
        )  # fmt: skip
        monotonic_ns, next_ns = self._platform.monotonic_ns, 0
        while True:
            self.listen()
            if not self.may_act and next_ns and monotonic_ns() >= next_ns:
                next_ns = monotonic_ns() + _AGAIN_NS
                self._enable_master()
            if self.may_act and monotonic_ns() >= next_ns:
                next_ns = monotonic_ns() + round(1e9 * self._random.expovariate(1.0 / _REST))
                (act,) = self._random.choices([one for one, _ in acts], [weight for _, weight in acts])
                act()

    def listen(self) -> None:
        """Answer what comes, or wait a moment."""
        try:
            self._executor.spin_once(timeout_sec=0.5 * _REST)
        except Exception as error:  # it reads the messages that it sends, and some of them cannot be read
            if "deserialize" not in str(error):
                raise

    def change(self, member: str, labels: Sequence[str]) -> None:
        """Ask a node for changes of its state, one after the other."""
        client = self._node.create_client(ChangeState, f"/{member}/change_state")
        for label in labels:
            request = ChangeState.Request()
            request.transition.label = label
            client.call_async(request)

    def _enable_master(self) -> None:
        """Bring the master back, as an operator does who finds that the program has disabled it."""
        if is_installed():
            for word in ("reset", "enable"):
                self._publish("master/state_command", STATE_COMMAND, message_type(STATE_COMMAND)(string=word))

    # -- what a hand and a client do -------------------------------------------------------------

    def _lead(self) -> None:
        """Lead the stylus on the circle of the drill, and press a button now and then."""
        pose = hand.circle(1e-9 * (self._platform.monotonic_ns() - self._begin_ns))
        self._encode(OPERATOR_SERVO_CP, pose)
        if self.may_act and self._random.random() < 0.02:
            self._encode(OPERATOR_BUTTONS, [float(self._random.random() < 0.3)])
            self._encode(OPERATOR_JAW, [self._random.random()])

    def _encode(self, topic: Topic, values: Any) -> None:
        """Send values, then zeros, on a topic."""
        form = layout(topic, _JOINTS if topic.kind is Kind.JOINTS else ())
        whole = np.zeros(form.width)
        whole[: len(values)] = values
        self._publish(topic.name, topic.kind.ros_type, form.encode_one(self._platform.time_ns(), whole))

    def _publish(self, name: str, kind: str, message: Any) -> None:
        if name not in self._publishers:
            self._publishers[name] = self._node.create_publisher(message_type(kind), f"/{name}", SINGLE)
        self._publishers[name].publish(message)

    def _move(self) -> None:
        """Send a command of CRTK: near, far, of a wrong length or no number."""
        random, name = self._random, self._random.choice((*_ARM, *_TIP, "servo_cv", "hold"))
        values = [0.3 * random.uniform(-1.0, 1.0) for _ in range(random.choice((6, 6, 6, 5)))]
        values[0] = random.choice((values[0], values[0], math.nan, 1e9))
        if name in _ARM:
            message: Any = JointState(velocity=values) if name == "servo_jv" else JointState(position=values)
        elif name in _TIP:
            message = PoseStamped()
            p, q = message.pose.position, message.pose.orientation
            p.x, p.y, p.z = 0.3 + 0.1 * values[0], 0.1 * values[1], -0.2 + 0.1 * values[2]
            q.w = random.choice((1.0, 0.9))
        elif name == "servo_cv":
            message = TwistStamped()
            message.twist.linear.x, message.twist.angular.z = values[:2]
        else:
            message = Empty()
        if random.random() < 0.3 and hasattr(message, "header"):
            message.header.stamp.sec = random.choice((1, 2**30))
        package, kind = type(message).__module__.partition(".")[0], type(message).__name__
        self._publish(f"slave/{name}", f"{package}/msg/{kind}", message)

    def _tell(self) -> None:
        """Send a command of state, or a word that is none."""
        if is_installed():
            message = message_type(STATE_COMMAND)(string=self._random.choice((*COMMANDS, "dance")))
            self._publish(f"{self._random.choice(('slave', 'master'))}/state_command", STATE_COMMAND, message)

    def _ask(self) -> None:
        """Call a service of the recorder or of the arm."""
        name = self._random.choice((*(f"recorder/{one}" for one in _RECORDER), *(f"slave/{one}" for one in COMMANDS)))
        self._node.create_client(Trigger, f"/{name}").call_async(Trigger.Request())

    # -- what a supervisor does ------------------------------------------------------------------

    def _tune(self) -> None:
        """Set a parameter of a node to a value near the present one, out of bounds, or of another type."""
        member = self._random.choice(self._members)
        known = list(values_of(self._configuration.groups[member]).items())
        if not known:
            return
        name, value = self._random.choice(known)
        if self._random.random() < 0.3:
            value = self._random.choice((1e12, -1e12, "wrong", True))
        elif isinstance(value, float) and member.rpartition("/")[2] in {"motion_scaling", "network", "display"}:
            value *= self._random.uniform(0.9, 1.1)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=_value_of(value))])
        self._node.create_client(SetParameters, f"/{member}/set_parameters").call_async(request)

    def _cycle(self) -> None:
        """Let a node go through its states; the arm stays at work, for an operator would bring it back."""
        members = [one for one in self._members if one.rpartition("/")[2] not in {"slave", "slave_sim"}]
        labels = ("deactivate", "activate"), ("deactivate", "cleanup", "configure", "activate")
        self.change(self._random.choice((*members, RECORDER_NAME)), self._random.choice(labels))

    def _press(self) -> None:
        """Stop all arms as ``teleop stop`` does, and let them go on."""
        remote = RemoteControl(0, patience=1.0, platform=self._platform)
        try:
            remote.stop()
            remote.command("release")
            remote.go_on()
        except SessionError:  # the arm is dead or stands still
            pass
        finally:
            remote.close()

    # -- what a display does ---------------------------------------------------------------------

    def _read(self) -> None:
        """Read a topic from now on."""
        topic = self._random.choice(_READ)
        kind = message_type(topic.kind.ros_type)
        self._subscriptions.append(self._node.create_subscription(kind, f"/{topic.name}", _ignore, STREAMED))

    def _leave(self) -> None:
        """Read one topic less."""
        if self._subscriptions:
            self._node.destroy(self._subscriptions.pop(self._random.randrange(len(self._subscriptions))))

    def _send_otherwise(self) -> None:
        """Send a message of another form on a topic of the session: another frame, no or a large number, any bytes."""
        topic = self._random.choice(_OTHERWISE)
        if self._random.random() < 0.3 or topic.kind is Kind.REPORT:
            data = self._random.randbytes(self._random.choice((0, 5, 200)))
            self._publish(topic.name, topic.kind.ros_type, data)
            return
        topic = replace(topic, frame_id=self._random.choice(("elsewhere", topic.frame_id)))
        self._encode(topic, [self._random.choice((0.0, 1e3, math.nan))])


def _ignore(_: object) -> None:
    """Do nothing with a message."""


def _value_of(value: Value) -> ParameterValue:
    """A value as a message."""
    kinds: tuple[tuple[type, int, str], ...] = (
        (bool, ParameterType.PARAMETER_BOOL, "bool_value"),
        (int, ParameterType.PARAMETER_INTEGER, "integer_value"),
        (float, ParameterType.PARAMETER_DOUBLE, "double_value"),
        (str, ParameterType.PARAMETER_STRING, "string_value"),
    )
    for kind, number, name in kinds:
        if isinstance(value, kind):
            return ParameterValue(type=number, **{name: value})
    return ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=[])
