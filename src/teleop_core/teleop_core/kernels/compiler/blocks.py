"""Blocks: compiled code that unpacks the arguments of a kernel from words in memory."""

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np import arrayobj

_WORD = ir.IntType(64)


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
            call(context, builder, address, result, kinds, values)
            return context.get_dummy_value()

        return types.void(types.int64), generate

    return run


def call(context: Any, builder: Any, address: Any, result: Any, kinds: Any, values: Any) -> None:
    """Call compiled code at an address; its exception becomes the caller's."""
    kind = context.call_conv.get_function_type(result, kinds)
    code = builder.inttoptr(address, kind.as_pointer())
    status, _ = context.call_conv.call_function(builder, code, result, kinds, values)
    with cgutils.if_unlikely(builder, status.is_error):
        context.call_conv.return_status_propagate(builder, status)
