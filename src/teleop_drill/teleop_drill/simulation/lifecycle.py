"""Lifecycle: simulated nodes with parameters and states."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameters, SetParameters

from teleop_core.base.parameters import Spec, Value
from teleop_core.middleware.ros_parameters import from_message, to_message
from teleop_core.middleware.world import Hooks, Outcome, Qos
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
        self.create_service(SetParameters, "~/set_parameters", self._set)
        self.create_service(GetParameters, "~/get_parameters", self._get)

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
