"""Peer: a test's own node beside the nodes under test, on whatever platform they are."""

import warnings
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter

from live_process import has_recorded
from middleware_faults import MiddlewareLossError
from teleop_core.bags.messages import discover, layout
from teleop_core.base.parameters import specs
from teleop_core.graph.topics import Topic
from teleop_core.middleware.platform import Executor, Node, Owner, Platform, Qos
from teleop_core.nodes.observer import ReportReader
from teleop_core.nodes.quality import profile
from teleop_core.nodes.streams import Subscription, message_type
from teleop_core.robots import load_robot
from teleop_core.slave import slave_sim
from teleop_core.slave.parameters import SlaveParameters

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # its parser imports a deprecated module of Python
    import rosidl_generator_py  # noqa: F401

TIMEOUT = 90.0
JOINTS = load_robot("rcrt1").joint_names


class Listener:
    """What came on one topic since the test listens: stamps and values.

    The middleware keeps no more than 5000 messages for it; take some now and then.
    """

    def __init__(self, owner: Owner, topic: Topic) -> None:
        self.topic, self._subscription = topic, Subscription(owner, topic, topic.name, 5000)
        self._layout: Any = None
        self._number = self.lost = 0
        self.stamps: list[int] = []
        self.values: list[np.ndarray] = []

    def take(self) -> int:
        """Take what has come; returns how many there are in all."""
        while (taken := self._subscription.take()) is not None:
            if self._layout is None:
                self._layout = discover(self.topic.kind, taken.data)
            number = taken.number
            self.lost += number - self._number - 1 if 0 < self._number < number else 0
            self._number = number
            stamp_ns, values = self._layout.decode_one(taken.data)
            self.stamps.append(stamp_ns)
            self.values.append(values)
        return len(self.stamps)

    def insist_on_all(self) -> None:
        """Make sure that every sample came since the first one, of the one publisher there is.

        Raises:
            MiddlewareLossError: Some did not.
        """
        self.take()
        if self.lost:
            raise MiddlewareLossError(f"{self.lost} of {self.topic.name} on the way to the test")

    def forget(self) -> None:
        """Throw away what has come so far."""
        self.take()
        self.stamps, self.values = [], []


def at_rest(listener: Listener, count: int = 1000) -> Callable[[], object]:
    """Whether the tip has been at rest for so many samples, but for steps of its encoders."""

    def is_at_rest() -> bool:
        if listener.take() < count:
            return False
        last = np.array(listener.values[-count:])[:, :3]
        return np.ptp(last, axis=0).max() < 1e-4

    return is_at_rest


def _is_of_arm(key: str) -> bool:
    """Whether a parameter, with double underscores for dots, is that of a simulated arm alone."""
    name = key.replace("__", ".")
    mine, its = ({spec.name for spec in specs(g)} for g in (SlaveParameters, slave_sim.SlaveSimParameters))
    return name in its - mine


def _is_of_hand(key: str) -> bool:
    """Whether a parameter, with double underscores for dots, is that of the operator alone."""
    return key == "patience" or key.startswith(("operator__", "buttons__"))


