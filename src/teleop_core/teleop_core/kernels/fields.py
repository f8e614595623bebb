"""Fields: declares the fields of a record as a class, so that type checkers and editors know the names.

A class names the fields of a kind of record and gives each field a type::

    class Spring(Fields):
        stiffness: float
        is_on: int
        anchor: Vector3
        pull: PerJoint

``record(Spring, joints)`` makes a record with all fields zero. Kernels annotate it as ``s: Spring``: the type checker
and numba then report unknown fields. A record of several parts inherits from their classes. ``int`` and ``float`` have
64 bits; a truth value is an ``int``, and a choice among texts, of the type ``str``, its index.

A class that inherits from a parameter group, or names one as the type of a field, has the numbers of the group as
fields; see :mod:`teleop_core.kernels.groups`.
"""

import dataclasses
from inspect import get_annotations
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, cast, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

from teleop_core.kernels.geometry import Array
from teleop_core.kernels.groups import Field, group_fields
from teleop_core.kernels.layout import PerJoints, record_dtype, records

Integers = NDArray[np.int64]
PerJoint = Annotated[Array, "joints"]
"""Array with one number for each joint."""
IntegerPerJoint = Annotated[Integers, "joints"]
Vector3 = Annotated[Array, 3]
Quaternion = Annotated[Array, 4]
Wrench = Annotated[Array, 6]
PoseRow = Annotated[Array, 7]
"""Pose: position [m], then quaternion w, x, y, z."""


class Fields:
    """Base of the classes that name the fields of a record; see the docstring of this module."""

    if TYPE_CHECKING:  # for the type checker: attributes that all records have
        dtype: np.dtype[Any]

        def __getitem__(self, name: str) -> Any: ...

        def __setitem__(self, name: str, value: object) -> None: ...


class Cells:
    """Fields of a record by name, looked up once, because a look-up in NumPy takes 1 µs.

    ``cells["now_ns"]`` is a Python number, or an array if the field is an array. An assignment writes into the
    record's memory.

    Args:
        record: The record; this object keeps it alive.
    """

    def __init__(self, record: Any) -> None:
        whole = np.asarray(record)  # array over the same memory
        self._own: dict[str, Any] = {name: whole[name] for name in whole.dtype.names or ()}

    def __getitem__(self, name: str) -> Any:
        """Value of a field."""
        own = self._own[name]
        return own if own.ndim else own.item()

    def __setitem__(self, name: str, value: object) -> None:
        """Set a field."""
        self._own[name][...] = value

    def number(self, name: str) -> memoryview:
        """Memory of a field that is one number, with one element; three times as fast as ``cells[name]``."""
        found: memoryview = self._own[name].reshape(1).data
        return found


_R = TypeVar("_R")


def fields_of(kind: type, joints: int = 0) -> list[Field]:
    """Names and types of the fields of a class; fields of its base classes come first.

    Args:
        kind: The class, of :class:`Fields` or of parameters.
        joints: Number of joints, for arrays with one number for each joint.
    """
    found: dict[str, Field] = {}
    for base in reversed(kind.__mro__):
        if "__dataclass_fields__" in vars(base):
            found |= {field[0]: field for field in group_fields(base)}
        else:
            found |= {name: _field(name, hint, joints) for name, hint in get_annotations(base).items()}
    return list(found.values())


def _field(name: str, hint: Any, joints: int) -> Field:
    if dataclasses.is_dataclass(hint):
        return name, record_dtype(fields_of(cast(type, hint)))
    if get_origin(hint) is not Annotated:
        return name, "f8" if hint is float else "i8"
    array, *shape = get_args(hint)
    sizes = tuple(PerJoints(joints) if size == "joints" else size for size in shape)
    return name, "i8" if array == Integers else "f8", sizes


def record(kind: type[_R], joints: int = 0) -> _R:
    """One record of a kind; all fields are zero."""
    return cast(_R, records(fields_of(kind, joints))[0])


def record_array(kind: type[_R], count: int, joints: int = 0) -> Any:
    """Records (count,) of a kind; all fields are zero."""
    return records(fields_of(kind, joints), count)
