"""Parameter client: reads the parameters of other nodes with their bounds, and sets them."""

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, ParameterEvent, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters

from teleop_console.link import ParameterInfo, Setting
from teleop_core.base.errors import SessionError
from teleop_core.middleware.platform import Client, Owner, Platform
from teleop_core.middleware.ros_parameters import EVENTS, from_message, to_message

PATIENCE = 3.0
"""Time limit for a node's answer [s]."""
_LARGEST = 1e18
_ONE_OF = "one of "
_HIDDEN = ("use_sim_time", "qos_overrides", "start_type_description_service", "configuration")


class ParameterEvents:
    """Changes of parameters, as nodes publish them; the caller must spin an executor.

    Args:
        owner: Node that subscribes to the changes.
    """

    def __init__(self, owner: Owner) -> None:
        self._lock = owner.platform.lock()
        self._changed: dict[tuple[str, str], Setting] = {}
        self._own = owner.ros.create_subscription(ParameterEvent, "/parameter_events", self._hear, EVENTS)

    def take(self) -> dict[tuple[str, str], Setting]:
        """Newest values of the parameters that have changed since the last call, by node and name."""
        with self._lock:
            taken, self._changed = self._changed, {}
        return taken

    def _hear(self, event: ParameterEvent) -> None:
        found = (*event.new_parameters, *event.changed_parameters)
        with self._lock:
            for one in found:
                value = _setting_of(from_message(one.value))
                self._changed[event.node.strip("/"), one.name] = value


class ParameterClient:
    """Asks nodes for their parameters; the caller must spin an executor.

    Args:
        owner: Node that owns the clients.
    """

    def __init__(self, owner: Owner) -> None:
        self._node, self._platform = owner.ros, owner.platform
        self._clients: dict[tuple[type, str], Client] = {}

    def read(self, name: str) -> dict[str, ParameterInfo]:
        """All parameters of a node, by their names.

        Raises:
            SessionError: The node does not answer.
        """
        listed = self._ask(ListParameters, name, "list_parameters", ListParameters.Request())
        names = sorted(n for n in listed.result.names if not n.startswith(_HIDDEN))
        about = self._ask(DescribeParameters, name, "describe_parameters", DescribeParameters.Request(names=names))
        values = self.values(name, names)
        return {
            described.name: _info(name, described, values[described.name])
            for described in about.descriptors
            if described.name in values
        }

    def values(self, name: str, names: list[str]) -> dict[str, Setting]:
        """Present values of some parameters; parameters that are not set are left out."""
        request = GetParameters.Request(names=names)
        answer = self._ask(GetParameters, name, "get_parameters", request)
        found = zip(names, answer.values, strict=True)
        return {
            one: _setting_of(from_message(value))
            for one, value in found
            if value.type != ParameterType.PARAMETER_NOT_SET
        }

    def change(self, name: str, parameter: str, value: Setting) -> str:
        """Set a parameter of a node; returns the reason of a refusal, else an empty text."""
        request = SetParameters.Request(parameters=[to_message(parameter, value)])
        try:
            (result,) = self._ask(SetParameters, name, "set_parameters", request).results
        except SessionError as error:
            return str(error)
        return "" if result.successful else (result.reason or "refused")

    def _ask(self, kind: type, name: str, service: str, request: object) -> Any:
        key = (kind, f"/{name}/{service}")
        if key not in self._clients:
            self._clients[key] = self._node.create_client(kind, key[1])
        return call(self._platform, self._clients[key], request, PATIENCE)


def call(platform: Platform, client: Client, request: object, patience: float) -> Any:
    """Call a service from a thread other than the executor's, and return the answer.

    Raises:
        SessionError: The service does not exist or did not answer in time.
    """
    if not client.wait_for_service(timeout_sec=patience):
        raise SessionError(f"the service {client.srv_name} does not exist")
    waits = platform.lock()
    waits.acquire()
    asked = client.call_async(request)
    asked.add_done_callback(lambda _: waits.release())
    if not waits.acquire(True, patience):
        client.remove_pending_request(asked)
        raise SessionError(f"the service the service {client.srv_name} does not answer")
    return asked.result()


def _setting_of(value: Any) -> Setting:
    return value if isinstance(value, bool | int | float | str) else tuple(value or ())


def _info(node: str, described: ParameterDescriptor, value: Setting) -> ParameterInfo:
    ranges = [*described.floating_point_range, *described.integer_range]
    bound: Callable[[float], float | None] = lambda v: v if abs(v) < _LARGEST else None  # noqa: E731
    lower, upper = (bound(ranges[0].from_value), bound(ranges[0].to_value)) if ranges else (None, None)
    constraints = described.additional_constraints.split("; ")
    choices = [text.removeprefix(_ONE_OF) for text in constraints if text.startswith(_ONE_OF)]
    return ParameterInfo(
        node,
        described.name,
        value,
        described.description,
        lower,
        upper,
        tuple(choices[0].split(", ")) if choices else (),
        described.read_only,
    )