class AnyPeer:
    """Node of a test beside the nodes under test.

    Attributes:
        platform: Where it is.
        ros: The node.
        executor: What serves it.
        observer: Who hears how nodes are.
        nodes: Processes that it has started.
    """

    platform: Platform
    ros: Node
    executor: Executor
    observer: ReportReader

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self._publishers: dict[str, Any] = {}

    def launch(self, name: str, parameters: dict[str, Any], arm: str, env: Mapping[str, str] | None) -> Any:
        """Process of a node with parameters."""
        raise NotImplementedError

    def until(self, condition: Callable[[], Any], what: str, timeout: float) -> Any:
        """Result of ``condition`` as soon as it is true; else raises AssertionError."""
        raise NotImplementedError

    # -- time ------------------------------------------------------------------------------------

    def now(self) -> float:
        """Time of a clock that never goes back [s]."""
        return 1e-9 * self.platform.monotonic_ns()

    def time_ns(self) -> int:
        """Time of the system's clock [ns]."""
        return self.platform.time_ns()

    def sleep(self, seconds: float) -> None:
        """Let time pass [s]: the rate of something, not a wait for it."""
        self.platform.sleep(seconds)

    # -- nodes -----------------------------------------------------------------------------------

    def wait(self, condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> Any:
        """Result of ``condition`` as soon as it is true.

        Raises:
            AssertionError: It did not become true; with what each node says.
        """
        try:
            return self.until(condition, what, timeout)
        except AssertionError as error:
            self.observer.listen(0.0)
            said = (f"{name}: {each.message}" for name, each in self.observer.statuses.items())
            raise AssertionError("\n".join([str(error), *said])) from error

    def start(
        self,
        name: str,
        wait: str = "active",
        arm: str = "",
        env: Mapping[str, str] | None = None,
        has_arm: bool = True,
        **parameters: Any,
    ) -> Any:
        """Start a node; double underscores in names stand for dots.

        A slave starts at home unless it is told otherwise, so that it follows at once. With one
        that is to work, its simulated arm is started, which gets the parameters that are its own,
        and with a haptic master the operator who holds it.
        """
        if name == "haptic_master":
            own = {key: parameters.pop(key) for key in set(parameters) if _is_of_hand(key)}
            if has_arm and parameters.get("autostart", True) and self._runs("operator", arm) is None:
                named = {key.removeprefix("operator__"): value for key, value in own.items()}
                self.start("operator", wait, arm=arm, env=env, **named)
        if name == "slave_sim" and not parameters and (running := self._runs(name, arm)):
            return running
        if name == "slave":
            own = {key: parameters.pop(key) for key in set(parameters) if _is_of_arm(key)}
            if has_arm and parameters.get("autostart", True) and self._runs("slave_sim", arm) is None:
                robot = {key: parameters[key] for key in ("robot",) if key in parameters}
                self.start("slave_sim", wait, arm=arm, env=env, **robot, **own)
            home = load_robot(parameters.get("robot", "rcrt1")).home.tolist()
            parameters = {"start": home} | parameters
        named = {key.replace("__", "."): value for key, value in parameters.items()}
        node = self.launch(name, named, arm, env)
        self.nodes.append(node)
        self.observer.statuses.pop(node.name, None)
        if wait:
            self.wait_state(node.name, wait)
        return node

    def _runs(self, stage: str, arm: str) -> Any:
        """Node of a stage in a namespace that runs."""
        name = f"{arm}/{stage}" if arm else stage
        found = (n for n in self.nodes if n.name == name and n.process.poll() is None)
        return next(found, None)

    def status(self, name: str) -> Any:
        """Newest report of a node; None before the first."""
        self.observer.listen(0.0)
        return self.observer.statuses.get(name)

    def wait_state(self, name: str, state: str) -> None:
        def reached() -> bool:
            for node in self.nodes:
                died = node.name == name and node is self._newest(name) and node.process.poll()
                assert not died or node.wait() == 0, node.stderr.read_text()
            status = self.status(name)
            return status is not None and status.values["state"] == state

        self.wait(reached, f"{name} {state}")

    def _newest(self, name: str) -> Any:
        return next(node for node in reversed(self.nodes) if node.name == name)

    def wait_value(self, name: str, key: str, accept: Callable[[float], bool]) -> float:
        """Number that a node reports under a key, once it is accepted."""

        def accepted() -> tuple[float] | None:
            status = self.status(name)
            number = status.number(key) if status else 0.0
            return (number,) if status and accept(number) else None

        return self.wait(accepted, f"{name} {key}")[0]

    def has_recorded(self, counts: Mapping[str, int], recorder: str = "recorder") -> bool:
        """Whether a recorder reports more samples than these of each topic."""
        return has_recorded(self.status(recorder), counts)

    def insist_on_all(self, recorder: str) -> None:
        """Make sure that the last report of a recorder knows of no sample that was lost.

        Raises:
            MiddlewareLossError: It does.
        """
        values = self.status(recorder).values
        lost = {key: n for key, n in values.items() if key.startswith("lost.") and n != "0"}
        if lost:
            raise MiddlewareLossError(f"{lost} on the way to {recorder}")

    # -- topics ----------------------------------------------------------------------------------

    def listen(self, topic: Topic) -> Listener:
        return Listener(self, topic)

    def publisher(self, topic: Topic, readers: int = 1) -> Any:
        """Publisher of a topic, once that many subscriptions are there."""
        if topic.name not in self._publishers:
            kind = message_type(topic.ros_type)
            quality = profile(topic) if readers else Qos()
            made = self.ros.create_publisher(kind, topic.name, quality)
            self._publishers[topic.name] = made
        own = self._publishers[topic.name]
        self.wait(lambda: own.get_subscription_count() >= readers, f"readers of {topic.name}")
        return own

    def send(self, topic: Topic, stamp_ns: int, values: Any, readers: int = 1) -> None:
        """Publish one message as our own nodes would, once that many subscriptions are there."""
        data = layout(topic, JOINTS).encode_one(stamp_ns, np.asarray(values, np.float64))
        self.publisher(topic, readers).publish(data)

    def feed(
        self,
        until: Callable[[], Any],
        what: str,
        fresh: Mapping[Topic, Any],
        still: Mapping[Topic, Any] = MappingProxyType({}),
        after: int | None = None,
    ) -> int:
        """Send samples until something is so: fresh ones a millisecond after the last, still ones of time 0.

        Args:
            until: What the wait is for, looked at after each turn.
            what: The same in words.
            fresh: Values by topic.
            still: Values by topic.
            after: Stamp before the first [ns]; None: the present time, in whole milliseconds.

        Returns:
            Stamp of the last [ns].
        """
        stamp = self.time_ns() // 1_000_000 * 1_000_000 if after is None else after

        def turn() -> Any:
            nonlocal stamp
            stamp += 1_000_000
            for values, at in ((still, 0), (fresh, stamp)):
                for topic, row in values.items():
                    self.send(topic, at, row)
            return until()

        self.wait(turn, what)
        return stamp

    def spin(self) -> Any:
        """Serve what has come for the test's own node; returns nothing, in front of an ``or``."""
        self.executor.spin_once(0.01)

    def slave_holds(self) -> bool:
        """Whether the slave says that it holds: for want of commands, or paused since."""
        message = self.status("slave").message
        return "holds" in message or "PAUSED" in message

    # -- services --------------------------------------------------------------------------------

    def call(self, service: Any, name: str, request: Any) -> Any:
        """Answer of a service."""
        client = self.ros.create_client(service, name)
        try:
            self.wait(client.service_is_ready, f"service {name}")
            future = client.call_async(request)
            self.wait(lambda: self.spin() or future.done(), f"answer from {name}")
            return future.result()
        finally:
            self.ros.destroy(client)

    def change(self, name: str, transition: int) -> bool:
        """Whether a node makes a transition of its lifecycle that is asked for by service."""
        request = ChangeState.Request(transition=Transition(id=transition))
        answer = self.call(ChangeState, f"/{name}/change_state", request)
        return bool(answer.success)

    def set(self, name: str, at_once: bool = False, **values: Any) -> list[Any]:
        """Results of setting parameters over the node's services."""
        messages: list[ParameterMessage] = [
            Parameter(key.replace("__", "."), value=value).to_parameter_msg() for key, value in values.items()
        ]
        if at_once:
            request = SetParametersAtomically.Request(parameters=messages)
            kind, service = SetParametersAtomically, "set_parameters_atomically"
            return [self.call(kind, f"/{name}/{service}", request).result]
        request = SetParameters.Request(parameters=messages)
        return self.call(SetParameters, f"/{name}/set_parameters", request).results  # type: ignore[no-any-return]
