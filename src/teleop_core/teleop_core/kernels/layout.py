"""Layout: the memory of records, whose types do not depend on the number of joints.

A record begins with its fields of fixed size. Arrays over joints follow, in the order of their declaration. Compiled
code computes where such an array begins from the number of joints, which a record with these arrays contains in
:data:`COUNT`. So the same compiled code runs every arm.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any, Self

import numpy as np

COUNT = "_joints"
"""Field that contains the number of joints; only records with arrays over joints have it."""
_WORD = 8
"""Bytes of each number in an array over joints."""


class PerJoints(int):
    """Size of an array over joints: ``each`` numbers for each of ``joints`` joints."""

    each: int
    joints: int

    def __new__(cls, joints: int, each: int = 1) -> Self:
        """Size of an array."""
        made = super().__new__(cls, each * joints)
        made.each, made.joints = each, joints
        return made


def record_dtype(fields: Any) -> np.dtype[Any]:
    """Type of records whose fields are attributes.

    Args:
        fields: Pairs of name and type, or a dtype, as for :class:`numpy.dtype`. The fields must be numbers of eight
            bytes, or arrays of such numbers, if a size is a :class:`PerJoints`.
    """
    return np.dtype((Record, fields if isinstance(fields, np.dtype) else _laid_out(list(fields))))


def _laid_out(fields: list[Any]) -> np.dtype[Any]:
    """Type in which arrays over joints come last; their titles are their sizes, which NumPy keeps."""
    counts = {size.joints for field in fields for size in _sizes(field) if isinstance(size, PerJoints)}
    if not counts:
        return np.dtype(fields)
    assert len(counts) == 1, "records have arrays over the joints of one arm"
    own = [field for field in fields if any(isinstance(size, PerJoints) for size in _sizes(field))]
    fixed = [(COUNT, "i8"), *(field for field in fields if field not in own)]
    types = [np.dtype(tuple(field[1:]) if len(field) > 2 else field[1]) for field in (*fixed, *own)]
    titles = [*(None for _ in fixed), *(tuple(_sizes(field)) for field in own)]
    sizes = [one.itemsize for one in types]
    sizes[len(fixed) - 1] += -sum(sizes[: len(fixed)]) % _WORD  # so that arrays over joints are aligned
    offsets = np.cumsum([0, *sizes])
    places = {"offsets": offsets[:-1].tolist(), "itemsize": int(offsets[-1])}
    names = [field[0] for field in (*fixed, *own)]
    return np.dtype({"names": names, "formats": types, "titles": titles, **places})  # type: ignore[call-overload,no-any-return]


def _sizes(field: Any) -> tuple[Any, ...]:
    """Shape of a declared field."""
    if len(field) < 3:
        return ()
    return field[2] if isinstance(field[2], tuple) else (field[2],)


def joint_sizes(dtype: np.dtype[Any]) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays over joints in a type of records; sizes over joints are :class:`PerJoints`."""
    if COUNT not in (dtype.names or ()):
        return {}
    assert dtype.fields is not None
    return {name: place[2] for name, place in dtype.fields.items() if len(place) > 2}  # type: ignore[misc]


def records(fields: Any, count: int = 1) -> Any:
    """Zeroed records (count,) whose fields are attributes, for kernels and for plain Python.

    Args:
        fields: Pairs of name and type, or a dtype, as for :class:`numpy.dtype`.
        count: Number of records.

    Returns:
        Array of :class:`~teleop_core.kernels.Record`; take ``[0]`` for one record that shares its memory.
    """
    made = np.zeros(count, record_dtype(fields))
    for size in next(iter(joint_sizes(made.dtype).values()), ()):
        if isinstance(size, PerJoints):
            np.asarray(made)[COUNT] = size.joints
    return made


_NUMPY_RECORD: Any = np.record  # numpy's type stubs declare its parents final


class Record(_NUMPY_RECORD):
    """One record whose fields have priority over other attributes of the same name.

    With :class:`numpy.record`, the name ``size``, ``min`` or ``data`` returns NumPy's own attribute instead of a field
    with that name. Compiled kernels always use the field.
    """

    def __getattribute__(self, name: str) -> Any:
        """Value of a field, or, if there is no such field, NumPy's attribute of that name."""
        fields = np.void.__getattribute__(self, "dtype").fields
        if name in fields:
            return self[name]
        try:
            return super().__getattribute__(name)
        except AttributeError:
            raise AttributeError(_missing(name, fields)) from None

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a field; a record has no other attributes that can be set."""
        fields = np.void.__getattribute__(self, "dtype").fields
        if name not in fields:
            raise AttributeError(_missing(name, fields))
        self[name] = value


def _missing(name: str, fields: Iterable[str]) -> str:
    """Message for a field that does not exist, with the same text as the compiler's message."""
    known = list(fields)
    near = get_close_matches(name, known, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"record has no field {name!r}{hint} (fields: {', '.join(known)})"
