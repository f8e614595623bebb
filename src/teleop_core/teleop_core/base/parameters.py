"""Parameters: declared once, as dataclass fields with unit, bounds and text, and checked without ROS."""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from types import UnionType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from teleop_core.base.errors import ParameterError, PartError, UnknownNameError
from teleop_core.base.ranges import check

if TYPE_CHECKING:
    from teleop_core.base.registry import Registry

Group = TypeVar("Group")
Scalar = bool | int | float | str
Value = Scalar | tuple[Scalar, ...]

LARGEST = 10**18
"""Largest whole number of a parameter: kernels count in 64 bits."""
MARKS = ("published", "derived", "fitted", "assumed")
"""Origin of a number: printed in a source, derived from a source, fitted to data, or assumed because it is plausible.
"""


class Within(NamedTuple):
    """Inclusive bounds of a number, and its SI unit, which is empty for pure numbers.

    For a tuple, the bounds apply to each element. None means the bound of the unit (:mod:`~teleop_core.base.ranges`).
    """

    lower: float | None = None
    upper: float | None = None
    unit: str = ""


_ANY = Within()


def parameter(
    default: Any,
    within: Within = _ANY,
    doc: str = "",
    *,
    choices: tuple[str, ...] = (),
    length: int | None = None,
    off: float | None = None,
    fixed: bool = False,
    source: str = "",
    **former: Any,
) -> Any:
    """Dataclass field that describes one parameter.

    Args:
        default: Default value; its type is the parameter's type.
        within: Bounds and unit of numbers.
        doc: One line for the README's table and the ROS descriptor.
        choices: Allowed names; empty for any.
        length: Number of elements of a tuple; None for any.
        off: Number that is allowed outside of the bounds and switches the feature off; None if there is no such
            number.
        fixed: Whether the parameter can only be set before the stage is built.
        source: Origin of the default: a mark of :data:`MARKS`, a colon, and the source, the data or the reason; empty
            if the default is a free choice.
        **former: ``lower``, ``upper`` and ``unit``, as in version 0.6.0, instead of ``within``.

    Returns:
        The dataclass field.

    Raises:
        ParameterError: The source does not begin with a mark.
    """
    if source and source.partition(":")[0] not in MARKS:
        raise ParameterError("source", source, f"one of {', '.join(MARKS)}, a colon and a text")
    meta = within._replace(**former)._asdict() | {
        "doc": doc, "choices": choices, "length": length, "off": off, "fixed": fixed, "source": source,
    }  # fmt: skip
    return field(default=default, metadata=meta)


def fixed(default: Any, within: Within = _ANY, doc: str = "", **more: Any) -> Any:
    """Field of a parameter that can only be set before the stage is built; arguments as of :func:`parameter`."""
    return parameter(default, within, doc, fixed=True, **more)


@dataclass(frozen=True)
class NoParameters:
    """Group of a part without parameters."""


@dataclass(frozen=True)
class Choice:
    """The part of a registry that a group uses, and the parameters of all parts of the registry.

    Attributes:
        kind: Name of the part.
        groups: Parameters of each part by its name, also of parts that are not used now.
    """

    kind: str
    groups: Mapping[str, Any]

    @property
    def parameters(self) -> Any:
        """Parameters of the part that is used."""
        return self.groups[self.kind]


def choice(
    registry: "Registry[Any]", default: str, *, doc: str, fixed: bool = False, usual: Mapping[str, Value] | None = None
) -> Any:
    """Dataclass field, to be called ``kind``, that chooses a part by name.

    In addition to ``kind``, the group then has the parameters of every part, each below the part's name:
    ``fixture.kind`` and ``fixture.sphere.radius``. Each part has a parameter group in its attribute ``parameters``.

    Args:
        registry: Registry of the parts.
        default: Name of the default part.
        doc: One line for tables and the ROS descriptor.
        fixed: Whether the parameter can only be set before the stage is built.
        usual: Default values in this group for parameters of the parts, by their dotted names.
    """
    usual = usual or {}
    meta = {"registry": registry, "default": default, "doc": doc, "fixed": fixed, "usual": usual}
    return field(default_factory=lambda: _make_choice(registry, default, usual), metadata=meta)


