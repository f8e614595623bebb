"""Lifecycle node, implemented with rclpy."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from teleop_core.base import ParameterError, Spec, Value
from teleop_core.middleware.platform import Hooks, Qos, TransitionResult
from teleop_core.middleware.ros_node import RosNode, RosPublisher, profile_of
from teleop_core.middleware.ros_parameters import declare, plain, typed
from teleop_core.middleware.ros_taking import Unattended

_CODES = {
    TransitionResult.SUCCESS: TransitionCallbackReturn.SUCCESS,
    TransitionResult.FAILURE: TransitionCallbackReturn.FAILURE,
    TransitionResult.ERROR: TransitionCallbackReturn.ERROR,
}
_OUTCOMES = {code: outcome for outcome, code in _CODES.items()}
_SIM_TIME = "use_sim_time"


def _sim_time(node: str) -> ParameterError:
    """Error that refuses ``use_sim_time``: each step, also of the drives, lasts a millisecond of real time."""
    requirement = (
        "false: nodes step in real time; teleop sim and replay go as fast as the machine can, "
        "teleop play --clock publishes /clock"
    )
    return ParameterError(f"{node}.{_SIM_TIME}", True, requirement)


class RosLifecycleNode(RosNode):
    """See :class:`~teleop_core.middleware.platform.LifecycleNode`.

    Args:
        name: Name of the node.
        hooks: Functions that the node calls in its transitions.
        options: Options of the class in rclpy; ``values`` are parameters that override the command line.

    Raises:
        ParameterError: The node is configured to use simulated time.
    """

    def __init__(self, name: str, hooks: Hooks, values: Mapping[str, Value] | None = None, **options: Any) -> None:
        given = [Parameter(key, value=_listed(value)) for key, value in (values or {}).items()]
        super().__init__(_Own(name, hooks, parameter_overrides=given, **options))
        own = self.own
        if own.get_parameter(_SIM_TIME).value:
            raise _sim_time(own.full_name)
        self.given: Mapping[str, Any] = {
            key: entry.value for key, entry in own._parameter_overrides.items() if not own.has_parameter(key)
        }
        self.create_lifecycle_publisher = self._create_lifecycle_publisher
        self._shows = False

    def _create_lifecycle_publisher(self, kind: Any, name: str, qos: Qos) -> RosPublisher:
        return RosPublisher(self.own.create_lifecycle_publisher(kind, name, profile_of(qos)))

    def declare(
        self, specs: Iterable[Spec], values: Mapping[str, Value], accept: Callable[[Mapping[str, Value]], str]
    ) -> None:
        """Declare parameters, and call ``accept`` for their changes."""
        self._specs, self._accept = {spec.name: spec for spec in specs}, accept
        declare(self.own, self._specs.values(), values)
        self.own.add_pre_set_parameters_callback(self._type_empty_lists)
        self.own.add_on_set_parameters_callback(self._judge)

    def show(self, values: Mapping[str, Value]) -> None:
        """Show values that the node has changed by itself; ``accept`` is not called."""
        self._shows = True
        try:
            self.own.set_parameters([Parameter(k, value=v) for k, v in values.items()])
        finally:
            self._shows = False

    def trigger(self, transition: str) -> TransitionResult:
        """Execute a transition."""
        return _OUTCOMES[getattr(self.own, f"trigger_{transition}")()]

    def _type_empty_lists(self, changes: list[Parameter]) -> list[Parameter]:
        return [typed(self._specs.get(change.name), change) for change in changes]

    def _judge(self, changes: list[Parameter]) -> SetParametersResult:
        if self._shows:
            return SetParametersResult(successful=True)
        if any(change.name == _SIM_TIME and change.value for change in changes):
            reason = str(_sim_time(self.own.full_name))
            return SetParametersResult(successful=False, reason=reason)
        own = [change for change in changes if change.name in self._specs]
        reason = self._accept({c.name: plain(self._specs[c.name], c.value) for c in own})
        return SetParametersResult(successful=not reason, reason=reason)


class _Own(LifecycleNode):  # type: ignore[misc]
    """Node of rclpy that calls its hooks in its transitions."""

    def __init__(self, name: str, hooks: Hooks, **options: Any) -> None:
        self._hooks = hooks
        super().__init__(name, **options)
        own = self._service_change_state
        own.callback = partial(self._change_state, own.callback)

    @property
    def full_name(self) -> str:
        """Name with the namespace, without the slash before it."""
        return f"{self.get_namespace()}/{self.get_name()}".strip("/")

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Subscriptions that the executor serves.

        Subscriptions that are read without the executor are left out, because any thread may open and close them.
        """
        for entry in tuple(super().subscriptions):
            if not isinstance(entry.callback_group, Unattended):
                yield entry

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return _CODES[self._hooks.on_configure()]

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        super().on_activate(state)  # opens the publishers
        return _CODES[self._hooks.on_activate()]

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        result = self._hooks.on_deactivate()
        super().on_deactivate(state)
        return _CODES[result]

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        return _CODES[self._hooks.on_cleanup()]

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        return _CODES[self._hooks.on_shutdown()]

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        return _CODES[self._hooks.on_error()]

    def _change_state(self, change: Callable[..., Any], request: Any, response: Any) -> Any:
        """Answer a service that requests a transition; refuse a transition that does not exist in the current state."""
        try:
            return change(request, response)
        except rclpy_implementation.RCLError:  # the error would end the process
            self._hooks.on_no_transition(request.transition.label or str(request.transition.id))
            response.success = False
            return response


def _listed(value: Value) -> Any:
    return list(value) if isinstance(value, tuple) else value
