"""Declaration: converts parameter groups to typed, bounded ROS parameters, and back."""

import sys
from collections.abc import Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from teleop_core.base.parameters import Spec, Value
from teleop_core.middleware.platform import Qos

EVENTS = Qos(depth=1000)
"""Quality of service of the topic on which nodes report changed parameters."""
_SCALARS = {
    bool: Parameter.Type.BOOL,
    int: Parameter.Type.INTEGER,
    float: Parameter.Type.DOUBLE,
    str: Parameter.Type.STRING,
}
_ARRAYS = {
    bool: Parameter.Type.BOOL_ARRAY,
    int: Parameter.Type.INTEGER_ARRAY,
    float: Parameter.Type.DOUBLE_ARRAY,
    str: Parameter.Type.STRING_ARRAY,
}
_LARGEST_INTEGER = 2**63 - 1


def ros_type(spec: Spec) -> Parameter.Type:
    """Type of the ROS parameter."""
    return (_ARRAYS if spec.kind is tuple else _SCALARS)[spec.element]


def descriptor(spec: Spec) -> ParameterDescriptor:
    """Description with unit and bounds, as ``ros2 param describe`` shows it."""
    out = ParameterDescriptor(name=spec.name, read_only=spec.fixed, type=ros_type(spec).value)
    out.description = f"{spec.doc} [{spec.unit}]" if spec.unit else spec.doc
    constraints = [f"one of {', '.join(spec.choices)}"] if spec.choices else []
    if spec.length is not None:
        constraints.append(f"{spec.length} values")
    if spec.lower is not None or spec.upper is not None:
        constraints.append(spec.bounds())
        _bound(out, spec)
    out.additional_constraints = "; ".join(constraints)
    return out


def _bound(out: ParameterDescriptor, spec: Spec) -> None:
    largest = sys.float_info.max if spec.element is float else _LARGEST_INTEGER
    lower = -largest if spec.lowest is None else spec.lowest
    upper = largest if spec.upper is None else spec.upper
    if spec.element is float:
        limits = FloatingPointRange(from_value=float(lower), to_value=float(upper))
        out.floating_point_range = [limits]
    elif spec.element is int:
        out.integer_range = [IntegerRange(from_value=int(lower), to_value=int(upper))]


def declare(node: Node, specs: Iterable[Spec], values: Mapping[str, Value]) -> None:
    """Declare parameters with the given values, which already include values of the command line.

    rclpy treats an empty list as bytes and refuses it for other types. Therefore lists are declared by their type and
    set afterwards; only then can they become read-only.
    """
    for spec in specs:
        value, about = values[spec.name], descriptor(spec)
        if spec.kind is not tuple:
            node.declare_parameter(spec.name, value, about, ignore_override=True)
            continue
        about.read_only = False
        node.declare_parameter(spec.name, ros_type(spec), about, ignore_override=True)
        assert isinstance(value, tuple)
        node.set_parameters([Parameter(spec.name, ros_type(spec), list(value))])
        node.set_descriptor(spec.name, descriptor(spec))


def plain(spec: Spec | None, value: Any) -> Any:
    """Python value of a ROS value: lists become tuples; an empty YAML list, which has no type, becomes ()."""
    if spec is not None and spec.kind is tuple and value is None:
        return ()
    return value if value is None or isinstance(value, bool | int | float | str) else tuple(value)


def typed(spec: Spec | None, parameter: Parameter) -> Parameter:
    """The parameter; an empty list is replaced by a parameter of the declared type."""
    if spec is None or spec.kind is not tuple or plain(spec, parameter.value) != ():
        return parameter
    return Parameter(parameter.name, ros_type(spec), [])


def to_message(name: str, value: Any, element: type = float) -> Any:
    """Message of a parameter for the parameter services; ``element`` is the element type of an empty list."""
    if value == ():
        return Parameter(name, _ARRAYS[element], []).to_parameter_msg()
    given = list(value) if isinstance(value, tuple) else value
    return Parameter(name, value=given).to_parameter_msg()


def from_message(value: Any) -> Any:
    """Python value of a parameter in a message of services and events."""
    return parameter_value_to_python(value)