def _make_choice(registry: "Registry[Any]", kind: str, values: Mapping[str, object]) -> Choice:
    groups = {name: _make(registry.find(name).parameters, _below(name, values)) for name in registry}
    return Choice(kind, groups)


def _below(name: str, values: Mapping[str, object]) -> dict[str, object]:
    """Values of a nested group, with the group's name removed from their keys."""
    start = name + "."
    return {key[len(start) :]: value for key, value in values.items() if key.startswith(start)}


@dataclass(frozen=True)
class Spec:
    """Declaration of one parameter: ``name`` is dotted for nested groups.

    ``is_part`` states whether the parameter names a part of a registry.
    """

    name: str
    kind: type
    element: type
    default: Value
    unit: str
    doc: str
    lower: float | None
    upper: float | None
    choices: tuple[str, ...]
    length: int | None
    fixed: bool
    source: str = ""
    off: float | None = None
    is_part: bool = False

    @property
    def lowest(self) -> float | None:
        """Smallest allowed number, including the one that means "off"; None without a bound."""
        if self.lower is None or self.off is None:
            return self.lower
        return min(self.lower, self.off)

    def check(self, value: object) -> None:
        """Refuse a value of another type, length, bound or choice.

        Raises:
            ParameterError: The value is not allowed. The error names the parameter, the value and the allowed values.
        """
        if self.kind is not tuple:
            self._check_element(value)
            return
        if not isinstance(value, tuple):
            raise ParameterError(self.name, value, f"a list of {self.element.__name__}")
        if self.length is not None and len(value) != self.length:
            raise ParameterError(self.name, value, f"a list of {self.length} values")
        for element in value:
            self._check_element(element)

    def _check_element(self, value: object) -> None:
        if type(value) is not self.element:
            hint = " (write 1.0, not 1)" if self.element is float and isinstance(value, int) else ""
            raise ParameterError(self.name, value, f"of type {self.element.__name__}{hint}")
        if self.choices and value not in self.choices:
            raise UnknownNameError(self.name, value, self.choices)
        if isinstance(value, float) and not math.isfinite(value):
            raise ParameterError(self.name, value, f"finite, {self.bounds()}")
        if isinstance(value, int) and not -LARGEST <= value <= LARGEST:
            raise ParameterError(self.name, value, "a number of at most 18 digits")
        if isinstance(value, int | float) and not self._is_inside(value):
            raise ParameterError(self.name, value, self.bounds())
        if isinstance(value, float):
            check(self.name, value, self.unit)

    def _is_inside(self, value: float) -> bool:
        is_off = self.off is not None and value == self.off
        return is_off or ((self.lower is None or value >= self.lower) and (self.upper is None or value <= self.upper))

    def bounds(self) -> str:
        """Allowed range in words, with the unit."""
        unit = f" {self.unit}" if self.unit else ""
        off = "" if self.off is None else f"{self.off:g}, or "
        if self.lower is not None and self.upper is not None:
            return f"{off}between {self.lower:g} and {self.upper:g}{unit}"
        if self.lower is not None:
            return f"{off}at least {self.lower:g}{unit}"
        return f"at most {self.upper:g}{unit}" if self.upper is not None else f"any value{unit}"


@cache
def _hints(group: type) -> dict[str, Any]:
    """Types of a group's fields. They are cached, because resolving them takes most of the time of a group."""
    return get_type_hints(group)


def specs(group: type, prefix: str = "") -> Iterator[Spec]:
    """Declarations of a group in order, nested groups with dotted names."""
    hints = _hints(group)
    for entry in dataclasses.fields(group):
        hint = hints[entry.name]
        if hint is Choice:
            yield from _choice_specs(entry, prefix)
        elif dataclasses.is_dataclass(hint):
            yield from specs(hint, f"{prefix}{entry.name}.")  # type: ignore[arg-type]
        else:
            yield _spec(group, entry.name, prefix)


