"""Looking: topics, services and parameters of the nodes of a ROS domain, whoever made these nodes."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from std_srvs.srv import Trigger

from teleop_core.base.errors import ParameterError, SessionError, UnknownNameError
from teleop_core.middleware.platform import Platform, Qos, Taken, Taker
from teleop_core.middleware.ros import ROS
from teleop_core.middleware.ros_messages import read_message
from teleop_core.middleware.ros_parameters import from_message, to_message
from teleop_core.nodes.guest import Guest
from teleop_core.nodes.streams import message_type

_PERIOD = 0.01  # period at which a condition is checked [s]
_QUIET = 1.0  # discovery has ended if nothing new was found for this time [s]
_DEPTH = 5000  # length of the queue of a topic that is watched [messages]
_LIST = "/list_parameters"
_OWN = ("/parameter_events", "/rosout")  # topics of every node, this one too
_ELEMENTS = {ParameterType.PARAMETER_INTEGER_ARRAY: int, ParameterType.PARAMETER_STRING_ARRAY: str}


class FoundTopic(NamedTuple):
    """A discovered topic: type of its messages, and numbers of its publishers and readers."""

    ros_type: str
    publishers: int
    readers: int


class Rate(NamedTuple):
    """Intervals between messages of a topic: their number, and the shortest, mean and longest interval [s]."""

    number: int
    shortest: float
    mean: float
    longest: float


class LookingNode(Guest):
    """Node that looks at the other nodes of a ROS domain, and sets their parameters.

    Args:
        domain: ROS domain.
        patience: Longest time for discovery and for an answer [s].
        platform: Platform of the session.
    """

    def __init__(self, domain: int, patience: float = 3.0, platform: Platform = ROS) -> None:
        super().__init__("teleop_look", domain, platform, start_parameter_services=False)
        self.domain, self._patience = domain, patience
        self._executor = self.platform.executor()
        self._executor.add_node(self.ros)

    def close(self) -> None:
        """Destroy the node."""
        self._executor.shutdown()
        super().close()

    # -- topics ------------------------------------------------------------------------------------

    def topics(self) -> dict[str, FoundTopic]:
        """All discovered topics, by name."""
        return {
            name: FoundTopic(ends[0].ros_type, len(self.ros.publishers(name)), len(self.ros.readers(name)))
            for name in self._discovered(self.ros.get_topic_names_and_types)
            if name not in _OWN and (ends := [*self.ros.publishers(name), *self.ros.readers(name)])
        }

    def messages(self, name: str) -> Iterator[Any]:
        """Messages of a topic as they come, without end; the last one first, if the topic is latched."""
        taker = self._taker(name)
        while True:
            taken = self._next(taker)
            yield read_message(taken.data, taker.type)

    def rates(self, name: str, seconds: float = 1.0) -> Iterator[Rate]:
        """Rate of a topic in one interval of time after the other, without end."""
        taker, last = self._taker(name), 0
        while True:
            came, end = [last] if last else [], self._now() + seconds
            while self._now() < end:
                taken = taker.take()
                if taken is None:
                    self._executor.spin_once(timeout_sec=_PERIOD)
                else:
                    came.append(taken.came_ns)
            last = came[-1] if came else 0
            steps = [1e-9 * (b - a) for a, b in pairwise(came)]
            yield Rate(len(steps), min(steps), sum(steps) / len(steps), max(steps)) if steps else Rate(0, 0.0, 0.0, 0.0)

    def _taker(self, name: str) -> Taker:
        full, topics = f"/{name.strip('/')}", self.topics()
        if full not in topics:
            raise UnknownNameError(f"topic on ROS domain {self.domain}", full, sorted(topics) or ["none"])
        makers = self.ros.publishers(full)
        qos = Qos(
            depth=_DEPTH,
            is_reliable=bool(makers) and all(maker.is_reliable for maker in makers),
            is_latched=bool(makers) and all(maker.is_latched for maker in makers),
        )
        return self.ros.create_taker(message_type(topics[full].ros_type), full, qos)

    def _next(self, taker: Taker) -> Taken:
        while (taken := taker.take()) is None:
            self._executor.spin_once(timeout_sec=_PERIOD)
        return taken

    # -- services and parameters ---------------------------------------------------------------------

    def services(self) -> dict[str, str]:
        """Type of each discovered service, by name."""
        return {name: kinds[0] for name, kinds in self._discovered(self.ros.get_service_names_and_types).items()}

    def trigger(self, name: str) -> tuple[bool, str]:
        """Call a service of the type ``std_srvs/srv/Trigger``; returns whether it was done, and the answer."""
        answer = self._ask(Trigger, f"/{name.strip('/')}", Trigger.Request())
        return bool(answer.success), str(answer.message)

    def nodes(self) -> list[str]:
        """Nodes that have parameters."""
        return sorted(name.removesuffix(_LIST) for name in self.services() if name.endswith(_LIST))

    def parameters(self, node: str) -> dict[str, Any]:
        """Values of all parameters of a node, by name."""
        self._insist(node)
        listed = self._ask(ListParameters, f"/{node.strip('/')}{_LIST}", ListParameters.Request())
        names = sorted(listed.result.names)
        return {name: from_message(value) for name, value in zip(names, self._values(node, names), strict=True)}

    def parameter(self, node: str, name: str) -> Any:
        """Value of a parameter of a node.

        Raises:
            UnknownNameError: The node or the parameter does not exist.
            SessionError: The node does not answer.
        """
        self._insist(node)
        return from_message(self._value(node, name))

    def change(self, node: str, name: str, value: Any) -> None:
        """Set a parameter of a node; a whole number may stand for a number with decimals.

        Raises:
            UnknownNameError: The node or the parameter does not exist.
            ParameterError: The node refuses the value.
            SessionError: The node does not answer.
        """
        self._insist(node)
        old = self._value(node, name)
        message = to_message(name, _like(from_message(old), value), _ELEMENTS.get(old.type, float))
        request = SetParameters.Request(parameters=[message])
        (result,) = self._ask(SetParameters, f"/{node.strip('/')}/set_parameters", request).results
        if not result.successful:
            raise ParameterError(f"{name} of {node}", value, f"a value that the node takes: {result.reason}")

    def _value(self, node: str, name: str) -> Any:
        for value in self._values(node, [name]):
            if value.type != ParameterType.PARAMETER_NOT_SET:
                return value
        raise UnknownNameError(f"parameter of {node}", name, self.parameters(node))

    def _values(self, node: str, names: list[str]) -> Any:
        return self._ask(GetParameters, f"/{node.strip('/')}/get_parameters", GetParameters.Request(names=names)).values

    def _insist(self, node: str) -> None:
        """Wait until a node with parameters is found."""
        service = f"/{node.strip('/')}{_LIST}"
        try:
            self._until(self.ros.create_client(ListParameters, service).service_is_ready, "")
        except SessionError:
            known = [name for name in self.nodes() if name != f"/{node.strip('/')}"] or ["none"]  # our client counts
            raise UnknownNameError(f"node on ROS domain {self.domain}", node, known) from None

    # -- waiting -----------------------------------------------------------------------------------

    def _now(self) -> float:
        return 1e-9 * self.platform.monotonic_ns()

    def _discovered(self, look: Callable[[], list[tuple[str, list[str]]]]) -> dict[str, list[str]]:
        """Names and types, once nothing new has been found for a while."""
        begin = changed = self._now()
        found: dict[str, list[str]] = {}
        while self._now() - begin < self._patience and (self._now() - changed < _QUIET or set(found) <= set(_OWN)):
            now = dict(look())
            if now.keys() != found.keys():
                found, changed = now, self._now()
            self._executor.spin_once(timeout_sec=_PERIOD)
        return dict(sorted(found.items()))

    def _ask(self, kind: type, service: str, request: object) -> Any:
        client = self.ros.create_client(kind, service)
        self._until(client.service_is_ready, f"the service {service} does not exist on ROS domain {self.domain}")
        future = client.call_async(request)
        self._until(future.done, f"the service {service} does not answer")
        return future.result()

    def _until(self, condition: Callable[[], bool], otherwise: str) -> None:
        end = self._now() + self._patience
        while not condition():
            if self._now() > end:
                raise SessionError(otherwise)
            self._executor.spin_once(timeout_sec=_PERIOD)


def _like(before: Any, value: Any) -> Any:
    """Value of the type that the parameter has."""
    if isinstance(before, str):
        return str(value)
    if isinstance(before, float) and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if isinstance(value, list | tuple):
        is_real = any(isinstance(one, float) for one in (*value, *(before or ())))
        return tuple(float(one) for one in value) if is_real else tuple(value)
    return value
