"""Groups: a parameter group becomes fields of a record, so that kernels read the parameters by their own names.

Numbers and lists of numbers of a fixed length become fields, a choice among texts becomes its index, and a group in a
group becomes a record in a record: ``p.device.friction`` is the same attribute of the group and of the record.
"""

import dataclasses
from collections.abc import Iterator
from typing import Any, get_args, get_origin, get_type_hints

from teleop_core.base.parameters import Choice
from teleop_core.kernels.layout import record_dtype

Field = tuple[str, Any] | tuple[str, Any, tuple[int, ...]]
"""Name and type of a field, and its shape if it is an array."""


def group_fields(group: type, like: object = None) -> list[Field]:
    """Fields of a record with the numbers of a parameter group.

    Args:
        group: Parameter group.
        like: Parameters, for fields whose form depends on values: lists of any length, and the parts of a registry.
            None leaves these out, so that the type of the record depends on the group alone.
    """
    hints, found = get_type_hints(group), list[Field]()
    for entry in dataclasses.fields(group):
        found += _fields(entry, hints[entry.name], getattr(like, entry.name, None))
    return found


def _fields(entry: Any, hint: Any, value: Any) -> Iterator[Field]:
    """Fields for one field of a group: none for texts."""
    name = entry.name
    if hint is Choice:
        if value is not None:
            yield name, "i8"
            for part, inner in value.groups.items():
                yield from _nested(part, type(inner), inner)
    elif dataclasses.is_dataclass(hint):
        yield from _nested(name, hint, value)
    elif hint is str:
        yield from [(name, "i8")] if entry.metadata["choices"] else []
    elif get_origin(hint) is not tuple:
        yield name, "f8" if hint is float else "i8"
    elif get_args(hint)[0] is not str:
        length = entry.metadata["length"] or (None if value is None else len(value))
        yield from [] if length is None else [(name, "f8" if get_args(hint)[0] is float else "i8", (length,))]


def _nested(name: str, group: Any, like: object) -> Iterator[Field]:
    inner = group_fields(group, like)
    if inner:
        yield name, record_dtype(inner)
