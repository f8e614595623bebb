"""Lifecycle: simulated nodes with parameters and states."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters, SetParametersAtomically

from teleop_core.base.parameters import Spec, Value
from teleop_core.middleware.platform import Hooks, Qos, TransitionResult
from teleop_core.middleware.ros_parameters import descriptor, from_message, to_message
from teleop_drill.simulation.bus import Bus
from teleop_drill.simulation.ends import Writer
from teleop_drill.simulation.machine import Process
from teleop_drill.simulation.nodes import SimulatedNode

_STATES = {
    ("unconfigured", "configure"): "inactive",
    ("inactive", "activate"): "active",
    ("active", "deactivate"): "inactive",
    ("inactive", "cleanup"): "unconfigured",
    ("unconfigured", "shutdown"): "finalized",
    ("inactive", "shutdown"): "finalized",
    ("active", "shutdown"): "finalized",
}

_WORDS = {
    Transition.TRANSITION_CONFIGURE: "configure",
    Transition.TRANSITION_ACTIVATE: "activate",
    Transition.TRANSITION_DEACTIVATE: "deactivate",
    Transition.TRANSITION_CLEANUP: "cleanup",
    Transition.TRANSITION_UNCONFIGURED_SHUTDOWN: "shutdown",
    Transition.TRANSITION_INACTIVE_SHUTDOWN: "shutdown",
    Transition.TRANSITION_ACTIVE_SHUTDOWN: "shutdown",
}


class SimulatedLifecycleNode(SimulatedNode):
    """Simulated form of :class:`~teleop_core.middleware.platform.LifecycleNode`.

    Args:
        bus: The simulated middleware.
        process: Process that owns the node.
        name: Name of the node.
        hooks: Functions that the node's transitions call.
        given: Parameters of the process's file.
        values: Parameters that override the file.
        namespace: Namespace of the node.
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
        self.create_service(SetParameters, "~/set_parameters", self._set)
        self.create_service(SetParametersAtomically, "~/set_parameters_atomically", self._set_all)
        self.create_service(GetParameters, "~/get_parameters", self._get)
        self.create_service(DescribeParameters, "~/describe_parameters", self._describe)
        self.create_service(ListParameters, "~/list_parameters", self._list)
        self.create_service(ChangeState, "~/change_state", self._change_state)
        self.create_service(GetState, "~/get_state", self._get_state)

    def create_lifecycle_publisher(self, kind: Any, name: str, qos: Qos) -> Writer:
        """Publisher that is silent unless the node is active."""
        made = self.create_publisher(kind, name, qos)
        made.is_active = self.state == "active"
        self._managed.append(made)
        return made

    def declare(
        self, specs: Iterable[Spec], values: Mapping[str, Value], accept: Callable[[Mapping[str, Value]], str]
    ) -> None:
        """Declare parameters, and register the function that accepts their changes."""
        self._specs = {spec.name: spec for spec in specs}
        self._values, self._accept = dict(values), accept

    def show(self, values: Mapping[str, Value]) -> None:
        """Show values that the node has changed by itself."""
        self._values |= values

    def trigger(self, transition: str) -> TransitionResult:
        """Execute a transition."""
        goal = _STATES.get((self.state, transition))
        if goal is None:
            self._hooks.on_no_transition(transition)
            return TransitionResult.ERROR
        if transition == "activate":
            self._open(is_active=True)
        found: TransitionResult = getattr(self._hooks, f"on_{transition}")()
        if transition in {"deactivate", "shutdown"}:
            self._open(is_active=False)
        if found is TransitionResult.SUCCESS:
            self.state = goal
        elif found is TransitionResult.ERROR:
            is_mended = self._hooks.on_error() is TransitionResult.SUCCESS
            self.state = "unconfigured" if is_mended else "finalized"
        return found

    def _open(self, *, is_active: bool) -> None:
        for writer in self._managed:
            writer.is_active = is_active

    def _set(self, request: Any, response: Any) -> Any:
        response.results = [self._take([one]) for one in request.parameters]
        return response

    def _set_all(self, request: Any, response: Any) -> Any:
        response.result = self._take(request.parameters)
        return response

    def _take(self, parameters: list[ParameterMessage]) -> SetParametersResult:
        """Accept all changes or none of them."""
        changes: dict[str, Any] = {}
        for one in parameters:
            spec = self._specs.get(one.name)
            if spec is None or spec.fixed:
                reason = "is not declared" if spec is None else "is read-only"
                return SetParametersResult(successful=False, reason=f"{one.name} {reason}")
            value = from_message(one.value)
            is_plain = isinstance(value, bool | int | float | str)
            changes[one.name] = value if is_plain else tuple(value or ())
        reason = self._accept(changes)
        if not reason:
            self._values |= changes
        return SetParametersResult(successful=not reason, reason=reason)

    def _describe(self, request: Any, response: Any) -> Any:
        response.descriptors = [descriptor(self._specs[name]) for name in request.names if name in self._specs]
        return response

    def _list(self, _: Any, response: Any) -> Any:
        response.result.names = sorted(self._specs)
        return response

    def _get_state(self, _: Any, response: Any) -> Any:
        response.current_state.label = self.state
        return response

    def _change_state(self, request: Any, response: Any) -> Any:
        word = request.transition.label or _WORDS.get(request.transition.id, "")
        if (self.state, word) not in _STATES:
            self._hooks.on_no_transition(word or str(request.transition.id))
            response.success = False
        else:
            response.success = self.trigger(word) is TransitionResult.SUCCESS
        return response

    def _get(self, request: Any, response: Any) -> Any:
        known = [self._values.get(name) for name in request.names]
        response.values = [to_message(n, v).value for n, v in zip(request.names, known, strict=True) if v is not None]
        return response
