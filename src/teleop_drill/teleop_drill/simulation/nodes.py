"""Nodes of the simulated middleware, with their topics, services, timers and executors."""

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from teleop_core.middleware.platform import Endpoint, Qos
from teleop_core.middleware.ros_messages import read_message
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.ends import Reader, Service, Writer
from teleop_drill.simulation.machine import Process, Said
from teleop_drill.simulation.scheduler import Strand


class SimulatedExecutor:
    """Simulated form of :class:`~teleop_core.middleware.platform.Executor`."""

    def __init__(self, process: Process) -> None:
        self._scheduler = process.machine.scheduler
        self._due: deque[Callable[[], object]] = deque()
        process.due.append(self._due)
        self._waiting: Strand | None = None

    def add_node(self, node: Any) -> None:
        """Add a node that the executor serves."""
        node.executor = self

    def post(self, work: Callable[[], object]) -> None:
        """Add a function to the executor's queue."""
        self._due.append(work)
        self.wake()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Serve one request; return without one if none comes within the time [s]."""
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
        """Stop serving requests."""
        self._due.clear()


class Timer:
    """Simulated form of :class:`~teleop_core.middleware.platform.Timer`."""

    def __init__(self, node: "SimulatedNode", period: float, callback: Callable[[], None]) -> None:
        self._node, self._callback = node, callback
        self._period_ns, self._round = round(1e9 * period), 0
        self.reset()

    def cancel(self) -> None:
        """Pause the timer."""
        self._round = -abs(self._round) - 1

    def reset(self) -> None:
        """Restart the timer; the next call is one period from now."""
        self._round = abs(self._round) + 1
        self._arrange()

    def is_canceled(self) -> bool:
        """Whether the timer is paused."""
        return self._round < 0

    def _arrange(self) -> None:
        scheduler, own = self._node.machine.scheduler, self._round
        due_ns = scheduler.now_ns + self._period_ns
        scheduler.at(due_ns, lambda: self._node.post(partial(self._call, own)))

    def _call(self, own: int) -> None:
        if own == self._round and not self._node.process.is_dead:
            self._arrange()
            self._callback()


class GuardCondition:
    """Simulated form of :class:`~teleop_core.middleware.platform.GuardCondition`."""

    def __init__(self, node: "SimulatedNode", callback: Callable[[], None]) -> None:
        self._node, self._callback, self._is_due = node, callback, False
        self.is_open = True

    def trigger(self) -> None:
        """Let the executor call the function soon; several triggers before this call lead to one call."""
        if not self._is_due:
            self._is_due = True
            self._node.post(self._call)

    def _call(self) -> None:
        self._is_due = False
        if self.is_open:
            self._callback()


class FutureAnswer:
    """Future answer of a service, with the methods of a future that callers use."""

    def __init__(self) -> None:
        self._told: list[Callable[[FutureAnswer], None]] = []
        self._value: Any = None
        self._is_done = False

    def done(self) -> bool:
        """Whether the answer has arrived."""
        return self._is_done

    def result(self) -> Any:
        """Return the answer."""
        return self._value

    def add_done_callback(self, told: Callable[["FutureAnswer"], None]) -> None:
        """Call a function when the answer has arrived."""
        self._told.append(told)

    def set(self, value: Any) -> None:
        """Set the answer, and call the waiting functions."""
        self._value, self._is_done = value, True
        for told in self._told:
            told(self)


class Client:
    """Simulated form of :class:`~teleop_core.middleware.platform.Client`."""

    def __init__(self, node: "SimulatedNode", name: str) -> None:
        self._node, self.srv_name = node, name

    def service_is_ready(self) -> bool:
        """Whether the service was discovered."""
        bus = self._node.bus
        service = bus.services.get(self.srv_name)
        return service is not None and bus.knows(self._node.process, service)

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until the service is discovered; returns whether it was discovered in time."""
        scheduler = self._node.machine.scheduler
        limit = float("inf") if timeout_sec is None else timeout_sec
        deadline_ns = scheduler.now_ns + 1e9 * limit
        while not self.service_is_ready():
            if scheduler.now_ns >= deadline_ns:
                return False
            scheduler.sleep(0.01)
        return True

    def call_async(self, request: Any) -> FutureAnswer:
        """Send a request, and return the future answer."""
        answer, bus, own = FutureAnswer(), self._node.bus, self._node.process
        service = bus.services.get(self.srv_name)
        if service is None:
            return answer
        if self.srv_name in bus.called:
            bus.called[self.srv_name]()

        def reply(response: Any) -> None:
            bus.call(service.process, own, lambda: self._node.post(lambda: answer.set(response)))

        bus.call(own, service.process, lambda: service.is_open and service.answer(request, reply))
        return answer

    def remove_pending_request(self, future: Any) -> None:
        """Cancel the wait for an answer."""


