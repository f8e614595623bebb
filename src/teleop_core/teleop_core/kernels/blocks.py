"""Blocks: the arguments of a kernel as words in memory, and compiled code that unpacks them."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np import arrayobj

from teleop_core.base.errors import KernelError

_WORD = ir.IntType(64)


def packed(values: Any, kinds: Any) -> list[int]:
    """Words of some values of given types, in order."""
    return [word for value, kind in zip(values, kinds, strict=True) for word in _words(value, kind)]


def _words(value: Any, kind: Any) -> list[int]:
    """Words of a value; :func:`_value` reads them in the same order."""
    if isinstance(kind, types.BaseTuple):
        return packed(value, kind)
    if isinstance(kind, types.Record):
        return [np.asarray(value).ctypes.data]
    if isinstance(kind, types.Array):
        return [value.ctypes.data, value.itemsize, *value.shape, *value.strides]
    if isinstance(kind, types.FunctionType):
        return [value._wrapper_address, id(value), value._code_address]
    if isinstance(kind, types.Opaque):  # None, or a kernel: the type says it all
        return []
    if isinstance(kind, types.Number | types.Boolean):
        return [int.from_bytes(np.asarray(value).tobytes().ljust(8, b"\0"), "little", signed=True)]
    raise KernelError("argument", f"{value!r} is {kind}, must be a number, an array, a record or a pointer")


def _value(context: Any, builder: Any, kind: Any, words: Any) -> Any:
    """Value of a type from the next words; ``words`` is an iterator over the addresses of words."""
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        return context.make_tuple(builder, kind, [_value(context, builder, part, words) for part in parts])
    if isinstance(kind, types.Record):
        return builder.inttoptr(builder.load(next(words)), context.get_value_type(kind))
    if isinstance(kind, types.Array):
        return _array(context, builder, kind, words)
    if isinstance(kind, types.FunctionType):
        made = cgutils.create_struct_proxy(kind.get_precise())(context, builder)
        for name in ("c_addr", "py_addr", "jit_addr"):
            setattr(made, name, builder.inttoptr(builder.load(next(words)), cgutils.voidptr_t))
        return made._getvalue()
    if isinstance(kind, types.Opaque):
        return context.get_dummy_value()
    return context.unpack_value(builder, kind, builder.bitcast(next(words), context.get_data_type(kind).as_pointer()))


def _array(context: Any, builder: Any, kind: Any, words: Any) -> Any:
    data, itemsize, *sizes = (builder.load(next(words)) for _ in range(2 + 2 * kind.ndim))
    made = arrayobj.make_array(kind)(context, builder)
    arrayobj.populate_array(
        made,
        data=builder.inttoptr(data, context.get_data_type(kind.dtype).as_pointer()),
        shape=cgutils.pack_array(builder, sizes[: kind.ndim]),
        strides=cgutils.pack_array(builder, sizes[kind.ndim :]),
        itemsize=itemsize,
        meminfo=None,
    )
    return made._getvalue()


def unpacking(kinds: tuple[Any, ...], result: Any) -> Any:
    """Function for the compiler: it unpacks a block and calls the kernel whose address comes first."""

    @intrinsic  # type: ignore[misc]
    def run(_context: Any, block: Any) -> Any:
        def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            first = builder.inttoptr(arguments[0], _WORD.as_pointer())
            words = (builder.gep(first, [_WORD(place)]) for place in range(1 << 20))
            address = builder.load(next(words))
            values = [_value(context, builder, kind, words) for kind in kinds]
            _call(context, builder, address, result, kinds, values)
            return context.get_dummy_value()

        return types.void(types.int64), generate

    return run


def _call(context: Any, builder: Any, address: Any, result: Any, kinds: Any, values: Any) -> None:
    """Call compiled code at an address; its exception becomes the caller's."""
    kind = context.call_conv.get_function_type(result, kinds)
    code = builder.inttoptr(address, kind.as_pointer())
    status, _ = context.call_conv.call_function(builder, code, result, kinds, values)
    with cgutils.if_unlikely(builder, status.is_error):
        context.call_conv.return_status_propagate(builder, status)


@intrinsic  # type: ignore[misc]
def call_address(_context: Any, address: Any, block: Any) -> Any:
    """Call compiled code that takes the address of a block."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        _call(context, builder, arguments[0], types.none, (types.int64,), arguments[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), generate


@intrinsic  # type: ignore[misc]
def call_c(_context: Any, block: Any) -> Any:
    """Call the C function without arguments whose address is the first word of a block."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        address = builder.load(builder.inttoptr(arguments[0], _WORD.as_pointer()))
        builder.call(builder.inttoptr(address, ir.FunctionType(ir.VoidType(), []).as_pointer()), [])
        return context.get_dummy_value()

    return types.void(types.int64), generate


@intrinsic  # type: ignore[misc]
def copy_memory(_context: Any, source: Any, target: Any, size: Any) -> Any:
    """Copy bytes from an address to another one; most often they are a few words, which a loop copies fastest."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        begin, end, count = arguments
        words = builder.lshr(count, _WORD(3))
        _copy(builder, _WORD, begin, end, words)
        done = builder.shl(words, _WORD(3))
        begin, end, count = builder.add(begin, done), builder.add(end, done), builder.sub(count, done)
        _copy(builder, ir.IntType(8), begin, end, count)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


def _copy(builder: Any, kind: Any, source: Any, target: Any, count: Any) -> None:
    """Copy numbers of a type."""
    places = [builder.inttoptr(one, kind.as_pointer()) for one in (source, target)]
    with cgutils.for_range(builder, count) as loop:
        source, target = (builder.gep(one, [loop.index]) for one in places)
        builder.store(builder.load(source, align=1), target, align=1)


@intrinsic  # type: ignore[misc]
def word_at(_context: Any, address: Any) -> Any:
    """Word at an address."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.load(builder.inttoptr(arguments[0], _WORD.as_pointer()))

    return types.int64(types.int64), generate
