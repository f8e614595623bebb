"""Nodes of the simulated middleware: topics, services, timers, parameters, lifecycle, executors."""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameters, SetParameters

from teleop_core.base.parameters import Spec, Value
from teleop_core.middleware.ros_messages import read_message, write_message
from teleop_core.middleware.ros_parameters import from_message, to_message
from teleop_core.middleware.world import Endpoint, Hooks, Outcome, Qos
from teleop_drill.simulation.bus import Bus, Reader, Service, Writer
from teleop_drill.simulation.machine import Machine, Process, Said
from teleop_drill.simulation.scheduler import Strand

_STATES = {
    ("unconfigured", "configure"): "inactive",
    ("inactive", "activate"): "active",
    ("active", "deactivate"): "inactive",
    ("inactive", "cleanup"): "unconfigured",
    ("unconfigured", "shutdown"): "finalized",
    ("inactive", "shutdown"): "finalized",
    ("active", "shutdown"): "finalized",
}


class SimulatedExecutor:
    """As of :class:`~teleop_core.middleware.world.Executor`."""

    def __init__(self, machine: Machine) -> None:
        self._scheduler = machine.scheduler
        self._due: deque[Callable[[], object]] = deque()
        self._waiting: Strand | None = None

    def add_node(self, node: Any) -> None:
        """Serve a node too."""
        node.executor = self

    def post(self, work: Callable[[], object]) -> None:
        """Have something done in its turn."""
        self._due.append(work)
        self.wake()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Serve one thing, or none within the time [s]."""
        if not self._due:
            self._waiting = self._scheduler.current
            self._scheduler.wait(timeout_sec)
            self._waiting = None
        if self._due:
            self._due.popleft()()

    def wake(self) -> None:
        """Let :meth:`spin_once` return."""
        if self._waiting is not None:
            self._scheduler.wake(self._waiting)

    def shutdown(self) -> None:
        """Serve nothing any more."""
        self._due.clear()


class Timer:
    """As of :class:`~teleop_core.middleware.world.Timer`."""

    def __init__(self, node: "SimulatedNode", period: float, callback: Callable[[], None]) -> None:
        self._node, self._callback = node, callback
        self._period_ns, self._round = round(1e9 * period), 0
        self.reset()

    def cancel(self) -> None:
        """Pause."""
        self._round = -abs(self._round) - 1

    def reset(self) -> None:
        """Go on; the next call is one period from now."""
        self._round = abs(self._round) + 1
        self._arrange()

    def is_canceled(self) -> bool:
        """Whether it is paused."""
        return self._round < 0

    def _arrange(self) -> None:
        scheduler, own = self._node.machine.scheduler, self._round
        due_ns = scheduler.now_ns + self._period_ns
        scheduler.at(due_ns, lambda: self._node.post(partial(self._call, own)))

    def _call(self, own: int) -> None:
        if own == self._round and not self._node.process.is_dead:
            self._arrange()
            self._callback()


class Guard:
    """As of :class:`~teleop_core.middleware.world.Guard`."""

    def __init__(self, node: "SimulatedNode", callback: Callable[[], None]) -> None:
        self._node, self._callback, self._is_due = node, callback, False
        self.is_open = True

    def trigger(self) -> None:
        """Have the executor call soon, once for all triggers until then."""
        if not self._is_due:
            self._is_due = True
            self._node.post(self._call)

    def _call(self) -> None:
        self._is_due = False
        if self.is_open:
            self._callback()


class Answer:
    """What a service will have answered: the part of a future that callers use."""

    def __init__(self) -> None:
        self._told: list[Callable[[Answer], None]] = []
        self._value: Any = None
        self._is_done = False

    def done(self) -> bool:
        """Whether it has."""
        return self._is_done

    def result(self) -> Any:
        """What it was."""
        return self._value

    def add_done_callback(self, told: Callable[["Answer"], None]) -> None:
        """Have somebody told when it is there."""
        self._told.append(told)

    def set(self, value: Any) -> None:
        """It is there."""
        self._value, self._is_done = value, True
        for told in self._told:
            told(self)


class Client:
    """As of :class:`~teleop_core.middleware.world.Client`."""

    def __init__(self, node: "SimulatedNode", name: str) -> None:
        self._node, self.srv_name = node, name

    def service_is_ready(self) -> bool:
        """Whether the service was found."""
        bus = self._node.bus
        service = bus.services.get(self.srv_name)
        return service is not None and bus.knows(self._node.process, service)

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until the service is found; whether it was."""
        scheduler = self._node.machine.scheduler
        limit = float("inf") if timeout_sec is None else timeout_sec
        deadline_ns = scheduler.now_ns + 1e9 * limit
        while not self.service_is_ready():
            if scheduler.now_ns >= deadline_ns:
                return False
            scheduler.sleep(0.01)
        return True

    def call_async(self, request: Any) -> Answer:
        """Ask."""
        answer, bus, own = Answer(), self._node.bus, self._node.process
        service = bus.services.get(self.srv_name)
        if service is None:
            return answer

        def reply(response: Any) -> None:
            bus.call(service.process, own, lambda: self._node.post(lambda: answer.set(response)))

        bus.call(own, service.process, lambda: service.is_open and service.answer(request, reply))
        return answer

    def remove_pending_request(self, future: Any) -> None:
        """Wait for an answer no longer."""


