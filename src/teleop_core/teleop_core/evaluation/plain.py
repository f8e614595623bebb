"""Plain: values of metrics as dictionaries of numbers and texts, ready for JSON."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Values: TypeAlias = "Mapping[str, object] | DataclassInstance"
"""Results of a metric: a dataclass, or a mapping of names to values. A value may itself be such a mapping."""
Leaf: TypeAlias = float | int | str | None
Plain: TypeAlias = "dict[str, Plain] | Leaf"


def plain(values: Values) -> dict[str, Plain]:
    """Values as dictionaries, texts and numbers; numbers that are not finite become None.

    Raises:
        TypeError: A value has a type that JSON cannot contain.
    """
    entries: Iterator[tuple[object, object]]
    if isinstance(values, Mapping):
        entries = iter(values.items())
    elif is_dataclass(values) and not isinstance(values, type):
        entries = ((field.name, getattr(values, field.name)) for field in fields(values))
    else:
        raise TypeError(f"values are a {type(values).__name__}, must be a mapping of names to values")
    return {str(name): _plain(str(name), value) for name, value in entries}


def _plain(name: str, value: object) -> Plain:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    if isinstance(value, Mapping) or (is_dataclass(value) and not isinstance(value, type)):
        return plain(value)
    raise TypeError(f"{name} is a {type(value).__name__}, must be a number, a text or None")


def leaves(tree: Mapping[str, Plain], before: tuple[str, ...] = ()) -> dict[tuple[str, ...], Leaf]:
    """Values at the leaves of a tree, by their paths."""
    found: dict[tuple[str, ...], Leaf] = {}
    for name, value in tree.items():
        if isinstance(value, dict):
            found |= leaves(value, (*before, name))
        else:
            found[*before, name] = value
    return found
