"""Numba's types of records with arrays over joints, whose number of joints is known only when the code runs.

Numba's own type of a record contains the offset and the shape of every array. A kernel would be compiled again for each
number of joints. Here the type contains a formula: the code reads the number of joints from the record
(:mod:`teleop_core.kernels.layout`), and a field is a view of the size that follows from it.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.boxing import unbox_record
from numba.core.datamodel import models
from numba.core.datamodel.registry import register_default
from numba.core.errors import NumbaNotImplementedError
from numba.core.imputils import lower_getattr_generic, lower_setattr_generic
from numba.core.pythonapi import unbox
from numba.core.typing.typeof import _typeof_ndarray, typeof_impl
from numba.np import arrayobj, numpy_support

from teleop_core.kernels.dependencies import hexdigest
from teleop_core.kernels.layout import COUNT, PerJoints, joint_sizes

_INT = ir.IntType(64)
_RECORD: Any = types.Record


class JointRecord(_RECORD):
    """Record with arrays over joints.

    Args:
        fields: Names, types and offsets; arrays over joints have the size of the fixed fields as their offset.
        size: Size of the fixed fields.
        shapes: Shapes of the arrays over joints, with :class:`PerJoints` for sizes over joints.
    """

    def __init__(self, fields: list[Any], size: int, shapes: dict[str, tuple[int, ...]]) -> None:
        found = self._normalize_fields(fields)
        self.fields, self.size, self.aligned, self.shapes = dict(found), size, False, shapes
        parts = [f"{name}[{one.type};{one.offset};{_described(shapes.get(name, ()))}]" for name, one in found]
        types.Type.__init__(self, f"JointRecord({','.join(parts)};{size})")
        self.bitwidth = size * 8

    @property
    def dtype(self) -> Any:
        """NumPy's type, which depends on the number of joints."""
        raise NumbaNotImplementedError("the size of this record depends on the number of joints")

    def __repr__(self) -> str:
        """Name, which distinguishes all types."""
        return str(self.name)

    def can_convert_to(self, _context: Any, _other: Any) -> None:
        """Records with arrays over joints convert to no other records."""


def _described(shape: tuple[int, ...]) -> list[str]:
    return [f"{size.each}n" if isinstance(size, PerJoints) else str(size) for size in shape]


def _from_struct_dtype(dtype: np.dtype[Any]) -> types.Record:
    """Type of records for the compiler."""
    shapes = joint_sizes(dtype)
    if not shapes:
        return _plain_from_struct_dtype(dtype)
    fields, fixed = [], min(dtype.fields[name][1] for name in shapes)  # type: ignore[index]
    for name in dtype.names or ():
        kind, place = dtype.fields[name][:2]  # type: ignore[index]
        made = numpy_support.from_dtype(kind)
        if name in shapes:
            made, place = types.Array(made.dtype, made.ndim, "C"), fixed
        fields.append((name, {"type": made, "offset": place}))
    return JointRecord(fields, fixed, shapes)


def _symbol(kind: Any) -> tuple[str, tuple[int]]:
    """Part of the symbols of kernels that take a record.

    Numba puts a number there that differs from process to process. Two kernels from the disk could have one symbol, and
    the address of the first one would be taken for both.
    """
    return type(kind).__name__, (int(hexdigest([kind.name])[:15], 16),)


_RECORD.mangling_args = property(_symbol)
_plain_from_struct_dtype = numpy_support.from_struct_dtype
numpy_support.from_struct_dtype = _from_struct_dtype
register_default(JointRecord)(models.RecordModel)
unbox(JointRecord)(unbox_record)


@typeof_impl.register(np.ndarray)
def _typeof_array(value: Any, c: Any) -> Any:
    """Type of an array; records of unknown size have unknown distances."""
    made = _typeof_ndarray(value, c)
    return made.copy(layout="A") if isinstance(made.dtype, JointRecord) else made


@lower_getattr_generic(JointRecord)
def _get(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    """Field of a record: a number, or a view of an array."""
    if name not in kind.shapes:
        return arrayobj.record_getattr(context, builder, kind, value, name)
    joints = builder.load(cgutils.get_record_member(builder, value, kind.offset(COUNT), _INT))
    joints.set_metadata("invariant.load", builder.module.add_metadata([]))
    begin: Any = _INT(kind.size)
    for before, shape in kind.shapes.items():
        sizes = [builder.mul(joints, _INT(s.each)) if isinstance(s, PerJoints) else _INT(s) for s in shape]
        if before == name:
            break
        begin = builder.add(begin, _bytes(builder, sizes))
    array = kind.typeof(name)
    data = cgutils.pointer_add(builder, value, begin, context.get_data_type(array.dtype).as_pointer())
    strides = [_bytes(builder, sizes[axis + 1 :]) for axis in range(len(sizes))]
    made = arrayobj.make_array(array)(context, builder)
    arrayobj.populate_array(
        made,
        data=data,
        shape=cgutils.pack_array(builder, sizes),
        strides=cgutils.pack_array(builder, strides),
        itemsize=_INT(8),
        meminfo=None,
    )
    return made._getvalue()


def _bytes(builder: Any, sizes: list[Any]) -> Any:
    """Bytes of an array of numbers of eight bytes."""
    product: Any = _INT(8)
    for size in sizes:
        product = builder.mul(product, size)
    return product


@lower_setattr_generic(JointRecord)
def _set(context: Any, builder: Any, signature: Any, arguments: Any, name: str) -> Any:
    """Set a field; an array gets the values of another array."""
    kind, _ = signature.args
    if name not in kind.shapes:
        return arrayobj.record_setattr(context, builder, signature, arguments, name)

    def copy(target: Any, source: Any) -> None:
        target[:] = source

    view, array = _get(context, builder, kind, arguments[0], name), kind.typeof(name)
    return context.compile_internal(builder, copy, types.void(array, array), (view, arguments[1]))