class Log:
    """As of :class:`~teleop_core.middleware.world.Log`; kept by the machine."""

    def __init__(self, node: "SimulatedNode") -> None:
        self._node = node
        self.info = partial(self._say, "info")
        self.warning = partial(self._say, "warning")
        self.error = partial(self._say, "error")
        self.fatal = partial(self._say, "fatal")

    def _say(self, level: str, text: str, **_: object) -> None:
        machine = self._node.machine
        machine.log.append(Said(machine.scheduler.now_ns, self._node.full_name, level, text))


class SimulatedNode:
    """As of :class:`~teleop_core.middleware.world.Node`.

    Args:
        bus: Where it is.
        process: Whose it is.
        name: What it is called.
        namespace: Where its names are.
    """

    def __init__(
        self, bus: Bus, process: Process, name: str, namespace: str = "", **_: object
    ) -> None:
        self.bus, self.process, self.machine = bus, process, process.machine
        self._name, self._namespace = name, "/" + namespace.strip("/")
        self.executor: SimulatedExecutor | None = None
        self._log = Log(self)

    @property
    def full_name(self) -> str:
        """Name with the namespace and a slash before it."""
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def get_name(self) -> str:
        """Its name."""
        return self._name

    def get_namespace(self) -> str:
        """Its namespace, with a slash before it."""
        return self._namespace

    def get_logger(self) -> Log:
        """Its log."""
        return self._log

    def resolve_topic_name(self, name: str) -> str:
        """Full name of a topic."""
        if name.startswith("~"):
            return f"{self.full_name}{name[1:]}"
        return name if name.startswith("/") else f"{self._namespace.rstrip('/')}/{name}"

    def create_publisher(self, kind: Any, name: str, qos: Qos) -> Writer:
        """Publisher of messages of a class."""
        topic = self.resolve_topic_name(name)
        made = Writer(self.bus, self.process, self.full_name, topic, qos, write_message)
        return self.bus.open_writer(made)

    def create_taker(self, kind: Any, name: str, qos: Qos) -> Reader:
        """Subscription whose messages are taken by hand."""
        topic = self.resolve_topic_name(name)
        return self.bus.open_reader(
            Reader(self.bus, self.process, kind, topic, qos, self.full_name)
        )

    def create_subscription(
        self, kind: Any, name: str, callback: Callable[[Any], None], qos: Qos
    ) -> Reader:
        """Subscription whose messages the executor hands over."""
        reader = self.create_taker(kind, name, qos)

        def hand_over() -> None:
            if (taken := reader.take()) is not None:
                callback(read_message(taken.data, kind))

        reader.told = lambda: self.post(hand_over)
        return reader

    def create_service(self, kind: Any, name: str, callback: Callable[[Any, Any], Any]) -> Service:
        """Service that the executor answers."""

        def answer(request: Any, reply: Callable[[Any], None]) -> None:
            self.post(lambda: reply(callback(request, kind.Response())))

        made = Service(self.process, answer, self.machine.scheduler.now_ns)
        self.bus.services[self.resolve_topic_name(name)] = made
        return made

    def create_client(self, kind: Any, name: str) -> Client:
        """Client of a service."""
        return Client(self, self.resolve_topic_name(name))

    def create_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call again and again after a period [s]."""
        return Timer(self, period, callback)

    def create_guard_condition(self, callback: Callable[[], None]) -> Guard:
        """Call when it is triggered."""
        return Guard(self, callback)

    def destroy(self, entity: Any) -> None:
        """Withdraw what one of these methods has made."""
        if isinstance(entity, Writer):
            self.bus.leave_writer(entity)
        elif isinstance(entity, Reader):
            entity.close()
        elif isinstance(entity, Timer):
            entity.cancel()
        elif isinstance(entity, Service):
            entity.is_open = False
            for name in [n for n, one in self.bus.services.items() if one is entity]:
                del self.bus.services[name]
        elif isinstance(entity, Guard):
            entity.is_open = False

    def post(self, work: Callable[[], object]) -> None:
        """Have the executor do something in its turn; nothing without one."""
        if self.executor is not None and not self.process.is_dead:
            self.executor.post(work)

    def defer(self, work: Callable[..., object], *arguments: object) -> None:
        """Have the executor do something soon; nothing without one."""
        self.post(partial(work, *arguments))

    def count_publishers(self, name: str) -> int:
        """Publishers of a topic that were found."""
        return len(self.publishers(name))

    def publishers(self, name: str) -> list[Endpoint]:
        """The same, one by one."""
        return self.bus.publishers(self.process, self.resolve_topic_name(name))

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Topics that there are, without their types."""
        return [(name, ["simulated"]) for name in self.bus.topics()]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Services that there are, without their types."""
        return [(name, ["simulated"]) for name in sorted(self.bus.services)]

    def destroy_node(self) -> None:
        """Leave: the end of the process does the rest."""
        self.executor = None


class SimulatedLifecycleNode(SimulatedNode):
    """As of :class:`~teleop_core.middleware.world.LifecycleNode`.

    Args:
        bus: Where it is.
        process: Whose it is.
        name: What it is called.
        hooks: What it does in its transitions.
        given: Parameters of its file.
        values: Parameters over those.
        namespace: Where its names are.
    """

    def __init__(
        self, bus: Bus, process: Process, name: str, hooks: Hooks, given: Mapping[str, Any],
        values: Mapping[str, Value] | None = None, namespace: str = "", **_: object,
    ) -> None:  # fmt: skip
        super().__init__(bus, process, name, namespace)
        self._hooks, self.state = hooks, "unconfigured"
        self.given: Mapping[str, Any] = {**given, **(values or {})}
        self._managed: list[Writer] = []
        self._values: dict[str, Any] = {}
        self._accept: Callable[[Mapping[str, Value]], str] = lambda _: ""
        for kind, service, answer in (
            (SetParameters, "set_parameters", self._set), (GetParameters, "get_parameters", self._get)
        ):  # fmt: skip
            self.create_service(kind, f"{self.full_name}/{service}", answer)

    def create_lifecycle_publisher(self, kind: Any, name: str, qos: Qos) -> Writer:
        """Publisher that is silent unless the node is active."""
        made = self.create_publisher(kind, name, qos)
        made.is_active = self.state == "active"
        self._managed.append(made)
        return made

    def declare(
        self,
        specs: Iterable[Spec],
        values: Mapping[str, Value],
        accept: Callable[[Mapping[str, Value]], str],
    ) -> None:
        """Declare parameters, and have their changes accepted."""
        self._specs = {spec.name: spec for spec in specs}
        self._values, self._accept = dict(values), accept

    def show(self, values: Mapping[str, Value]) -> None:
        """Show values that the node has changed by itself."""
        self._values |= values

    def trigger(self, transition: str) -> Outcome:
        """Bring about a transition."""
        goal = _STATES.get((self.state, transition))
        if goal is None:
            self._hooks.on_no_transition(transition)
            return Outcome.ERROR
        if transition == "activate":
            self._open(is_active=True)
        found: Outcome = getattr(self._hooks, f"on_{transition}")()
        if transition in {"deactivate", "shutdown"}:
            self._open(is_active=False)
        if found is Outcome.SUCCESS:
            self.state = goal
        elif found is Outcome.ERROR:
            is_mended = self._hooks.on_error() is Outcome.SUCCESS
            self.state = "unconfigured" if is_mended else "finalized"
        return found

    def _open(self, *, is_active: bool) -> None:
        for writer in self._managed:
            writer.is_active = is_active

    def _set(self, request: Any, response: Any) -> Any:
        response.results = [self._set_one(one) for one in request.parameters]
        return response

    def _set_one(self, parameter: ParameterMessage) -> SetParametersResult:
        spec = self._specs.get(parameter.name)
        if spec is None or spec.fixed:
            reason = "is not declared" if spec is None else "is read-only"
            return SetParametersResult(successful=False, reason=f"{parameter.name} {reason}")
        value = from_message(parameter.value)
        if not isinstance(value, bool | int | float | str):
            value = tuple(value or ())
        reason = self._accept({parameter.name: value})
        if not reason:
            self._values[parameter.name] = value
        return SetParametersResult(successful=not reason, reason=reason)

    def _get(self, request: Any, response: Any) -> Any:
        known = [self._values.get(name) for name in request.names]
        response.values = [
            to_message(n, v).value
            for n, v in zip(request.names, known, strict=True)
            if v is not None
        ]
        return response