class Log:
    """Log with the interface of :class:`~teleop_core.middleware.platform.Log`; the machine stores its lines."""

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
    """Simulated form of :class:`~teleop_core.middleware.platform.Node`.

    Args:
        bus: The simulated middleware.
        process: Process that owns the node.
        name: Name of the node.
        namespace: Namespace of the node.
    """

    def __init__(self, bus: Bus, process: Process, name: str, namespace: str = "", **_: object) -> None:
        self.bus, self.process, self.machine = bus, process, process.machine
        self._name, self._namespace = name, "/" + namespace.strip("/")
        self.executor: SimulatedExecutor | None = None
        self._log = Log(self)

    @property
    def full_name(self) -> str:
        """Name with the namespace and a slash before it."""
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def get_name(self) -> str:
        """Name of the node."""
        return self._name

    def get_namespace(self) -> str:
        """Namespace of the node, with a leading slash."""
        return self._namespace

    def get_logger(self) -> Log:
        """Log of the node."""
        return self._log

    def resolve_topic_name(self, name: str) -> str:
        """Full name of a topic."""
        if name.startswith("~"):
            return f"{self.full_name}{name[1:]}"
        return name if name.startswith("/") else f"{self._namespace.rstrip('/')}/{name}"

    def create_publisher(self, kind: Any, name: str, qos: Qos) -> Writer:
        """Publisher of messages of a class."""
        topic = self.resolve_topic_name(name)
        return self.bus.open_writer(Writer(self.bus, self.process, self.full_name, topic, kind, qos))

    def create_taker(self, kind: Any, name: str, qos: Qos) -> Reader:
        """Subscription whose messages the caller takes."""
        topic = self.resolve_topic_name(name)
        return self.bus.open_reader(Reader(self.bus, self.process, kind, topic, qos, self.full_name))

    def create_subscription(self, kind: Any, name: str, callback: Callable[[Any], None], qos: Qos) -> Reader:
        """Subscription whose messages the executor passes to a callback."""
        reader, turns = self.create_taker(kind, name, qos), 0

        def hand_over() -> None:
            nonlocal turns
            turns -= 1
            if (taken := reader.take()) is not None:
                callback(read_message(taken.data, kind))

        def told() -> None:
            nonlocal turns
            if qos.keeps_all or turns < qos.depth:  # messages that the queue has lost need no call
                turns += 1
                self.post(hand_over)

        reader.told = told
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
        """Create a timer that calls a function with a period [s]."""
        return Timer(self, period, callback)

    def create_guard_condition(self, callback: Callable[[], None]) -> GuardCondition:
        """Create a guard condition that calls a function when it is triggered."""
        return GuardCondition(self, callback)

    def destroy(self, entity: Any) -> None:
        """Remove an object that one of these methods has created."""
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
        elif isinstance(entity, GuardCondition):
            entity.is_open = False

    def post(self, work: Callable[[], object]) -> None:
        """Add a function to the executor's queue; without an executor nothing happens."""
        if self.executor is not None and not self.process.is_dead:
            self.executor.post(work)

    def defer(self, work: Callable[..., object], *arguments: object) -> None:
        """Let the executor call a function soon; without an executor nothing happens."""
        self.post(partial(work, *arguments))

    def count_publishers(self, name: str) -> int:
        """Number of discovered publishers of a topic."""
        return len(self.publishers(name))

    def publishers(self, name: str) -> list[Endpoint]:
        """Discovered publishers of a topic."""
        return self.bus.found(self.process, self.bus.writers.get(self.resolve_topic_name(name), ()))

    def readers(self, name: str) -> list[Endpoint]:
        """Discovered readers of a topic."""
        return self.bus.found(self.process, self.bus.readers.get(self.resolve_topic_name(name), ()))

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        """All topics; the type of each is the text ``simulated``."""
        return [(name, ["simulated"]) for name in self.bus.topics()]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        """All services; the type of each is the text ``simulated``."""
        return [(name, ["simulated"]) for name in sorted(self.bus.services)]

    def destroy_node(self) -> None:
        """Detach the node from its executor; the end of the process removes the rest."""
        self.executor = None
