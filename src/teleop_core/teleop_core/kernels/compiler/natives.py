"""Compiled forms of plain functions that kernels call: room, memory and addresses."""

import math
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import float64, int32, int64, uint8
from numba.core import cgutils, types
from numba.extending import intrinsic, lower_builtin, overload, type_callable
from numba.np import arrayobj

from teleop_core.kernels import addresses, memory
from teleop_core.kernels.compiler import blocks
from teleop_core.kernels.room import room

_WORD = ir.IntType(64)


@type_callable(room)
def _type_of_room(_context: Any) -> Any:
    def typer(rows: Any, columns: Any = None) -> Any:
        sizes = [size for size in (rows, columns) if size is not None]
        if all(isinstance(size, types.IntegerLiteral) for size in sizes):
            return types.Array(types.float64, len(sizes), "C")
        return None

    return typer


@lower_builtin(room, types.IntegerLiteral)
@lower_builtin(room, types.IntegerLiteral, types.IntegerLiteral)
def _lower_room(context: Any, builder: Any, signature: Any, _arguments: Any) -> Any:
    sizes = [int(kind.literal_value) for kind in signature.args]
    memory = ir.ArrayType(ir.DoubleType(), math.prod(sizes))
    with builder.goto_entry_block():
        place = builder.alloca(memory)
    made = arrayobj.make_array(signature.return_type)(context, builder)
    strides = [8 * math.prod(sizes[i + 1 :]) for i in range(len(sizes))]
    arrayobj.populate_array(
        made,
        data=builder.bitcast(place, ir.DoubleType().as_pointer()),
        shape=cgutils.pack_array(builder, [context.get_constant(types.intp, s) for s in sizes]),
        strides=cgutils.pack_array(builder, [context.get_constant(types.intp, s) for s in strides]),
        itemsize=context.get_constant(types.intp, 8),
        meminfo=None,
    )
    return made._getvalue()


def _lowered(function: Callable[..., Any], result: Any, *arguments: Any) -> Callable[[Any], Any]:
    """Decorator: the code that the compiler generates for a call of a plain function with these types."""
    typers: dict[int, Any] = {1: lambda _a: result, 2: lambda _a, _b: result, 3: lambda _a, _b, _c: result}

    def register(generate: Any) -> Any:
        type_callable(function)(lambda _context: typers[len(arguments)])
        return lower_builtin(function, *arguments)(generate)

    return register


@_lowered(addresses.call_address, types.none, types.int64, types.int64)
def _call_address(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    blocks.call(context, builder, arguments[0], types.none, (types.int64,), arguments[1:])
    return context.get_dummy_value()


@_lowered(addresses.call_c, types.none, types.int64)
def _call_c(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    address = builder.load(builder.inttoptr(arguments[0], _WORD.as_pointer()))
    builder.call(builder.inttoptr(address, ir.FunctionType(ir.VoidType(), []).as_pointer()), [])
    return context.get_dummy_value()


@_lowered(addresses.copy_memory, types.none, types.int64, types.int64, types.int64)
def _copy_memory(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    """Copy bytes; most often they are a few words, which a loop copies fastest."""
    begin, end, count = arguments
    words = builder.lshr(count, _WORD(3))
    _copy(builder, _WORD, begin, end, words)
    done = builder.shl(words, _WORD(3))
    begin, end, count = builder.add(begin, done), builder.add(end, done), builder.sub(count, done)
    _copy(builder, ir.IntType(8), begin, end, count)
    return context.get_dummy_value()


def _copy(builder: Any, kind: Any, source: Any, target: Any, count: Any) -> None:
    """Copy numbers of a type."""
    places = [builder.inttoptr(one, kind.as_pointer()) for one in (source, target)]
    with cgutils.for_range(builder, count) as loop:
        source, target = (builder.gep(one, [loop.index]) for one in places)
        builder.store(builder.load(source, align=1), target, align=1)


@_lowered(addresses.word_at, types.int64, types.int64)
def _word_at(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    return builder.load(builder.inttoptr(arguments[0], _WORD.as_pointer()))


@intrinsic
def _pointer(_context: Any, address: Any) -> Any:
    """Address as an untyped pointer."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return types.voidptr(address), generate


@intrinsic
def _call(_context: Any, function: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Call of a C function of up to four arguments; the calling convention ignores further ones."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.IntType(32), [word] * 4)
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.int32(types.int64, types.int64, types.int64, types.int64, types.int64), generate


for _plain, _kind in (
    (memory.floats, float64),
    (memory.integers, int64),
    (memory.shorts, int32),
    (memory.octets, uint8),
):

    def _compiled(kind: Any) -> Any:
        return lambda address, count: lambda address, count: numba.carray(_pointer(address), count, kind)  # type: ignore[call-arg, attr-defined]

    overload(_plain)(_compiled(_kind))

# numba compares the signatures of both functions, annotations too.
overload(memory.call)(lambda function, a, b, c, d: lambda function, a, b, c, d: _call(function, a, b, c, d))  # type: ignore[call-arg]  # noqa: PLW0108
