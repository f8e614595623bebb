"""Kinds: texts that stand for the types of a kernel's arguments, without the compiler.

Compiled code is stored for one tuple of kinds. Two values have the same kind exactly if the compiler gives them the
same type. The texts are those of numba, except for records, whose text is a digest of their fields.
"""

import re
from typing import Any

import numpy as np

from teleop_core.kernels.dependencies import digest, hexdigest
from teleop_core.kernels.layout import PerJoints, joint_sizes

Kinds = tuple[str, ...]

UNKNOWN = "?"
"""Kind of a value that only the compiler knows: the code is not stored by its kind."""

_arrays: dict[tuple[int, int, int], tuple[Any, str]] = {}
"""Kinds of arrays, by the identity of their NumPy type, which is kept, the number of axes and the flags."""
_dtypes: dict[int, tuple[Any, str]] = {}
_MOST = 4096  # of each: a program of many sessions makes new NumPy types in each, and those that are kept take memory
_DECLARED = re.compile(r"\w+(?:\[[^\]]*\])?")


def kinds_of(values: tuple[object, ...]) -> Kinds:
    """Kinds of some values."""
    return tuple(map(kind_of, values))


def kind_of(value: Any) -> str:
    """Kind of a value: a number, an array, a record, a pointer, a kernel, None, or a tuple of these."""
    if isinstance(value, np.ndarray):
        dtype = value.dtype
        found = _arrays.get((id(dtype), value.ndim, value.flags.num))
        return found[1] if found is not None else _array_kind(value)
    scalar = _SCALARS.get(type(value))
    if scalar is not None:
        return scalar
    if isinstance(value, np.void):
        return _record_kind(value.dtype)
    return _tuple_kind(value) if isinstance(value, tuple) else _other_kind(value)


def _tuple_kind(values: tuple[Any, ...]) -> str:
    kinds, made = kinds_of(values), type(values)
    name = "" if made is tuple else f"{made.__module__}.{made.__qualname__}{getattr(made, '_fields', '')}"
    return UNKNOWN if UNKNOWN in kinds else f"{name}({','.join(kinds)})"


def _other_kind(value: Any) -> str:
    if type(value) is int:
        return "int64" if -(1 << 63) <= value < 1 << 63 else UNKNOWN
    if isinstance(value, np.number):
        return value.dtype.name
    known = getattr(value, "kernel_kind", None)
    return known if isinstance(known, str) else UNKNOWN


_SCALARS: dict[type, str] = {
    float: "float64",
    bool: "bool",
    np.float64: "float64",
    np.int64: "int64",
    np.bool_: "bool",
    type(None): "none",
}


def _array_kind(value: Any) -> str:
    dtype, flags = value.dtype, value.flags
    layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
    if dtype.names is not None:
        name, layout = _record_kind(dtype), "A" if joint_sizes(dtype) else layout
    elif dtype.isnative and dtype.kind in "bifc":
        name = dtype.name
    else:
        return UNKNOWN
    made = _array_text(name, value.ndim, layout, flags.writeable)
    if len(_arrays) >= _MOST:
        _arrays.clear()
    _arrays[id(dtype), value.ndim, flags.num] = dtype, made
    return made


def _array_text(name: str, ndim: int, layout: str, is_writeable: bool) -> str:
    return f"array({name}, {ndim}d, {layout})" if is_writeable else f"array({name}, {ndim}d, {layout}, readonly)"


def _record_kind(dtype: Any) -> str:
    """Kind of a record, by the identity of its NumPy type, which is kept."""
    known = _dtypes.get(id(dtype))
    if known is None:
        if len(_dtypes) >= _MOST:
            _dtypes.clear()
        known = _dtypes[id(dtype)] = dtype, f"record({hexdigest([_described(dtype)])})"
    return known[1]


def _described(dtype: Any) -> str:
    """Text of the fields of a record; sizes over joints count, their number does not."""
    shapes = joint_sizes(dtype)
    fixed = min((dtype.fields[name][1] for name in shapes), default=dtype.itemsize)
    parts = []
    for name in dtype.names:
        kind, place = dtype.fields[name][:2]
        base = kind.base
        inner = _described(base) if base.names else base.str
        shape = [f"{s.each}n" if isinstance(s, PerJoints) else str(s) for s in shapes.get(name, kind.shape)]
        parts.append(f"{name}:{inner}:{fixed if name in shapes else place}:{','.join(shape)}")
    return f"{';'.join(parts)};{fixed};{dtype.isalignedstruct}"


def declared(signature: Any) -> tuple[Kinds, str]:
    """Kinds of the arguments and of the result of a signature.

    Args:
        signature: Text such as ``"float64(float64[::1], float64)"``, or a signature of numba.
    """
    if not isinstance(signature, str):
        return tuple(map(str, signature.args)), str(signature.return_type)
    result, *arguments = (_declared(text) for text in _DECLARED.findall(signature))
    return tuple(arguments), result


def _declared(text: str) -> str:
    name, bracket, axes = text.rstrip("]").partition("[")
    if not bracket:
        return {"void": "none", "boolean": "bool"}.get(name, name)
    return _array_text(name, axes.count(",") + 1, "C" if axes.endswith("::1") else "A", True)


def pointer_kind(arguments: Kinds, result: str) -> str:
    """Kind of a pointer to a function."""
    return f"function({result}({','.join(arguments)}))"


def kernel_kind(function: Any) -> str:
    """Kind of a kernel that is an argument of another one."""
    return f"kernel({function.__module__}.{function.__qualname__},{digest(function)})"