@cache
def _spec(group: type, name: str, prefix: str) -> Spec:
    """Declaration of one field; cached, because making it takes most of the time of a configuration."""
    hint, entry = _hints(group)[name], next(one for one in dataclasses.fields(group) if one.name == name)
    kind = get_origin(hint) or hint
    if kind is UnionType or kind not in {bool, int, float, str, tuple}:
        raise TypeError(f"{group.__name__}.{name}: a parameter cannot be a {hint}")
    if "doc" not in entry.metadata:
        text = f"a dataclass whose fields are all made by parameter(...); {name} is not"
        raise PartError("parameter group", group.__name__, text)
    element = get_args(hint)[0] if kind is tuple else kind
    default: Any = entry.default
    spec = Spec(prefix + name, kind, element, default, **entry.metadata)
    spec.check(default)
    return spec


def _choice_specs(entry: Any, prefix: str) -> Iterator[Spec]:
    meta = entry.metadata
    names, kind = meta["registry"].names(), prefix + entry.name
    text: dict[str, Any] = {"unit": "", "doc": meta["doc"], "lower": None, "upper": None}
    yield Spec(kind, str, str, meta["default"], **text, choices=names, length=None, fixed=meta["fixed"], is_part=True)
    for name in names:
        for spec in specs(meta["registry"].find(name).parameters, f"{prefix}{name}."):
            own = spec.name.removeprefix(prefix)
            yield dataclasses.replace(spec, default=meta["usual"][own]) if own in meta["usual"] else spec


def build(group: type[Group], values: Mapping[str, object], prefix: str = "") -> Group:
    """Build a group from its defaults and the given values, and check it.

    Args:
        group: Dataclass whose fields come from :func:`parameter` or are such groups.
        values: Values by their dotted names; lists are converted to tuples.
        prefix: Dotted path of this group; errors show it before each name.

    Returns:
        The group.

    Raises:
        UnknownNameError: A name is not declared; the error lists the alternatives.
        ParameterError: A value violates its declaration, or a relation between values.
    """
    declared = {spec.name: spec for spec in specs(group)}
    for name, value in values.items():
        if name not in declared:
            whose = f" of {prefix.rstrip('.')}" if prefix else ""
            raise UnknownNameError(f"parameter{whose}", name, declared)
        checked = tuple(value) if isinstance(value, list) else value
        dataclasses.replace(declared[name], name=prefix + name).check(checked)
    return _make(group, values)


def _make(group: type[Group], values: Mapping[str, object]) -> Group:
    hints = _hints(group)  # type: ignore[arg-type]
    made: dict[str, object] = {}
    for entry in dataclasses.fields(group):  # type: ignore[arg-type]
        inner = hints[entry.name]
        if inner is Choice:
            kind = str(values.get(entry.name, entry.metadata["default"]))
            usual = entry.metadata["usual"]
            made[entry.name] = _make_choice(entry.metadata["registry"], kind, {**usual, **values})
        elif dataclasses.is_dataclass(inner):
            made[entry.name] = _make(inner, _below(entry.name, values))  # type: ignore[arg-type]
        elif entry.name in values:
            value = values[entry.name]
            made[entry.name] = tuple(value) if isinstance(value, list) else value
    return group(**made)


def values_of(group: object, prefix: str = "") -> dict[str, Value]:
    """Dotted names and values of a group, from which :func:`build` makes the same group again."""
    out: dict[str, Value] = {}
    for entry in dataclasses.fields(group):  # type: ignore[arg-type]
        value = getattr(group, entry.name)
        if isinstance(value, Choice):
            out[prefix + entry.name] = value.kind
            for name, inner in value.groups.items():
                out |= values_of(inner, f"{prefix}{name}.")
        elif dataclasses.is_dataclass(value):
            out |= values_of(value, f"{prefix}{entry.name}.")
        else:
            out[prefix + entry.name] = value
    return out


def fill(record: Any, group: object) -> None:
    """Write the numbers of parameters into the fields of a record that have the same names.

    A choice among texts becomes its index; see :mod:`teleop_core.kernels.groups` for the fields.
    """
    for entry in dataclasses.fields(group):  # type: ignore[arg-type]
        value = getattr(group, entry.name)
        if isinstance(value, Choice):
            parts = {entry.name: entry.metadata["registry"].names().index(value.kind), **value.groups}
        else:
            parts = {entry.name: value}
        for name, part in parts.items():
            if name not in record.dtype.names:
                continue
            if dataclasses.is_dataclass(part):
                fill(record[name], part)
            else:
                record[name] = entry.metadata["choices"].index(part) if isinstance(part, str) else part
